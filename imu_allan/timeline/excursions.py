# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Slow turns and tilts, too slow for a detector of motion: the mean goes away and comes back."""

from dataclasses import dataclass, field

from imu_allan.state import Record
from imu_allan.timeline.clock import Floats
import numpy as np

BLOCK = 8
"""Windows of half a second whose means are averaged: a slow turn lasts longer."""
_LEAST = [0.004] * 3 + [0.04] * 3
"""rad/s and m/s^2: no sensor's bias goes so far and comes back within two minutes. A judgment."""


@dataclass
class Excursions(Record):
    """
    Times in which the mean of an axis was elsewhere.

    Attributes
    ----------
    sums : list of float
        Sum of the means of the windows of the newest block, by axis.
    windows : int
        How many these are.
    blocks : list of list of float
        Beginning in seconds and mean of each axis, of the latest blocks.
    found : list of list of float
        Beginning and duration in seconds, number of the axis, and size in its unit.

    """

    sums: list[float] = field(default_factory=lambda: [0.0] * 6)
    windows: int = 0
    blocks: list[list[float]] = field(default_factory=list)
    found: list[list[float]] = field(default_factory=list)

    def check(self) -> None:
        """Refuse tables of another width."""
        if {len(block) for block in self.blocks} - {7} or {len(one) for one in self.found} - {4}:
            raise ValueError('excursions are not those of six axes')

    def take(self, means: Floats, start_s: float, window_s: float) -> None:
        """
        Go on with windows at rest.

        Parameters
        ----------
        means : ndarray, shape (n, 6)
            Mean of each window.
        start_s, window_s : float
            When the first begins, and how long each lasts.

        """
        first = 0
        while first < len(means):
            last = min(first + BLOCK - self.windows, len(means))
            self.sums = list(map(float.__add__, self.sums, means[first:last].sum(axis=0).tolist()))
            self.windows += last - first
            first = last
            if self.windows == BLOCK:
                begins = start_s + (last - BLOCK) * window_s
                self.blocks.append([begins, *(total / BLOCK for total in self.sums)])
                self.sums, self.windows = [0.0] * 6, 0
                # What takes longer than 32 blocks, two minutes, to come back is drift.
                del self.blocks[:-32]
                self._look(BLOCK * window_s)

    def _look(self, block_s: float) -> None:
        """Return whether the newest block is back from an excursion."""
        table = np.array(self.blocks)
        level = table[:, 1:]
        # Of less than half a minute the usual change is not known.
        if len(level) < 8 or (np.ptp(level, axis=0) <= _LEAST).all():
            return
        usual = np.median(np.abs(np.diff(level, axis=0)), axis=0)
        size = level - level[-1]
        # A random walk never goes 14 times its usual change at once.
        far = np.abs(size) > np.maximum(_LEAST, 14.0 * usual)
        for axis in np.flatnonzero(far.any(axis=0)).tolist():
            away = np.flatnonzero(far[:, axis])
            peak = float(size[away[np.argmax(np.abs(size[away, axis]))], axis])
            # The level before is reached again within a third of the excursion.
            before = np.flatnonzero(np.abs(size[:away[0], axis]) < 0.3 * abs(peak))
            first, last = int(away[0]), int(away[-1])
            edges = (size[min(first + 1, last), axis] - size[max(first - 2, 0), axis],
                     size[max(last - 1, first), axis] - size[min(last + 2, len(size) - 1), axis])
            # It begins and ends within three blocks.
            if (not len(before) or far[-2, axis]
                    or min(abs(edge) for edge in edges) < 0.7 * abs(peak)):
                continue
            # With more the recording is one of motion.
            if len(self.found) < 10:
                begins = float(table[first, 0])
                self.found.append([begins, float(table[last, 0]) + block_s - begins, axis, peak])
            self.blocks = self.blocks[-1:]
            return
