# SPDX-License-Identifier: Apache-2.0
"""Sources of references: what leads a subtask."""
