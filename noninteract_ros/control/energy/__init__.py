# SPDX-License-Identifier: Apache-2.0
"""Energy of the team: storage functions, tank, gates, and the external torque."""
