# SPDX-License-Identifier: Apache-2.0
"""The controller without ROS: states and inputs in, torques and energy accounts out."""
