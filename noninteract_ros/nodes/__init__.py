# SPDX-License-Identifier: Apache-2.0
"""The programs: thin rclpy nodes around the core."""

import os

# Matrices of a team are small; BLAS threads would only fight over the cores with other nodes.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
