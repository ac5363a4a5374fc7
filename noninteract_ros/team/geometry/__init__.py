# SPDX-License-Identifier: Apache-2.0
"""Collision bodies and hulls of robots and surroundings, and the distances between them."""
