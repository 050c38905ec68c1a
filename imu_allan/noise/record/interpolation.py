# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Effect of interpolated samples on the spectrum of white noise.

An interpolated sample is the mean of its neighbours, so it shares their noise. The covariance of
any two places follows from the pattern of the gaps alone. Averaged over the record by distance, it
gives the expected power of each coefficient for any pattern: random, bursty or periodic losses.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from imu_allan.arrays import Array, Ints
from imu_allan.block import NEIGHBOURS
from imu_allan.state import Record
import numpy as np
from scipy.fft import dct, dst

LAGS = 256
"""Number of lags: even with two of three samples lost, there is no covariance beyond about 100."""


@dataclass(frozen=True, eq=False)
class Interpolation:
    """Statistics of the interpolated samples of a record, for the fit of its spectrum."""

    share: float = 0.0    # share of the samples that are interpolated
    # (lags,): covariance of white noise of unit variance by distance in samples; None
    # without interpolation
    covariance: Array | None = None

    def white_power(self, length: int, step: int) -> Array | None:
        """
        Return the power of white noise in the DCT-II of means, relative to a complete record.

        `length`: points of a block. `step`: samples in a point. Returns shape (length,): by index;
        None if it is 1. The covariances of the points are those of the samples, weighted by a
        triangle. Then ``E c_k^2 = r_0 + 2 sum r_l ((1 - l/n) cos(pi k l/n) - sin(pi k l/n) / (n
        sin(pi k/n)))``.
        """
        if self.covariance is None:
            return None
        farthest = len(self.covariance) - 1
        both_ways = np.concatenate([self.covariance[:0:-1], self.covariance])
        apart = step * np.arange(min(farthest // step + 2, length))
        triangle = 1 - np.abs(apart[:, None] - np.arange(-farthest, farthest + 1)) / step
        x = np.zeros(length + 1)
        x[:len(apart)] = np.maximum(triangle, 0) @ both_ways
        even = dct(x * (1 - np.arange(length + 1) / length), type=1)[:length]
        odd = dst(x[1:-1], type=1)
        even[1:] -= odd / (length * np.sin(np.pi * np.arange(1, length) / length))
        # Truncation at the last lag may leave values near zero, by which the fit would divide.
        return np.maximum(even, 1e-3)


NO_INTERPOLATION = Interpolation()


@dataclass(eq=False)
class InterpolationSums(Record):
    """Sums over the pairs of places of a record."""

    # (LAGS,): sum of the covariance of white noise in two places by distance, in excess of
    # that of a complete record
    shared: Array = field(default_factory=lambda: np.zeros(LAGS))
    pairs: Array = field(default_factory=lambda: np.zeros(LAGS))    # (LAGS,): number of pairs

    def add(self, interpolated: Sequence[int], samples: int) -> None:
        """Add `samples` consecutive places; `interpolated` are some of them, in rising order."""
        self.pairs += np.maximum(samples - np.arange(LAGS), 0)
        if len(interpolated):
            self.shared += shared_noise(np.asarray(interpolated), samples)

    def interpolation(self, share: float) -> Interpolation:
        """Return the mean over all pairs, for a record with this share of interpolated samples."""
        if not share:
            return NO_INTERPOLATION
        if not self.shared.any():
            return Interpolation(share)
        covariance = self.shared / np.maximum(self.pairs, 1)
        covariance[0] += 1
        return Interpolation(share, covariance)


def shared_noise(interpolated: Ints, samples: int) -> Array:
    """
    Sum the covariances that interpolation adds to white noise.

    `interpolated`, shape (b,): places of interpolated samples, rising. `samples`: number of
    consecutive places. Returns shape (LAGS,): sum over the pairs at each distance of the
    covariance of white noise of unit variance, minus that of a complete record. Zero if no sample
    was received.
    """
    own = np.ones(samples, dtype=bool)
    own[interpolated] = False
    received = np.flatnonzero(own)
    total = np.zeros(LAGS)
    if not len(received):
        return total

    def enter(distance: Ints, noise: Array) -> None:
        total[:] += np.bincount(np.minimum(distance, LAGS), noise, LAGS + 1)[:LAGS]

    behind = np.searchsorted(received, interpolated)
    first = np.maximum(behind - NEIGHBOURS, 0)
    last = np.minimum(behind + NEIGHBOURS, len(received))
    share = 1.0 / (last - first)
    for beside in range(-NEIGHBOURS, NEIGHBOURS):
        row = behind + beside
        there = (first <= row) & (row < last)
        enter(np.abs(interpolated - received[np.where(there, row, 0)]), share * there)
    enter(np.zeros_like(interpolated), share - 1)
    for later in range(1, min(len(interpolated), LAGS)):
        overlap = last[:-later] - first[later:]
        if overlap.max() <= 0:
            break
        enter(interpolated[later:] - interpolated[:-later],
              np.maximum(overlap, 0) * share[later:] * share[:-later])
    return total
