# SPDX-License-Identifier: Apache-2.0
"""A simulated team with its surroundings."""
