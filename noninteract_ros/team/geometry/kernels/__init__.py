# SPDX-License-Identifier: Apache-2.0
"""Compiled kinematics of bodies and distances between them."""
