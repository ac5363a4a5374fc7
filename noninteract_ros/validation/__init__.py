# SPDX-License-Identifier: Apache-2.0
"""Validation of the law and of scenarios before operation."""
