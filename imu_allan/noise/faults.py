# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Why an axis by itself does not measure, for a while or throughout; decided here alone.

A sensor that rounds has a value at every step beside zero; a deadband has none between zero and
its width, but many just beyond. Magnitudes are counted in bins of constant ratio, so that records
add up and the step of the output need not be known.

Of an output that is cut off too many samples stand at the end of its range. Of Gaussian noise with
samples rounded to steps, a share p in the last cell but nothing beyond it is unlikely: where
Q(z) = p, n Q(z + d) samples lie a step d (in noise of a sample) further out. A mean that moves
only adds to that, as Q(Q^-1(p) + d) is convex in p (Jensen's inequality).
"""

from typing import NamedTuple

from imu_allan.noise.record.census import BINS_PER_OCTAVE, end_of_hole, FEWEST, lower_edge
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.record.signal_over_time import stood_still
from imu_allan.result import Deadband
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

Array = NDArray[np.float64]

_WIDEST_EMPTY, _EMPTY = 3, 0.05
"""Bins in a row, and of their mean count: of 3, 4, 5 steps 3 bins are empty. A judgment."""


class Constant(NamedTuple):
    """Every sample is this value, in the unit of a sample."""

    value: float


class StoodStill(NamedTuple):
    """One and the same value for so many samples, from the first of them on."""

    first: int
    samples: int


class CutOff(NamedTuple):
    """Where the output is cut off."""

    value: float    # in the unit of a sample
    share: float    # of the samples that stand there
    is_highest: bool    # whether it is the upper end of the range


AxisFault = Constant | Deadband | StoodStill | CutOff


def axis_fault(finished: Estimator, axis: int) -> AxisFault | None:
    """
    Return why an axis does not measure; without a fault it has coefficients.

    Returns the first that holds of `Constant`, `Deadband`, `StoodStill` and `CutOff`.
    """
    if finished.samples and finished.census.lowest[axis] == finished.census.highest[axis]:
        return Constant(float(finished.mean[axis]))
    if (dead := deadband(finished, axis)) is not None:
        return dead
    # Coarse steps give one value for long by nature.
    if (not steps_hide_noise(finished)[axis]
            and (still := stood_still(finished.signal.columns(), axis)) is not None):
        return StoodStill(*still)
    return cut_off(finished, axis)


def deadband(finished: Estimator, axis: int) -> Deadband | None:
    """
    Return whether an axis gives small values as zero.

    None where there is none, where values lie on one side of zero alone, where the output steps so
    coarsely that the next value is twice the first, or where fewer samples are zero than a hole of
    that width would hold.
    """
    census = finished.census
    zeros, sizes = int(census.zeros[axis]), census.sizes[axis]
    # A deadband of a fiftieth of sigma holds 1 %, and takes next to nothing off the noise.
    if (finished.reference is None or zeros < max(1, 0.01 * finished.measured)
            or not census.lowest[axis] < -finished.reference[axis] < census.highest[axis]):
        return None
    first = end_of_hole(sizes)
    if first is None:
        return None
    # Of an output that steps, the second value lies an octave above the first; either may lie
    # next to the border of a bin.
    octave = sizes[first:first + BINS_PER_OCTAVE]
    # Zeros for each sample in the octave beyond the hole, which is as wide: a deadband has about
    # 1, one value among its two neighbours 0.5, an output that is rounded twice 0.25. A step is
    # the width of a wide deadband; below 0.7 of it lie sums that rarely come out. Judgments.
    if (int(octave[2:-1].sum()) <= FEWEST or zeros < 0.6 * octave.sum()
            or lower_edge(first) < 0.7 * census.step[axis]):
        return None
    # Mixed axes of few values each leave lines, far apart.
    taken = np.flatnonzero(sizes[first:first + BINS_PER_OCTAVE + 1] > _EMPTY * octave.mean())
    if np.diff(taken, append=BINS_PER_OCTAVE + 1).max() > _WIDEST_EMPTY + 1:
        return None
    return Deadband(lower_edge(first), zeros / finished.measured)


def cut_off(finished: Estimator, axis: int) -> CutOff | None:
    """
    Find where the output of an axis is cut off.

    Returns: the end at which more samples stand; None where neither end cuts anything off, or
    where the output is constant or steps more coarsely than its noise.
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
    Return whether `count` of `samples`, of a record or a part of it, stand at an end by a limit.

    Noise and steps are those of the whole record.
    """
    census = finished.census
    # At either end: clipped at 2.58 sigma, white noise loses 1 % of its density.
    if (count < max(1, 0.005 * samples)
            or census.lowest[axis] == census.highest[axis]):
        return False
    noises = _noise_over_times(finished, axis)
    # A vibration is less of it in means over its periods, and none in the long run.
    noise = float(noises.min(initial=np.inf))
    step = float(census.step[axis])
    # With larger steps the last one holds a good part of the record by nature. A knock makes noise
    # seem up to four times as large: steps of two sigma are still distinguished from it. Noise
    # that differs so much between averaging times (up to 64 samples, where drift does not show
    # yet) is a vibration, whose values crowd at both ends; of what is cut off at rest the ratio
    # is 1.4.
    if (not len(noises) or not step <= 0.5 * noise
            or noises[:7].max() > 4.0 * noise):
        return False
    # At most three standard errors of a count are chance.
    share = max(count - 3.0 * np.sqrt(count), 0.0) / samples
    # So many samples are expected beyond the end: that there are none happens once in e^20
    # records.
    return bool(samples * ndtr(ndtri(share) - step / noise) >= 20.0)


def _noise_over_times(finished: Estimator, axis: int) -> Array:
    """Return the noise of a sample by means over more and more: the same of white noise."""
    pyramid = finished.pyramid
    size = 2.0**np.arange(len(pyramid.counts))
    # Averaging times of so many clusters are asked.
    known = (pyramid.counts > 0) & (16 * size <= finished.samples)
    # White noise: m avar(m) is its variance at every m.
    return np.asarray(np.sqrt(pyramid.sums[known, axis]
                              / (2 * pyramid.counts[known] * size[known])))


def steps_hide_noise(finished: Estimator) -> NDArray[np.bool_]:
    """Return of every axis whether its output steps by more than its noise shows."""
    # With steps of more than two sigma a mean between two borders often gives one value, and the
    # noise changes with the place of the mean between them.
    return np.asarray(finished.census.step > 2.0 * sample_noise(finished))


def sample_noise(finished: Estimator) -> Array:
    """Return the noise of one sample about its neighbours, shape (axes,); 0 when unknown."""
    pyramid = finished.pyramid
    # White noise: the mean squared second difference of phase over single samples is 2 sigma^2.
    return np.asarray(np.sqrt(pyramid.sums[0] / max(2 * pyramid.counts[0], 1)))
