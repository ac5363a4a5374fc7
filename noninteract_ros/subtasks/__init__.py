# SPDX-License-Identifier: Apache-2.0
"""Subtasks of a team: values, Jacobians and the arithmetic of values with rotations."""
