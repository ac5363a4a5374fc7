# SPDX-License-Identifier: Apache-2.0
"""Benchmarks of nodes and programs for `noninteract bench`."""
