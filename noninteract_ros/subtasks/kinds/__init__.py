# SPDX-License-Identifier: Apache-2.0
"""Kinds of subtask that a scenario can name."""
