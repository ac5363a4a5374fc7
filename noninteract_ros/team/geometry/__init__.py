# SPDX-License-Identifier: Apache-2.0
"""Shapes of robots and surroundings."""
