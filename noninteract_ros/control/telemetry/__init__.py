# SPDX-License-Identifier: Apache-2.0
"""Quantities of a tick for topics and diagnostics."""
