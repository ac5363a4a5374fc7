# SPDX-License-Identifier: Apache-2.0
"""Node of the program `robot_team`, the simulated team."""
