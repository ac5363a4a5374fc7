# SPDX-License-Identifier: Apache-2.0
"""Recordings of runs, and metrics and figures computed from them."""
