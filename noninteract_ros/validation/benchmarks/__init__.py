# SPDX-License-Identifier: Apache-2.0
"""Timing of the law and of the controller without ROS."""
