# SPDX-License-Identifier: Apache-2.0
"""The operator console without ROS: web server, protocol and driving."""
