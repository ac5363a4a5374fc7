# SPDX-License-Identifier: Apache-2.0
"""Walls: constraints that keep joints within limits and bodies apart."""
