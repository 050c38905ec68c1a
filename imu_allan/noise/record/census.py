# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Statistics of sample values in constant memory, to detect axes that do not measure.

They count the samples at the lowest and at the highest value, and those that are zero. If there
are many zeros, the magnitudes of the others are counted in logarithmic bins. The smallest step of
the output is kept as well.
"""

from dataclasses import dataclass, field

from imu_allan.arrays import Array, Ints
from imu_allan.noise.record.multi_axis import AXES, MultiAxis, numbers
import numpy as np

_ROUNDING = 1e-12
"""Tolerance for equal values, also about different references: relative, or absolute below 1."""
BINS_PER_OCTAVE = 8
"""Bins are 9 % wide, so that 2, 3 and 4 steps of the output fall into different bins."""
_LOWEST_OCTAVE = -40
"""The smallest magnitude counted is 1e-12, in any unit of a sample."""
FEWEST = 20
"""A gap around zero ends where more samples than this have been counted: chance or stray readings
do not account for so many."""


@dataclass(eq=False)
class Census(MultiAxis):
    """Statistics of the sample values of several axes, relative to a reference for each."""

    samples: int = 0    # number of samples counted
    # (axes,)
    lowest: Array = field(init=False, metadata=numbers(AXES, merge=np.minimum))
    highest: Array = field(init=False, metadata=numbers(AXES, merge=np.maximum))
    # (2, axes): number of samples at the lowest and at the highest value
    at_ends: Ints = field(init=False, metadata=numbers(2, AXES, dtype=np.int64))
    # (axes,): smallest change between consecutive samples, except for a few outliers; infinite
    # if nothing changes
    step: Array = field(init=False, metadata=numbers(AXES, merge=np.minimum))
    # (axes,): number of samples that are zero
    zeros: Ints = field(init=False, metadata=numbers(AXES, dtype=np.int64))
    # (axes, bins): number of samples by magnitude, see `lower_edge`, up to an octave beyond
    # the end of the gap around zero and to a magnitude of 1e7
    sizes: Ints = field(init=False, metadata=numbers(AXES, 64 * BINS_PER_OCTAVE, dtype=np.int64))

    def count(self, rows: Array, reference: Array) -> None:
        """
        Count the next samples.

        `rows`, shape (axes, n): samples minus `reference`, at least one. `reference`, shape
        (axes,): the values that were subtracted.
        """
        self._count_ends(rows)
        self._count_near_zero(rows, -reference)
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

    def _count_near_zero(self, rows: Array, zero: Array) -> None:
        """
        Count the samples that are zero, and if there are many, the magnitudes of the others.

        The gap around zero can only become narrower, so values far beyond it are not counted.
        Nothing is counted once the gap turns out to be a step of the output, as in most cases.
        """
        for row, nothing, sizes, axis in zip(rows, zero, self.sizes, range(self.axes),
                                             strict=True):
            here = np.count_nonzero(row == nothing)
            self.zeros[axis] += here
            # Count magnitudes only if there are many zeros, because it is slow.
            if here < 0.01 * len(row):
                continue
            ends = end_of_hole(sizes)
            # Many samples at one magnitude and none in the octave beyond: the output has steps,
            # and no gap.
            if ends is not None and sizes[ends:ends + 2].sum() > 10_000 and not sizes[
                    ends + 2:ends + BINS_PER_OCTAVE - 1].any():
                continue
            # Count an octave from the end of the gap on, and a margin for rounding.
            farthest = np.inf if ends is None else lower_edge(ends + BINS_PER_OCTAVE + 2)
            magnitude = np.abs(row - nothing)
            some = magnitude[(magnitude > 0) & (magnitude < farthest)]
            places = np.floor(BINS_PER_OCTAVE * (np.log2(some) - _LOWEST_OCTAVE))
            sizes += np.bincount(np.clip(places, 0, len(sizes) - 1).astype(np.intp),
                                 minlength=len(sizes))


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


def end_of_hole(sizes: Ints) -> int | None:
    """Return the first bin up to which more than `FEWEST` samples were counted, or None."""
    beyond = np.cumsum(sizes) > FEWEST
    return int(np.argmax(beyond)) if beyond[-1] else None


def lower_edge(place: int) -> float:
    """Return the smallest magnitude in a bin."""
    return float(2.0**(_LOWEST_OCTAVE + place / BINS_PER_OCTAVE))
