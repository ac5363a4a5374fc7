# SPDX-License-Identifier: Apache-2.0
"""Metrics that compare a recording with other runs of the same scenario."""
