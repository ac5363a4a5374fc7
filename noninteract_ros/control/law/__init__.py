# SPDX-License-Identifier: Apache-2.0
"""The control laws and the impedance of the subtasks, in dense form."""
