# SPDX-License-Identifier: Apache-2.0
"""Random passive environments against the laws, in compiled simulations."""
