# SPDX-License-Identifier: Apache-2.0
"""The law robot by robot in machine code; only a controller imports it, for numba takes time."""
