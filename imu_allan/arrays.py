# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Types of arrays, as annotations name them, and runs of equal items."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def runs(changes: Bools, count: int) -> Iterator[tuple[int, int]]:
    """Yield spans between changes; `changes[i]` says whether item i + 1 differs from item i."""
    if count == 0:
        return
    yield from pairwise([0, *(np.flatnonzero(changes) + 1).tolist(), count])
