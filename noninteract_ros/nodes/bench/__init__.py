# SPDX-License-Identifier: Apache-2.0
"""The parts of `noninteract bench` that need ROS."""
