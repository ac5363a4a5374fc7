# SPDX-License-Identifier: Apache-2.0
"""Force feedback between an operator's device and the team over a delayed link."""
