# SPDX-License-Identifier: Apache-2.0
"""Recordings: MCAP files written, repaired and read back as arrays."""
