# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Slow turns and tilts, too slow for the motion detector: the mean moves away and comes back."""

from dataclasses import dataclass, field
from itertools import pairwise

from imu_allan.arrays import Array
from imu_allan.state import Record
import numpy as np

_LEAST = np.array([0.004] * 3 + [0.04] * 3)
"""In rad/s and m/s^2: no bias moves this far and back within two minutes. Chosen by judgment."""


@dataclass
class SlowTurns(Record):
    """Times during which the mean of an axis had moved away."""

    # Sum of the means of the windows in the newest block, and number of these windows.
    sums: Array = field(default_factory=lambda: np.zeros(6))
    windows: int = 0
    # Start in seconds and mean of each axis, for the latest blocks, shape (blocks, 7).
    blocks: Array = field(default_factory=lambda: np.empty((0, 7)))
    # Start and duration in seconds, number of the axis, and size in its unit.
    found: list[list[float]] = field(default_factory=list)

    def take(self, means: Array, start_s: float, window_s: float) -> None:
        """Add the means of windows at rest, shape (n, 6), of which the first is at `start_s`."""
        new = []
        in_block = 8   # windows of half a second: a slow turn lasts longer
        ends = range(in_block - self.windows, len(means), in_block)
        for first, last in pairwise([0, *ends, len(means)]):
            self.sums = self.sums + means[first:last].sum(axis=0)
            self.windows += last - first
            if self.windows == in_block:
                new.append([start_s + (last - in_block) * window_s, *self.sums / in_block])
                self.sums, self.windows = np.zeros(6), 0
        # Where all are near each other, none of the new ones is back from an excursion.
        suspect = bool(new) and bool((np.ptp(np.vstack([self.blocks, new])[:, 1:], axis=0)
                                      > _LEAST).any())
        for block in new:
            # A mean that takes more than 32 blocks, two minutes, to come back is drift.
            self.blocks = np.vstack([self.blocks[-31:], block])
            if suspect:
                self._look(in_block * window_s)

    def _look(self, block_s: float) -> None:
        """Record an excursion if the newest block is back from one."""
        starts, level = self.blocks[:, 0], self.blocks[:, 1:]
        # Less than half a minute does not show the usual change.
        if len(level) < 8:
            return
        usual = np.median(np.abs(np.diff(level, axis=0)), axis=0)
        size = level - level[-1]
        # A random walk does not jump by 14 times its usual change.
        far = np.abs(size) > np.maximum(_LEAST, 14.0 * usual)
        for axis in np.flatnonzero(far.any(axis=0)).tolist():
            away = np.flatnonzero(far[:, axis])
            peak = float(size[away[np.argmax(np.abs(size[away, axis]))], axis])
            # The mean returns to within 0.3 of the excursion from the level before.
            before = np.flatnonzero(np.abs(size[:away[0], axis]) < 0.3 * abs(peak))
            first, last = int(away[0]), int(away[-1])
            edges = (size[min(first + 1, last), axis] - size[max(first - 2, 0), axis],
                     size[max(last - 1, first), axis] - size[min(last + 2, len(size) - 1), axis])
            # The excursion begins and ends within three blocks.
            if (not len(before) or far[-2, axis]
                    or min(abs(edge) for edge in edges) < 0.7 * abs(peak)):
                continue
            # With more than ten, the recording is one of motion.
            if len(self.found) < 10:
                begins = float(starts[first])
                self.found.append([begins, float(starts[last]) + block_s - begins, axis, peak])
            self.blocks = self.blocks[-1:]
            return
