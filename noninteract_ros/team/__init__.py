# SPDX-License-Identifier: Apache-2.0
"""Robots joined into one Pinocchio model: kinematics, dynamics and limits of the team."""
