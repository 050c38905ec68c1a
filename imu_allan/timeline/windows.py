# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Windows of half a second of even rows: their statistics, and how far their means move.

A test by physics needs no learning: no sensor at rest changes its mean by 3 deg/s or 0.5 m/s^2
within two seconds, except through its white noise.
"""

from dataclasses import dataclass, field, replace
from math import sqrt

from imu_allan.arrays import Array, Bools
from imu_allan.block import EvenBlock
from imu_allan.state import Record
import numpy as np

_PLAUSIBLE_CHANGE = np.array([0.05] * 3 + [0.5] * 3)
"""In rad/s and m/s^2 within two seconds: a smaller change is judged by the noise alone."""


@dataclass
class Segment(Record):
    """
    Even rows without a gap, not yet decided on.

    Windows are numbered from the start of the segment. `blocks` begin with window `given`. The
    arrays of windows begin with window `base`, a few earlier, as context.
    """

    first_index: int
    start_s: float
    new_run: bool
    blocks: list[EvenBlock] = field(default_factory=list)
    closed: bool = False
    given: int = 0
    base: int = 0
    means: Array = field(default_factory=lambda: np.empty((0, 6)))
    loudness: Array = field(default_factory=lambda: np.empty((0, 12)))
    moving: Bools = field(default_factory=lambda: np.empty(0, dtype=bool))

    @property
    def held(self) -> int:
        """Count the rows held."""
        return sum(map(len, self.blocks))

    def joined(self) -> EvenBlock:
        """Return all rows held, as one block."""
        if len(self.blocks) > 1:
            first = self.blocks[0]
            self.blocks = [replace(
                first, samples=np.concatenate([block.samples for block in self.blocks]),
                interpolated=np.concatenate([
                    block.first_index - first.first_index + block.interpolated
                    for block in self.blocks]))]
        return self.blocks[0]

    def statistics(self, first: int, last: int) -> Array:
        """Return loudness and wander of windows by their array indices, shape (windows, 18)."""
        # Wander is the second difference of means, NaN for the first and the last window.
        table = np.full((len(self.means), 18), np.nan)
        table[:, :12] = self.loudness
        table[1:-1, 12:] = self.means[2:] - 2 * self.means[1:-1] + self.means[:-2]
        return table[first:last]


class Windows:
    """The division of rows into windows."""

    def __init__(self, interval_s: float) -> None:
        self.interval_s = interval_s
        # Loudness within parts of 20 ms is of fast noise, between them of slow.
        self.part = max(round(0.02 / self.interval_s), 1)
        # A window shorter than half a second gives its noise less accurately; a longer one cuts
        # out more for a knock.
        self.size = 25 * self.part
        # Means are compared at these distances, in windows: 1 for a jerk, 4 for a slow turn of two
        # seconds. Windows of a slow sensor are longer: a change over more than 6 s is drift.
        # Chosen by judgment.
        self.lags = tuple(lag for lag in (1, 4) if lag * self.size * self.interval_s < 6.0)
        self.farthest = max(self.lags, default=0)

    def time(self, segment: Segment, window: int) -> float:
        """Return the start of a window of a segment, in seconds."""
        return max(segment.start_s + window * self.size * self.interval_s, 0.0)

    def measure(self, segment: Segment) -> None:
        """Compute mean and loudness of the windows completed since the last call."""
        rows, size = segment.joined().samples, self.size
        done = (segment.base + len(segment.means) - segment.given) * size
        complete = done + (len(rows) - done) // size * size
        last = [rows[None, -size:]] if segment.closed and complete < len(rows) else []
        for windows in (rows[done:complete].reshape(-1, size, 6), *last):
            if len(windows):
                means, loudness = describe(windows, self.part)
                segment.means = np.concatenate([segment.means, means])
                segment.loudness = np.concatenate([segment.loudness, loudness])

    def implausible(self, segment: Segment, first: int) -> Bools:
        """Find windows, from array index `first` on, whose mean moved implausibly far."""
        means = segment.means
        beyond = np.zeros(len(means), dtype=bool)
        for lag in self.lags:
            change = np.abs(means[lag:] - means[:-lag])
            if (change > _PLAUSIBLE_CHANGE).any():
                sigma = segment.loudness ** 1.5
                sigma = np.maximum(sigma[:, :6], sqrt(self.part) * sigma[:, 6:])
                white = np.minimum(sigma[lag:], sigma[:-lag]) * sqrt(2 / self.size)
                # A noisy mean changes by chance, but not by ten of its standard deviations.
                beyond[lag:] |= np.any(
                    change > np.maximum(_PLAUSIBLE_CHANGE, 10.0 * white), axis=1)
        return beyond[first:]


def describe(rows: Array, part: int) -> tuple[Array, Array]:
    """Return means (windows, 6) and loudness (windows, 12) of rows (windows, size, 6)."""
    # Loudness is the cube root of a variance: of that within parts, and of that of their means, as
    # the differences of successive parts give it. The cube root makes a chi-square variable nearly
    # normal, whatever its degrees of freedom. Axes without values count as zero.
    windows, size, _ = rows.shape
    axes, parts = rows.transpose(2, 0, 1), size // part
    if part == 1 or parts < 2:
        steps, means = axes[:, :, 1:] - axes[:, :, :-1], axes.mean(axis=2)
        within = slow = _square_sums(steps) * (0.5 / max(size - 1, 1))
    else:
        split = axes[:, :, :parts * part].reshape(6, windows, parts, part)
        coarse = np.matmul(split.reshape(6, -1, part), np.ones(part)).reshape(split.shape[:3])
        coarse /= part
        own = (split - coarse[..., None]).reshape(6, windows, parts * part)
        within = _square_sums(own) / (parts * (part - 1))
        slow = _square_sums(coarse[:, :, 1:] - coarse[:, :, :-1]) * (0.5 / (parts - 1))
        means = coarse.mean(axis=2)
    means, power = means.T.copy(), np.concatenate([within, slow]).T.copy()
    # The mean of equal values is that value up to rounding, which is not noise. For some hundred
    # values the rounding error is less than this share of the mean, and any noise is more.
    power[power < (1e-13 * np.tile(means, 2)) ** 2] = 0.0
    if np.isnan(means[-1]).any():
        np.nan_to_num(means, copy=False)
        np.nan_to_num(power, copy=False)
    return means, np.cbrt(power)


def _square_sums(values: Array) -> Array:
    """Sum the squares of the values of every axis and window, shape (6, windows)."""
    # As in the pyramid of the record, this takes half as long as einsum.
    return np.asarray((values[:, :, None] @ values[..., None])[..., 0, 0])
