# SPDX-License-Identifier: Apache-2.0
"""Start, supervision and end of all programs of a run."""
