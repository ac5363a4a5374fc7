# SPDX-License-Identifier: Apache-2.0
"""Identities of the law at random states, and the plain form of the paper."""
