# SPDX-License-Identifier: Apache-2.0
"""The kinds of robot that a scenario can name: point masses, planar arms and URDF."""
