# SPDX-License-Identifier: Apache-2.0
"""Compiled functions of the robot-by-robot form; only the controller imports them."""
