# SPDX-License-Identifier: Apache-2.0
"""The same law robot by robot, at a cost linear in the number of robots."""
