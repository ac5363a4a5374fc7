# SPDX-License-Identifier: Apache-2.0
"""Passive noninteracting control of robot teams led by a human."""

__version__ = "0.1.0"
