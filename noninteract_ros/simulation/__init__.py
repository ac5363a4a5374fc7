# SPDX-License-Identifier: Apache-2.0
"""Simulated team with its environment: objects, doors, walls and pushes."""
