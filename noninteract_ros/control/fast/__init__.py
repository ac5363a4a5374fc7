# SPDX-License-Identifier: Apache-2.0
"""Robot-by-robot form of the law, at a cost linear in the number of robots."""
