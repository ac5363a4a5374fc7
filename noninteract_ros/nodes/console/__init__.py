# SPDX-License-Identifier: Apache-2.0
"""Node `operator_console`: ROS interface of the operator console."""
