# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether small values of an axis are given as zero: samples at zero, and a hole on both sides of it.

A sensor that rounds has a value at every step beside zero; a deadband has none between zero and
its width, but many just beyond. Magnitudes are counted in bins of constant ratio, so that records
add up and the step of the output need not be known.
"""

from imu_allan.noise.record.census import BINS_PER_OCTAVE, end_of_hole, FEWEST, lower_edge
from imu_allan.noise.record.estimator import Estimator
from imu_allan.result import Deadband
import numpy as np

_LEAST_SHARE = 0.01
"""A deadband of a fiftieth of sigma holds that many, and takes next to nothing off the noise."""
_LEAST_FILL = 0.6
"""
Zeros for each sample in the octave beyond the hole, which is as wide: a deadband has about 1,
one value among its two neighbours 0.5, an output that is rounded twice 0.25. A judgment.
"""
_LEAST_STEPS = 0.7
"""Of the step, which is the width of a wide deadband; below lie sums that rarely come out."""
_WIDEST_EMPTY, _EMPTY = 3, 0.05
"""Bins in a row, and of their mean count: of 3, 4, 5 steps 3 bins are empty. A judgment."""


def deadband(finished: Estimator, axis: int) -> Deadband | None:
    """
    Tell whether an axis gives small values as zero.

    None where there is none, where values lie on one side of zero alone, where the output steps so
    coarsely that the next value is twice the first, or where fewer samples are zero than a hole of
    that width would hold.

    Examples
    --------
    >>> noise = np.random.default_rng(1).normal(size=2000)
    >>> estimator = Estimator()
    >>> estimator.update(np.where(abs(noise) < 1.0, 0.0, noise))
    >>> found = deadband(estimator.finished(), 0)
    >>> round(found.width, 2), round(found.share, 2)
    (1.0, 0.68)

    """
    census = finished.census
    zeros, sizes = int(census.zeros[axis]), census.sizes[axis]
    if (finished.reference is None or zeros < max(1, _LEAST_SHARE * finished.measured)
            or not census.lowest[axis] < -finished.reference[axis] < census.highest[axis]):
        return None
    first = end_of_hole(sizes)
    if first is None:
        return None
    # Of an output that steps, the second value lies an octave above the first; either may lie
    # next to the border of a bin.
    octave = sizes[first:first + BINS_PER_OCTAVE]
    if (int(octave[2:-1].sum()) <= FEWEST or zeros < _LEAST_FILL * octave.sum()
            or lower_edge(first) < _LEAST_STEPS * census.step[axis]):
        return None
    # Mixed axes of few values each leave lines, far apart.
    taken = np.flatnonzero(sizes[first:first + BINS_PER_OCTAVE + 1] > _EMPTY * octave.mean())
    if np.diff(taken, append=BINS_PER_OCTAVE + 1).max() > _WIDEST_EMPTY + 1:
        return None
    return Deadband(lower_edge(first), zeros / finished.measured)
