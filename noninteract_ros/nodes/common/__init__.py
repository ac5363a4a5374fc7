# SPDX-License-Identifier: Apache-2.0
"""Base node, program startup, QoS and stamp checks shared by all programs."""
