# SPDX-License-Identifier: Apache-2.0
"""Conversion of messages to arrays and back."""
