# SPDX-License-Identifier: Apache-2.0
"""Comparison of a recording with rehearsals of its scenario."""
