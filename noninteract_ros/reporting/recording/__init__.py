# SPDX-License-Identifier: Apache-2.0
"""Recordings: writing, repairing and reading MCAP files as arrays."""
