# SPDX-License-Identifier: Apache-2.0
"""An operator's loop over a delayed link, with and without passivity control."""
