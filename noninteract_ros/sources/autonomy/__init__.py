# SPDX-License-Identifier: Apache-2.0
"""Autonomous planning of references."""
