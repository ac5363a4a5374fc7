# SPDX-License-Identifier: Apache-2.0
"""The kinds of subtask that a scenario can name."""
