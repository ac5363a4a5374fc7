# SPDX-License-Identifier: Apache-2.0
"""Base class, program start, QoS and time checks that all programs share."""
