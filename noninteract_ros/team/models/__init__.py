# SPDX-License-Identifier: Apache-2.0
"""Robot models that a scenario can name: point masses, planar arms and URDF."""
