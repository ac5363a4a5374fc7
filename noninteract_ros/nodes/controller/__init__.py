# SPDX-License-Identifier: Apache-2.0
"""Node of the program `controller`."""
