# SPDX-License-Identifier: Apache-2.0
"""Stops, singularities, joint limits, and transitions without a step of torque."""
