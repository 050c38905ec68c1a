# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Statistics of sample values in constant memory, to detect axes that do not measure.

They count the samples at the lowest and at the highest value, and keep the smallest step of the
output.
"""

from dataclasses import dataclass, field

from imu_allan.arrays import Array, Ints
from imu_allan.noise.record.multi_axis import AXES_FIRST, AXES_SECOND, MultiAxis
import numpy as np

_ROUNDING = 1e-12
"""Tolerance for equal values, also about different references: relative, or absolute below 1."""


@dataclass(eq=False)
class Census(MultiAxis):
    """Statistics of the sample values of several axes, relative to a reference for each."""

    samples: int = 0    # number of samples counted
    # (axes,)
    lowest: Array = field(init=False, metadata=AXES_FIRST)
    highest: Array = field(init=False, metadata=AXES_FIRST)
    # (2, axes): number of samples at the lowest and at the highest value
    at_ends: Ints = field(init=False, metadata=AXES_SECOND)
    # (axes,): smallest change between consecutive samples, except for a few outliers; infinite
    # if nothing changes
    step: Array = field(init=False, metadata=AXES_FIRST)

    def begin(self) -> None:
        """Initialize empty counts."""
        axes = self.axes
        self.lowest, self.highest = np.full(axes, np.inf), np.full(axes, -np.inf)
        self.at_ends = np.zeros((2, axes), np.int64)
        self.step = np.full(axes, np.inf)

    def count(self, rows: Array) -> None:
        """Count the next samples: `rows`, shape (axes, n), at least one, minus the reference."""
        self._count_ends(rows)
        # That many samples show the step of a coarse output; more would take a tenth of the time.
        if self.samples < 65_536:
            np.minimum(self.step, _step_of(rows), out=self.step)
        self.samples += rows.shape[1]

    def _count_ends(self, rows: Array) -> None:
        """Update the extremes; count samples only in blocks that reach one of them."""
        low, high = rows.min(axis=1), rows.max(axis=1)
        for count, kept, found, reached, beyond in (
                (self.at_ends[0], self.lowest, low, low <= self.lowest, low < self.lowest),
                (self.at_ends[1], self.highest, high, high >= self.highest, high > self.highest)):
            for axis in np.flatnonzero(reached):
                here = np.count_nonzero(rows[axis] == found[axis])
                count[axis] = here + (0 if beyond[axis] else count[axis])
            kept[reached] = found[reached]

    def merge(self, other: 'Census', shift: Array) -> None:
        """Add the samples of another record, shifted by `shift` to the reference of this one."""
        for end, mine, theirs, sign in ((0, self.lowest, other.lowest + shift, -1.0),
                                        (1, self.highest, other.highest + shift, 1.0)):
            ahead = sign * (theirs - mine)
            same = np.abs(ahead) <= _ROUNDING * np.maximum(1, np.abs(theirs))
            self.at_ends[end] = np.where(same, self.at_ends[end] + other.at_ends[end], np.where(
                ahead > 0, other.at_ends[end], self.at_ends[end]))
            mine[:] = np.where(ahead > 0, theirs, mine)
        self.step = np.minimum(self.step, other.step)
        self.samples += other.samples


def _step_of(rows: Array) -> Array:
    """Return the smallest change between consecutive samples, shape (axes,)."""
    steps = np.full(len(rows), np.inf)
    changes = np.abs(np.diff(rows, axis=1))
    there = changes >= _ROUNDING * np.maximum(1, np.abs(rows[:, 1:]))
    for axis, count in enumerate(there.sum(axis=1).tolist()):
        if count:
            # Ignore a few readings between steps, by a 5 % quantile. For smooth noise it is a
            # tenth of the noise, far too small to matter.
            place = int(0.05 * count)
            steps[axis] = np.partition(changes[axis, there[axis]], place)[place]
    return steps
