# SPDX-License-Identifier: Apache-2.0
"""The programs that send references for a human or for autonomy."""
