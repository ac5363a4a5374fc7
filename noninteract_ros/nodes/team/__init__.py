# SPDX-License-Identifier: Apache-2.0
"""The program `robot_team`, the simulated team."""
