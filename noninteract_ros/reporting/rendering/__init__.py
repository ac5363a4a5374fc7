# SPDX-License-Identifier: Apache-2.0
"""Pictures and animations of a run in three dimensions."""
