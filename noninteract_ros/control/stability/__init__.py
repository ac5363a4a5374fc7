# SPDX-License-Identifier: Apache-2.0
"""Stability of the sampled closed loops."""
