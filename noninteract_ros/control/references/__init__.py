# SPDX-License-Identifier: Apache-2.0
"""References of the subtasks: inputs, authority and the resulting desired motion."""
