# SPDX-License-Identifier: Apache-2.0
"""Array type of all signatures; docstrings give shapes and units."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
