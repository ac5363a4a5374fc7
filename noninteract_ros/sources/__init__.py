# SPDX-License-Identifier: Apache-2.0
"""Sources of references: the human operator, the autonomous planner and the link between."""
