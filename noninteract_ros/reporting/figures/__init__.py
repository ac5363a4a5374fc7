# SPDX-License-Identifier: Apache-2.0
"""Figures of a recorded run over time and from above."""
