# SPDX-License-Identifier: Apache-2.0
"""Checks of the law and of scenarios before anything moves."""
