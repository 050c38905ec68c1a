# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""How many samples stand at the lowest and at the highest value, in constant memory."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

_ROUNDING = 1e-12
"""Of a value, or of 1: so much the same value may differ about two references."""


def count_ends(rows: Array, lowest: Array, highest: Array, counts: Counts) -> None:
    """
    Move the extremes on; samples are counted only where a block reaches one of them.

    Parameters
    ----------
    rows : ndarray, shape (axes, n)
        The next samples, one at least.
    lowest, highest : ndarray, shape (axes,)
        The extremes so far, which are changed.
    counts : ndarray of int64, shape (2, axes)
        How many samples stand at the lowest and at the highest; changed, too.

    Examples
    --------
    >>> low, high, counts = np.array([np.inf]), np.array([-np.inf]), np.zeros((2, 1), np.int64)
    >>> count_ends(np.array([[1.0, 3.0, 3.0]]), low, high, counts)
    >>> count_ends(np.array([[3.0, 0.0]]), low, high, counts)
    >>> counts[:, 0].tolist()
    [1, 3]

    """
    low, high = rows.min(axis=1), rows.max(axis=1)
    for count, kept, found, reached, beyond in (
            (counts[0], lowest, low, low <= lowest, low < lowest),
            (counts[1], highest, high, high >= highest, high > highest)):
        for axis in np.flatnonzero(reached):
            here = np.count_nonzero(rows[axis] == found[axis])
            count[axis] = here + (0 if beyond[axis] else count[axis])
        kept[reached] = found[reached]


def merge_ends(mine: tuple[Array, Array, Counts], other: tuple[Array, Array, Counts]) -> None:
    """
    Take over the extremes of another record, about the same reference, into `mine`.

    Parameters
    ----------
    mine, other : tuple of ndarray
        Lowest, highest and counts, as of `count_ends`.

    """
    for end, sign in ((0, -1.0), (1, 1.0)):
        ahead = sign * (other[end] - mine[end])
        same = np.abs(ahead) <= _ROUNDING * np.maximum(1, np.abs(other[end]))
        mine[2][end] = np.where(same, mine[2][end] + other[2][end],
                                np.where(ahead > 0, other[2][end], mine[2][end]))
        mine[end][:] = np.where(ahead > 0, other[end], mine[end])
