# SPDX-License-Identifier: Apache-2.0
"""Report of a run: metrics, checks, tables and figures."""
