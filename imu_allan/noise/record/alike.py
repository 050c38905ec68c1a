# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Axes that give the same samples as another, or those of the other sign, in constant memory."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.int8]

SAME, OPPOSITE = 1, -1     # the sign between two axes
_KINDS = {SAME: 1, OPPOSITE: 2}
"""Bits of both in the flags of a pair."""


def undecided(axes: int) -> Flags:
    """Return the flags of all pairs before the first sample, shape (axes, axes)."""
    return np.triu(np.full((axes, axes), sum(_KINDS.values()), dtype=np.int8), 1)


def narrow_down(rows: Array, reference: Array, flags: Flags) -> None:
    """
    Clear the flags of pairs that the next samples tell apart.

    Parameters
    ----------
    rows : ndarray, shape (axes, n)
        About `reference`.
    reference : ndarray, shape (axes,)
        What was subtracted.
    flags : ndarray of int8, shape (axes, axes)
        From `undecided`, which are changed.

    Examples
    --------
    >>> flags = undecided(3)
    >>> narrow_down(np.array([[0.0, 1], [0, 1], [0, -1]]), np.array([5.0, 5, -5]), flags)
    >>> pairs(flags)
    [(0, 1, 1), (0, 2, -1), (1, 2, -1)]

    """
    # Of all sensors but broken ones no pair is left after a few samples.
    for one, other in np.argwhere(flags):
        for sign, bit in _KINDS.items():
            if flags[one, other] & bit and not (
                    reference[one] == sign * reference[other]
                    and np.array_equal(rows[one], sign * rows[other])):
                flags[one, other] &= ~bit


def pairs(flags: Flags) -> list[tuple[int, int, int]]:
    """Return the pairs that are left, by number, with the sign between them."""
    return [(int(one), int(other), sign) for one, other in np.argwhere(flags)
            for sign, bit in _KINDS.items() if flags[one, other] & bit]
