# SPDX-License-Identifier: Apache-2.0
"""Functions of the robot-by-robot form that numba compiles; only controllers import them."""
