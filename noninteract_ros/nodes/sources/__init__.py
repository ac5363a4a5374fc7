# SPDX-License-Identifier: Apache-2.0
"""Nodes of the sources: references and inputs of a human or of autonomy."""
