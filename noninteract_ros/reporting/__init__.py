# SPDX-License-Identifier: Apache-2.0
"""Recordings of runs, and the metrics and figures that are made of them."""
