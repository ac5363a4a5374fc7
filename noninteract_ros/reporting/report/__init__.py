# SPDX-License-Identifier: Apache-2.0
"""The report of a run: all metrics, checks, tables and figures."""
