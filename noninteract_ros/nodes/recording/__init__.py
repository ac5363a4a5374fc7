# SPDX-License-Identifier: Apache-2.0
"""Node `recorder`: recording of a run into an MCAP file."""
