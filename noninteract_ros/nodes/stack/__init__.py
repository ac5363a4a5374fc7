# SPDX-License-Identifier: Apache-2.0
"""Start, monitoring and shutdown of all programs of a run."""
