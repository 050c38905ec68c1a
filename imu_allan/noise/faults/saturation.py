# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether the output of an axis is cut off: too many samples stand at the end of its range.

Of Gaussian noise with samples rounded to steps, a share p in the last cell but nothing beyond it
is unlikely: where Q(z) = p, n Q(z + d) samples lie a step d (in noise of a sample) further out. A
mean that moves only adds to that, as Q(Q^-1(p) + d) is convex in p (Jensen's inequality).
"""

from typing import NamedTuple

from imu_allan.noise.record.estimator import Estimator
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

Array = NDArray[np.float64]

_LEAST_SHARE = 0.005
"""At either end: clipped at 2.58 sigma, white noise loses 1 % of its density."""
_COARSEST_STEP = 0.5
"""
In noise of a sample: beyond it the last cell holds a good part of the record by nature. A knock
makes noise seem up to four times as large: steps of two sigma are still told from it.
"""
_MISSED = 20.0
"""Samples to expect beyond the end; that there are none happens once in e^20 records by chance."""
_SURE = 3.0
"""Standard errors that a count of samples is off by at most."""
_SHAKEN = 4.0
"""
Ratio of the noise by some averaging time to that by another from which on it is a vibration, whose
values crowd at both ends by nature. Of what is cut off at rest it is 1.4 at most.
"""
_SHAKEN_OCTAVES = 7
"""Averaging times looked at for that: up to 64 samples, where drift does not show yet."""
_FEWEST_CLUSTERS = 16
"""Averaging times of so many clusters are asked for the noise."""


class CutOff(NamedTuple):
    """Where the output is cut off."""

    value: float    # in the unit of a sample
    share: float    # of the samples that stand there
    is_highest: bool    # whether it is the upper end of the range


def cut_off(finished: Estimator, axis: int) -> CutOff | None:
    """
    Tell where the output of an axis is cut off.

    Returns: the end at which more samples stand; None where neither end cuts anything off, or
    where the output is constant or steps more coarsely than its noise.

    Examples
    --------
    >>> estimator = Estimator()
    >>> estimator.update(np.minimum(np.random.default_rng(1).normal(size=2000), 1.0))
    >>> cut_off(estimator.finished(), 0)
    CutOff(value=1.0, share=0.1465, is_highest=True)

    """
    census, samples = finished.census, finished.measured
    end = int(np.argmax(census.at_ends[:, axis]))
    count = int(census.at_ends[end, axis])
    if finished.reference is None or not is_cut_off(finished, axis, count, samples):
        return None
    kept = (census.lowest, census.highest)[end][axis]
    return CutOff(float(finished.reference[axis] + kept), count / samples, bool(end))


def is_cut_off(finished: Estimator, axis: int, count: int, samples: int) -> bool:
    """
    Tell whether `count` of `samples`, of a record or a part of it, stand at an end by a limit.

    Noise and steps are those of the whole record.

    Examples
    --------
    >>> estimator = Estimator()
    >>> estimator.update(np.random.default_rng(1).normal(size=2000).round(1))
    >>> [is_cut_off(estimator.finished(), 0, count, 500) for count in (1, 100)]
    [False, True]

    """
    census = finished.census
    if (count < max(1, _LEAST_SHARE * samples)
            or census.lowest[axis] == census.highest[axis]):
        return False
    noises = _noise_over_times(finished, axis)
    # A vibration is less of it in means over its periods, and none in the long run.
    noise = float(noises.min(initial=np.inf))
    step = float(census.step[axis])
    if (not len(noises) or not step <= _COARSEST_STEP * noise
            or noises[:_SHAKEN_OCTAVES].max() > _SHAKEN * noise):
        return False
    share = max(count - _SURE * np.sqrt(count), 0.0) / samples
    return bool(samples * ndtr(ndtri(share) - step / noise) >= _MISSED)


def _noise_over_times(finished: Estimator, axis: int) -> Array:
    """Return the noise of a sample by means over more and more: the same of white noise."""
    pyramid = finished.pyramid
    size = 2.0**np.arange(len(pyramid.counts))
    known = (pyramid.counts > 0) & (_FEWEST_CLUSTERS * size <= finished.samples)
    # White noise: m avar(m) is its variance at every m.
    return np.asarray(np.sqrt(pyramid.sums[known, axis]
                              / (2 * pyramid.counts[known] * size[known])))
