# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""How many samples are zero, and how large the others are, in constant memory."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

BINS_PER_OCTAVE = 8
"""Steps of 9 %: they tell 2 from 3 units of a step, and both from 4."""
_LOWEST_OCTAVE, _OCTAVES = -40, 64
"""From 1e-12 to 1e7, in any unit that a sample has."""
BINS = BINS_PER_OCTAVE * _OCTAVES
FEWEST = 20
"""Samples beyond a hole about zero, and fewer in it: so many are no chance, nor strays."""
_MANY = 0.01
"""Share of zeros in a chunk from which on magnitudes are looked at, which takes its time."""
_REACH = BINS_PER_OCTAVE + 2
"""Bins from the end of the hole on that are looked at, an octave, and one more for rounding."""
_STEPS = 10_000
"""Samples next to zero, and none within the octave beyond: an output of steps, without a hole."""


def count_near_zero(rows: Array, reference: Array, zeros: Counts, sizes: Counts) -> None:
    """
    Count the samples that are zero, and where these are many the magnitudes of the others.

    The hole can only become narrower: what lies far beyond it is not counted any more, and
    nothing once the output is seen to step, as most do: the step is no hole.

    Parameters
    ----------
    rows : ndarray, shape (axes, n)
        The next samples about `reference`, one at least.
    reference : ndarray, shape (axes,)
        What was subtracted from them.
    zeros : ndarray of int64, shape (axes,)
        How many samples are zero, which is changed.
    sizes : ndarray of int64, shape (axes, BINS)
        How many are of each magnitude, see `lower_edge`, up to an octave beyond the end of the
        hole; changed, too.

    """
    for axis, (row, zero) in enumerate(zip(rows, -reference, strict=True)):
        here = np.count_nonzero(row == zero)
        zeros[axis] += here
        if here < _MANY * len(row):
            continue
        ends = end_of_hole(sizes[axis])
        if ends is not None and _is_stepping(sizes[axis, ends:]):
            continue
        farthest = np.inf if ends is None else lower_edge(ends + _REACH)
        magnitude = np.abs(row - zero)
        some = magnitude[(magnitude > 0) & (magnitude < farthest)]
        places = np.floor(BINS_PER_OCTAVE * (np.log2(some) - _LOWEST_OCTAVE))
        sizes[axis] += np.bincount(np.clip(places, 0, BINS - 1).astype(np.intp), minlength=BINS)


def _is_stepping(sizes: Counts) -> bool:
    """Tell from the counts of the first bin on that values lie a whole step apart."""
    first, between = sizes[:2].sum(), sizes[2:BINS_PER_OCTAVE - 1].sum()
    return bool(first > _STEPS and not between)


def end_of_hole(sizes: Counts) -> int | None:
    """
    Return the first bin up to which there are more than `FEWEST` samples, else None.

    Examples
    --------
    >>> end_of_hole(np.array([0, 3, 0, 18, 50]))
    3

    """
    beyond = np.cumsum(sizes) > FEWEST
    return int(np.argmax(beyond)) if beyond[-1] else None


def lower_edge(place: int) -> float:
    """
    Return the least magnitude in a bin.

    Examples
    --------
    >>> lower_edge(320)
    1.0

    """
    return float(2.0**(_LOWEST_OCTAVE + place / BINS_PER_OCTAVE))
