# SPDX-License-Identifier: Apache-2.0
"""The human operator: emulated hand and device, and inputs of real devices."""
