# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Faults that keep a single axis from measuring, throughout or for part of the record.

Rounding leaves values at every step next to zero. A deadband leaves none between zero and its
width, but many just beyond. Magnitudes are counted in logarithmic bins, so that counts of several
records can be added, and the step of the output need not be known.

A clipped output has too many samples at an end of its range. For Gaussian noise that is rounded to
steps, a share p in the last step with nothing beyond it is unlikely. If Q(z) = p, n Q(z + d)
samples are expected beyond, with the step d in units of the noise of a sample. A trend only adds
to that number, because Q(Q^-1(p) + d) is convex in p (Jensen's inequality).
"""

from collections.abc import Sequence

from imu_allan.arrays import Array, Bools
from imu_allan.noise.record.census import BINS_PER_OCTAVE, end_of_hole, FEWEST, lower_edge
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.record.periodogram import SpectrumSection
from imu_allan.noise.record.signal_over_time import stood_still
from imu_allan.result import Deadband, Saturation, Span
import numpy as np
from scipy.special import ndtr, ndtri

_SMALLEST = 1e-60
"""A smaller range, in SI units, is no noise, and its square nearly underflows. Integers that are
read as doubles are that small."""


def axis_fault(finished: Estimator, sections: Sequence[SpectrumSection], axis: int, dt: float
               ) -> float | Deadband | Span | Saturation | None:
    """
    Return the fault of an axis, or None if its coefficients can be estimated.

    `sections`: of its spectrum. `dt`: sample interval in seconds. Returns: the first that applies.
    The value of an axis that is constant; a deadband; the span of time in which the output kept
    one value; where it is clipped. An axis stood still, too, if it holds one value wherever a
    spectrum is possible, and others between gaps.
    """
    census = finished.census
    if finished.samples and census.highest[axis] - census.lowest[axis] < _SMALLEST:
        return float(finished.mean[axis])
    if (dead := deadband(finished, axis)) is not None:
        return dead
    if (not steps_hide_noise(finished)[axis]
            and (still := stood_still(finished.signal.columns(), axis)) is not None):
        return Span(still[0] * dt, still[1] * dt)
    if (clipped := clipping(finished, axis)) is not None or not sections:
        return clipped
    longest = max(sections, key=lambda section: section.length * section.step)
    # Rounding leaves 1e-32 of a constant.
    has_noise = any(section.power[axis, section.first:section.last].max(initial=0.0)
                    > 1e-26 * section.power[axis].max() for section in sections)
    return None if has_noise else Span(longest.start * dt, longest.length * longest.step * dt)


def deadband(finished: Estimator, axis: int) -> Deadband | None:
    """
    Find a deadband, in which an axis reports small values as zero.

    Returns: None without one. There is none if all values lie on one side of zero, or if fewer
    samples are zero than such a gap would hold. There is also none if the output steps so
    coarsely that the second value is twice the first.
    """
    census = finished.census
    zeros, sizes = int(census.zeros[axis]), census.sizes[axis]
    # A deadband of a fiftieth of sigma holds 1 % of the samples and hardly reduces the noise.
    if (finished.reference is None or zeros < max(1, 0.01 * finished.measured)
            or not census.lowest[axis] < -finished.reference[axis] < census.highest[axis]):
        return None
    first = end_of_hole(sizes)
    if first is None:
        return None
    # With a coarsely stepped output, the second value lies an octave above the first. Either may
    # lie at the border of a bin.
    octave = sizes[first:first + BINS_PER_OCTAVE]
    # Compare the zeros with the samples in the equally wide octave beyond the gap. The ratio is
    # about 1 for a deadband, 0.5 for a value between two neighbours, 0.25 for an output rounded
    # twice. A wide deadband is one step wide; a gap below 0.7 steps lacks only small sums of mixed
    # axes, which are rare. Chosen by judgment.
    if (int(octave[2:-1].sum()) <= FEWEST or zeros < 0.6 * octave.sum()
            or lower_edge(first) < 0.7 * census.step[axis]):
        return None
    # A mixture of axes with few values each leaves isolated values, far apart. Three empty bins in
    # a row may lie between values of 3, 4 and 5 output steps. Chosen by judgment.
    taken = np.flatnonzero(sizes[first:first + BINS_PER_OCTAVE + 1] > 0.05 * octave.mean())
    if np.diff(taken, append=BINS_PER_OCTAVE + 1).max() > 4:
        return None
    return Deadband(lower_edge(first), zeros / finished.measured)


def clipping(finished: Estimator, axis: int) -> Saturation | None:
    """
    Find the value at which the output of an axis is clipped.

    Returns: the end of the range with more samples, or None if neither end clips the output. Also
    None if the output is constant, or if its steps are coarser than its noise.
    """
    census, samples = finished.census, finished.measured
    end = int(np.argmax(census.at_ends[:, axis]))
    count = int(census.at_ends[end, axis])
    # White noise that is clipped on both sides at 2.58 sigma loses 1 % of its density.
    if (finished.reference is None or count < max(1, 0.005 * samples)
            or census.lowest[axis] == census.highest[axis]):
        return None
    pyramid, size = finished.pyramid, 2.0**np.arange(len(finished.pyramid.counts))
    # Use averaging times with at least 16 clusters. White noise: m avar(m) is its variance.
    known = (pyramid.counts > 0) & (16 * size <= finished.samples)
    noises = np.sqrt(pyramid.sums[known, axis] / (2 * pyramid.counts[known] * size[known]))
    # A vibration averages out over its periods, so the minimum is closest to the noise.
    noise = float(noises.min(initial=np.inf))
    step = float(census.step[axis])
    # With larger steps, it is normal for the last one to hold much of the record. A knock inflates
    # the noise up to four times, which admits steps of two sigma; these still permit the test.
    # A ratio above 4 between averaging times of up to 64 samples, too short for drift, is a
    # vibration: its values crowd at both ends. An output that is clipped at rest has 1.4.
    if not len(noises) or not step <= 0.5 * noise or noises[:7].max() > 4.0 * noise:
        return None
    # Allow for three standard errors of the count.
    share = max(count - 3.0 * np.sqrt(count), 0.0) / samples
    # Where 20 samples are expected beyond the end, none occurs by chance in one of e^20 records.
    if samples * ndtr(ndtri(share) - step / noise) < 20.0:
        return None
    kept = (census.lowest, census.highest)[end][axis]
    return Saturation(float(finished.reference[axis] + kept), count / samples)


def steps_hide_noise(finished: Estimator) -> Bools:
    """Return for every axis whether the steps of its output are too coarse for its noise."""
    # With steps above two sigma, the output often keeps one value, and its noise depends on where
    # the mean lies within a step.
    return np.asarray(finished.census.step > 2.0 * sample_noise(finished))


def sample_noise(finished: Estimator) -> Array:
    """Return the noise of one sample about its neighbours, shape (axes,); 0 if unknown."""
    pyramid = finished.pyramid
    # White noise: the mean squared second difference of phase over single samples is 2 sigma^2.
    return np.asarray(np.sqrt(pyramid.sums[0] / max(2 * pyramid.counts[0], 1)))
