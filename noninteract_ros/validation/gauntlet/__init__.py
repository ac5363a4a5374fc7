# SPDX-License-Identifier: Apache-2.0
"""Stability of the laws in contact with random passive environments, in compiled simulations."""
