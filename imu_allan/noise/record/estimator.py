# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The streaming estimator, in one class as every part takes in the same chunks of samples."""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from imu_allan.noise.record.alike import narrow_down, undecided
from imu_allan.noise.record.bridges import Bridges, BridgeSums
from imu_allan.noise.record.cells import MOST_RUNS
from imu_allan.noise.record.extreme_values import count_ends, merge_ends
from imu_allan.noise.record.near_zero import BINS, count_near_zero
from imu_allan.noise.record.periodogram import BLOCK, Periodogram
from imu_allan.noise.record.pyramid import Pyramid
from imu_allan.noise.record.signal_over_time import Signal
from imu_allan.noise.record.steps import step_of
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
State = dict[str, NDArray[np.generic]]

CHUNK = 4 * BLOCK
"""Whole blocks of the spectrum, which numpy takes at once: 0.8 MB for six axes."""
_RESOLUTION_SAMPLES = 65_536
"""The least step of a coarse output shows in so many; to look on takes a tenth of the time."""


@dataclass
class _Counters:
    samples: int = 0
    bridged: int = 0
    runs: int = 0
    first: int = 0      # place of the first sample of the chunk that is being filled
    held: int = 0       # samples in that chunk
    resolved: int = 0   # samples that the search for a quantizer step has seen


class Estimator:
    """
    Streaming estimator of several axes in constant memory.

    Samples go in, in blocks of any size; the state holds the octave pyramid of the Allan variance,
    the spectrum, and the signal's mean and extremes over time. How the samples were cut into
    blocks makes no difference, to the last bit: internally they are always processed in the same
    chunks. The curve is equation (4) of docs/statistics.md, the spectrum P of (6).

    Parameters
    ----------
    axes : int, optional
        How many axes are estimated side by side.

    Attributes
    ----------
    samples, bridged : int
        Samples taken in, and how many of them stand in for missing ones.

    Examples
    --------
    >>> one, other = Estimator(axes=2), Estimator(axes=2)
    >>> rows = np.arange(2000.0).reshape(1000, 2)
    >>> one.update(rows)
    >>> for row in rows:
    ...     other.update(row[None])
    >>> one.samples, bool((one.mean == other.mean).all())
    (1000, True)

    """

    def __init__(self, axes: int = 1) -> None:
        if axes < 1:
            raise ValueError(f'axes must be at least 1, not {axes}')
        self.axes = axes
        self.pyramid = Pyramid(axes)
        self.periodogram = Periodogram(axes)
        self.signal = Signal(axes)
        self._bridges = BridgeSums()
        self.reference: Array | None = None
        self.lowest = np.full(axes, np.inf)
        self.highest = np.full(axes, -np.inf)
        self.step = np.full(axes, np.inf)
        self.at_ends = np.zeros((2, axes), dtype=np.int64)
        self.at_zero = np.zeros(axes, dtype=np.int64)
        self.near_zero = np.zeros((axes, BINS), dtype=np.int64)
        self.alike = undecided(axes)
        self._chunk = np.zeros((axes, CHUNK))
        self._stand_ins: list[int] = []     # their places in the chunk, rising
        self._n = _Counters()

    @property
    def samples(self) -> int:
        """How many samples were taken in."""
        return self._n.samples

    @property
    def bridged(self) -> int:
        """How many of the samples stand in for missing ones."""
        return self._n.bridged

    @property
    def bridges(self) -> Bridges:
        """Tell what the samples that stand in for missing ones do to noise."""
        return self._bridges.bridges(self.bridged / max(self.samples, 1))

    @property
    def measured(self) -> int:
        """How many of the samples the sensor gave."""
        return self._n.samples - self._n.bridged

    @property
    def constant(self) -> NDArray[np.bool_]:
        """Whether each axis has given one value so far, shape (axes,)."""
        held = self._without_stand_ins()
        return np.asarray(np.maximum(self.highest, held.max(axis=1, initial=-np.inf))
                          <= np.minimum(self.lowest, held.min(axis=1, initial=np.inf)))

    @property
    def next_place(self) -> tuple[int, int]:
        """Return the run that is being taken in, by number, and the place of its next sample."""
        return self._n.runs, self._n.first + self._n.held

    def update(self, samples: ArrayLike, bridged: Sequence[int] | NDArray[np.int64] = ()
               ) -> None:
        """
        Take in the next samples of the stretch.

        Parameters
        ----------
        samples : array_like, shape (n, axes) or, for one axis, (n,)
            Evenly spaced, finite.
        bridged : sequence of int, optional
            Which rows stand in for missing ones, rising. They are no values of the sensor: its
            range, its steps and its zeros are told without them.

        Raises
        ------
        ValueError
            If the shape is not that of the axes, a sample is not finite, or the rows of `bridged`
            are not there or do not rise.

        """
        block = np.asarray(samples, dtype=np.float64)
        if block.ndim == 1 and self.axes == 1:
            block = block[:, None]
        if block.ndim != 2 or block.shape[1] != self.axes:
            raise ValueError(f'samples must have shape (n, {self.axes}), not {block.shape}')
        if not np.isfinite(block).all():
            raise ValueError('samples must be finite')
        stand_ins = [int(row) for row in bridged]
        if any(later <= one for one, later in pairwise([-1, *stand_ins, len(block)])):
            raise ValueError(f'bridged must be rising rows of the {len(block)} samples, not '
                             f'{stand_ins}')
        if not len(block):
            return
        if self.reference is None:
            self.reference = block[0].copy()
        start = 0
        while start < len(block):
            take = min(CHUNK - self._n.held, len(block) - start)
            np.subtract(block[start:start + take].T, self.reference[:, None],
                        out=self._chunk[:, self._n.held:self._n.held + take])
            if stand_ins:
                low, high = (bisect_left(stand_ins, end) for end in (start, start + take))
                self._stand_ins += [self._n.held + row - start for row in stand_ins[low:high]]
            self._n.held += take
            start += take
            if self._n.held == CHUNK:
                self._absorb()
        self._n.samples += len(block)
        self._n.bridged += len(stand_ins)

    def skip(self, missing: int) -> None:
        """
        Leave out `missing` samples: a new stretch begins behind them.

        Raises
        ------
        ValueError
            If `missing` is negative.

        """
        if missing < 0:
            raise ValueError(f'missing must not be negative: {missing}')
        self._absorb()
        self.pyramid.start_stretch()
        self.signal.skip(missing)
        self._n.first += missing

    def start_run(self) -> None:
        """Begin a new run, whose distance in time from the one before is unknown."""
        self._absorb()
        self.pyramid.start_stretch()
        self._n.runs += 1
        self._n.first = 0
        if self._n.runs >= MOST_RUNS:
            self._n.runs = self.periodogram.renumber_runs()

    def finished(self) -> 'Estimator':
        """Return a copy in which all samples have reached the sums, ready to be fitted."""
        twin = self.copy()
        twin._absorb()
        twin.periodogram.finish()
        return twin

    def copy(self) -> 'Estimator':
        """Return an independent copy."""
        twin = Estimator.__new__(Estimator)
        twin.axes = self.axes
        twin.pyramid, twin.periodogram = self.pyramid.copy(), self.periodogram.copy()
        twin.signal, twin._bridges = self.signal.copy(), self._bridges.copy()
        twin.reference = None if self.reference is None else self.reference.copy()
        twin.lowest, twin.highest = self.lowest.copy(), self.highest.copy()
        twin.step, twin.at_ends = self.step.copy(), self.at_ends.copy()
        twin.at_zero, twin.near_zero = self.at_zero.copy(), self.near_zero.copy()
        twin.alike = self.alike.copy()
        twin._chunk, twin._stand_ins = self._chunk.copy(), self._stand_ins.copy()
        twin._n = _Counters(**vars(self._n))
        return twin

    def taken(self, axes: Sequence[int]) -> 'Estimator':
        """
        Return an independent copy of some of the axes, which goes on alone.

        Parameters
        ----------
        axes : sequence of int
            Their numbers.

        Examples
        --------
        >>> both = Estimator(axes=2)
        >>> both.update(np.arange(8.0).reshape(4, 2))
        >>> both.taken([1]).mean
        array([4.])

        """
        twin, some = self.copy(), list(axes)
        twin.axes = len(some)
        for part in (twin.pyramid, twin.periodogram, twin.signal):
            part.keep(some)
        twin.reference = None if self.reference is None else self.reference[some]
        twin.lowest, twin.highest = self.lowest[some], self.highest[some]
        twin.step, twin._chunk = self.step[some], self._chunk[some]
        twin.at_ends = self.at_ends[:, some]
        twin.at_zero, twin.near_zero = self.at_zero[some], self.near_zero[some]
        twin.alike = np.triu(self.alike[np.ix_(some, some)], 1)
        return twin

    @property
    def mean(self) -> Array:
        """Mean of every axis over all samples, shape (axes,); NaN before the first."""
        if self.reference is None:
            return np.full(self.axes, np.nan)
        held = self._chunk[:, :self._n.held]
        series = self.periodogram.series
        total = series.sums.sum(axis=1) + held.sum(axis=1)
        return np.asarray(self.reference + total / (series.counts.sum() + held.shape[1]))

    def merge(self, other: 'Estimator') -> None:
        """
        Add another record of the same axes; no difference is taken across the seam.

        Raises
        ------
        ValueError
            If the number of axes differs.

        """
        if other.axes != self.axes:
            raise ValueError(f'cannot merge {other.axes} axes into {self.axes}')
        theirs = other.finished()
        if theirs.reference is None:
            return
        self.start_run()
        self.periodogram.finish()
        if self.reference is None:
            self.reference = theirs.reference
        # Both keep their samples about a reference of their own.
        shift = theirs.reference - self.reference
        self.signal.merge(theirs.signal, shift)
        theirs.periodogram.shift(shift)
        runs = theirs.periodogram.renumber_runs()
        if self._n.runs + runs >= MOST_RUNS:
            self._n.runs = self.periodogram.renumber_runs()
        self.periodogram.merge(theirs.periodogram, self._n.runs)
        self.pyramid.merge(theirs.pyramid)
        self._bridges.merge(theirs._bridges)
        merge_ends((self.lowest, self.highest, self.at_ends),
                   (theirs.lowest + shift, theirs.highest + shift, theirs.at_ends))
        self.step = np.minimum(self.step, theirs.step)
        self.at_zero += theirs.at_zero
        self.near_zero += theirs.near_zero
        self.alike &= theirs.alike
        self._n.samples += theirs.samples
        self._n.bridged += theirs.bridged
        self._n.runs += runs

    def _absorb(self) -> None:
        """Bring the samples held back into the sums."""
        n = self._n
        if not n.held:
            return
        assert self.reference is not None
        rows, own = self._chunk[:, :n.held], self._without_stand_ins()
        if own.shape[1]:
            count_ends(own, self.lowest, self.highest, self.at_ends)
            count_near_zero(own, self.reference, self.at_zero, self.near_zero)
            narrow_down(own, self.reference, self.alike)
            if n.resolved < _RESOLUTION_SAMPLES:
                n.resolved += own.shape[1]
                np.minimum(self.step, step_of(own), out=self.step)
        self._bridges.add(self._stand_ins, n.held)
        self.pyramid.absorb(rows)
        self.periodogram.absorb(rows, n.runs, n.first)
        self.signal.absorb(rows)
        n.first += n.held
        n.held = 0
        self._stand_ins = []

    def _without_stand_ins(self) -> Array:
        """Return the samples held back that the sensor gave."""
        held = self._chunk[:, :self._n.held]
        if not self._stand_ins:
            return held
        own = np.ones(held.shape[1], dtype=np.bool_)
        own[self._stand_ins] = False
        # Taken, the rows stay contiguous, as what reads them wants; deleted, they do not.
        return held.take(np.flatnonzero(own), axis=1)

    def to_state(self) -> State:
        """
        Return the state as plain arrays, a few hundred kilobytes at most per axis.

        Returns
        -------
        dict of str to ndarray
            Read back by `from_state`; no object arrays, so that it can be stored without pickle.

        """
        state: State = {
            'counters': np.array(list(vars(self._n).values())),
            'chunk': self._chunk[:, :self._n.held].copy(),
            'stand_ins': np.array(self._stand_ins, dtype=np.int64),
            'range': np.array([self.lowest, self.highest, self.step]),
            'at_ends': self.at_ends.copy(),
            'at_zero': self.at_zero.copy(),
            'near_zero': self.near_zero.copy(),
            'alike': self.alike.copy(),
            'bridges': self._bridges.to_state(),
        }
        if self.reference is not None:
            state['reference'] = self.reference
        for name, part in (('pyramid', self.pyramid), ('periodogram', self.periodogram),
                           ('signal', self.signal)):
            state.update({f'{name}/{key}': value for key, value in part.to_state().items()})
        return state

    @classmethod
    def from_state(cls, state: State) -> 'Estimator':
        """
        Return the estimator that `to_state` described.

        Raises
        ------
        KeyError, ValueError
            If the state is not one of an estimator.

        """
        def part(name: str) -> State:
            return {key[len(name) + 1:]: value for key, value in state.items()
                    if key.startswith(f'{name}/')}

        chunk = np.array(state['chunk'], dtype=np.float64)
        ranges = np.array(state['range'], dtype=np.float64)
        # A state of an earlier release has no counts: they begin here, and are too low then.
        at_ends, at_zero, near_zero = (
            np.array(state.get(key, np.zeros(shape)), dtype=np.int64) for key, shape in (
                ('at_ends', (2, len(chunk))), ('at_zero', len(chunk)),
                ('near_zero', (len(chunk), BINS))))
        alike = np.array(state.get('alike', np.zeros((len(chunk), len(chunk)))), dtype=np.int8)
        # ... and does not tell which of the samples held back stand in for others.
        stand_ins = np.array(state.get('stand_ins', []), dtype=np.int64)
        counters = _Counters(*(int(value) for value in state['counters']))
        if (chunk.ndim != 2 or chunk.shape[1] != counters.held or counters.held >= CHUNK
                or ranges.shape != (3, len(chunk)) or at_ends.shape != (2, len(chunk))
                or at_zero.shape != (len(chunk),) or near_zero.shape != (len(chunk), BINS)
                or alike.shape != (len(chunk), len(chunk)) or stand_ins.ndim != 1
                or np.any(np.diff(stand_ins, prepend=-1, append=counters.held) <= 0)
                or any(np.any((counts < 0) | (counts > counters.samples))
                       for counts in (at_ends, at_zero, near_zero))
                or not 0 <= counters.runs < MOST_RUNS
                or not 0 <= counters.bridged <= counters.samples):
            raise ValueError('arrays of the estimator do not fit together')
        self = cls(len(chunk))
        self._n = counters
        self._chunk[:, :counters.held], self._stand_ins = chunk, stand_ins.tolist()
        (self.lowest, self.highest, self.step), self.at_ends = ranges.copy(), at_ends
        self.at_zero, self.near_zero, self.alike = at_zero, near_zero, alike
        if 'reference' in state:
            self.reference = np.array(state['reference'], dtype=np.float64)
        if 'bridges' in state:
            self._bridges = BridgeSums.from_state(state['bridges'])
        elif self.bridged:
            # ... nor in which pattern: most losses are random.
            self._bridges = BridgeSums.at_random(self.bridged / self.samples, self.samples)
        self.pyramid = Pyramid.from_state(part('pyramid'))
        self.periodogram = Periodogram.from_state(part('periodogram'))
        self.signal = Signal.from_state(part('signal'))
        if not (self.axes == self.pyramid.sums.shape[1] == self.periodogram.axes
                == self.signal.axes):
            raise ValueError('arrays of the estimator do not fit together')
        return self
