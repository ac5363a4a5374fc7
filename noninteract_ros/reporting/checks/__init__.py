# SPDX-License-Identifier: Apache-2.0
"""Checks of a run or a scenario against limits."""
