# SPDX-License-Identifier: Apache-2.0
"""Operator console without ROS: web server, page protocol, scene and reference generation."""
