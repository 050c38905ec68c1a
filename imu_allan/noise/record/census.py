# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What values the samples of a record have, in constant memory: what shows whether an axis measures.

Counted are the samples at the lowest and at the highest value, those that are zero, and where
these are many the magnitudes of the others, in bins of constant ratio. Kept are the least step of
the output, and which axes give the same samples.
"""

from dataclasses import dataclass, field

from imu_allan.noise.record.side_by_side import AXES_FIRST, AXES_SECOND, AXES_TWICE, SideBySide
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

SAME, OPPOSITE = 1, -1     # the sign between two axes
_KINDS = {SAME: 1, OPPOSITE: 2}
"""Bits of both in the flags of a pair."""
_ROUNDING = 1e-12
"""Of a value, or of 1: the same value twice, or about two references, may differ by so much."""
BINS_PER_OCTAVE = 8
"""Steps of 9 %: they distinguish 2 from 3 units of a step, and both from 4."""
_LOWEST_OCTAVE, _OCTAVES = -40, 64
"""From 1e-12 to 1e7, in any unit that a sample has."""
_BINS = BINS_PER_OCTAVE * _OCTAVES
FEWEST = 20
"""Samples beyond a hole about zero, and fewer in it: so many are no chance, nor strays."""
_REACH = BINS_PER_OCTAVE + 2
"""Bins from the end of the hole on that are looked at, an octave, and one more for rounding."""


@dataclass(eq=False)
class Census(SideBySide):
    """What was seen of the values of several axes, about a reference of each."""

    samples: int = 0    # how many were counted
    # (axes,)
    lowest: Array = field(init=False, metadata=AXES_FIRST)
    highest: Array = field(init=False, metadata=AXES_FIRST)
    # (2, axes): how many samples stand at the lowest and at the highest
    at_ends: Counts = field(init=False, metadata=AXES_SECOND)
    # (axes,): the least change from a sample to the next, but for few that are smaller;
    # infinite where nothing changes
    step: Array = field(init=False, metadata=AXES_FIRST)
    # (axes,): how many samples are zero
    zeros: Counts = field(init=False, metadata=AXES_FIRST)
    # (axes, bins): how many are of each magnitude, see `lower_edge`, up to an octave beyond
    # the end of the hole about zero
    sizes: Counts = field(init=False, metadata=AXES_FIRST)
    # (axes, axes): flags of pairs whose samples were all equal so far
    equal_pairs: NDArray[np.int8] = field(init=False, metadata=AXES_TWICE)

    def begin(self) -> None:
        """Begin with nothing."""
        axes = self.axes
        self.lowest, self.highest = np.full(axes, np.inf), np.full(axes, -np.inf)
        self.at_ends = np.zeros((2, axes), np.int64)
        self.step = np.full(axes, np.inf)
        self.zeros, self.sizes = np.zeros(axes, np.int64), np.zeros((axes, _BINS), np.int64)
        self.equal_pairs = np.triu(np.full((axes, axes), sum(_KINDS.values()), dtype=np.int8), 1)

    def count(self, rows: Array, reference: Array) -> None:
        """
        Count the next samples.

        `rows`, shape (axes, n): about `reference`, one at least. `reference`, shape (axes,): what
        was subtracted.
        """
        self._count_ends(rows)
        self._count_near_zero(rows, -reference)
        # Of all sensors but broken ones no pair is left after a few samples.
        for one, other in np.argwhere(self.equal_pairs):
            for sign, bit in _KINDS.items():
                if self.equal_pairs[one, other] & bit and not (
                        reference[one] == sign * reference[other]
                        and np.array_equal(rows[one], sign * rows[other])):
                    self.equal_pairs[one, other] &= ~bit
        # The least step of a coarse output shows in so many; to look on takes a tenth of the time.
        if self.samples < 65_536:
            np.minimum(self.step, _step_of(rows), out=self.step)
        self.samples += rows.shape[1]

    def _count_ends(self, rows: Array) -> None:
        """Move the extremes on; samples are counted only where a block reaches one of them."""
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
        Count the samples that are zero, and where these are many the magnitudes of the others.

        The hole can only become narrower: what lies far beyond it is not counted any more, and
        nothing once the output is seen to step, as most do: the step is no hole.
        """
        for row, nothing, sizes, axis in zip(rows, zero, self.sizes, range(self.axes),
                                             strict=True):
            here = np.count_nonzero(row == nothing)
            self.zeros[axis] += here
            # Magnitudes are looked at only where zeros are many, as it takes its time.
            if here < 0.01 * len(row):
                continue
            ends = end_of_hole(sizes)
            # So many next to zero, and none within the octave beyond: an output of steps, which
            # has no hole.
            if ends is not None and sizes[ends:ends + 2].sum() > 10_000 and not sizes[
                    ends + 2:ends + BINS_PER_OCTAVE - 1].any():
                continue
            farthest = np.inf if ends is None else lower_edge(ends + _REACH)
            magnitude = np.abs(row - nothing)
            some = magnitude[(magnitude > 0) & (magnitude < farthest)]
            places = np.floor(BINS_PER_OCTAVE * (np.log2(some) - _LOWEST_OCTAVE))
            sizes += np.bincount(np.clip(places, 0, _BINS - 1).astype(np.intp), minlength=_BINS)

    def copies(self) -> list[tuple[int, int, int]]:
        """Return the pairs of axes that give the same samples, by number, with their sign."""
        return [(int(one), int(other), sign) for one, other in np.argwhere(self.equal_pairs)
                for sign, bit in _KINDS.items() if self.equal_pairs[one, other] & bit]

    def merge(self, other: 'Census', shift: Array) -> None:
        """Add the samples of another record, moved by `shift` as its reference is another."""
        for end, mine, theirs, sign in ((0, self.lowest, other.lowest + shift, -1.0),
                                        (1, self.highest, other.highest + shift, 1.0)):
            ahead = sign * (theirs - mine)
            same = np.abs(ahead) <= _ROUNDING * np.maximum(1, np.abs(theirs))
            self.at_ends[end] = np.where(same, self.at_ends[end] + other.at_ends[end], np.where(
                ahead > 0, other.at_ends[end], self.at_ends[end]))
            mine[:] = np.where(ahead > 0, theirs, mine)
        self.step = np.minimum(self.step, other.step)
        self.zeros += other.zeros
        self.sizes += other.sizes
        self.equal_pairs &= other.equal_pairs
        self.samples += other.samples

    def check(self) -> None:
        """Raise ValueError where fields that were saved do not belong together."""
        new = Census(self.axes)
        if (any(part.shape != vars(new)[name].shape for name, part in vars(self).items()
                if isinstance(part, np.ndarray))
                or any(np.any((counts < 0) | (counts > self.samples))
                       for counts in (self.at_ends, self.zeros, self.sizes))):
            raise ValueError('counts of the samples do not fit together')


def _step_of(rows: Array) -> Array:
    """Return the least change of some samples, shape (axes,)."""
    steps = np.full(len(rows), np.inf)
    changes = np.abs(np.diff(rows, axis=1))
    there = changes >= _ROUNDING * np.maximum(1, np.abs(rows[:, 1:]))
    for axis, count in enumerate(there.sum(axis=1).tolist()):
        if count:
            # A few odd readings lie off the steps. Smooth noise seems to step by a tenth of its
            # size then, far less than matters.
            place = int(0.05 * count)
            steps[axis] = np.partition(changes[axis, there[axis]], place)[place]
    return steps


def end_of_hole(sizes: Counts) -> int | None:
    """Return the first bin up to which there are more than `FEWEST` samples, else None."""
    beyond = np.cumsum(sizes) > FEWEST
    return int(np.argmax(beyond)) if beyond[-1] else None


def lower_edge(place: int) -> float:
    """Return the least magnitude in a bin."""
    return float(2.0**(_LOWEST_OCTAVE + place / BINS_PER_OCTAVE))
