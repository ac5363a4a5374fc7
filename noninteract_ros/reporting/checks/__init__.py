# SPDX-License-Identifier: Apache-2.0
"""Claims about a run or a scenario, judged against limits."""
