# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""By how much an output steps."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_OFF_STEPS = 0.05
"""
Share of the changes that may lie off the steps, as those to a few odd readings do; smooth noise
seems to step by a tenth of it then, which is far below what a step matters from.
"""
_ROUNDING = 1e-12
"""Of a value, or of 1: the same value twice may differ by so much."""


def step_of(rows: Array) -> Array:
    """
    Return the least change from a sample to the next, but for few that are smaller.

    Parameters
    ----------
    rows : ndarray, shape (axes, n)
        Samples.

    Returns
    -------
    ndarray, shape (axes,)
        Infinite where nothing changes.

    Examples
    --------
    >>> step_of(np.array([[0.0, 2, 2, 4, 6, 2, 4], [5, 5, 5, 5, 5, 5, 5]]))
    array([ 2., inf])

    """
    steps = np.full(len(rows), np.inf)
    changes = np.abs(np.diff(rows, axis=1))
    there = changes >= _ROUNDING * np.maximum(1, np.abs(rows[:, 1:]))
    for axis, count in enumerate(there.sum(axis=1).tolist()):
        if count:
            place = int(_OFF_STEPS * count)
            steps[axis] = np.partition(changes[axis, there[axis]], place)[place]
    return steps
