# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Types of arrays, as annotations name them."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
