# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Streaming estimator, which passes chunks of samples to all of its parts."""

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from imu_allan.arrays import Array, Ints
from imu_allan.errors import whole
from imu_allan.noise.record.cells import RUN_SHIFT
from imu_allan.noise.record.census import Census
from imu_allan.noise.record.multi_axis import AXES, AXES_FIRST, begun, MultiAxis, numbers
from imu_allan.noise.record.periodogram import Periodogram
from imu_allan.noise.record.pyramid import Pyramid
from imu_allan.noise.record.segments import SHORTEST_SEGMENT
from imu_allan.noise.record.signal_over_time import Signal
from imu_allan.state import restored, State, state_of
import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(eq=False, repr=False)
class Estimator(MultiAxis):
    """
    Streaming estimator of several axes in constant memory.

    It accepts samples in blocks of any size. The state contains the octave pyramid of the Allan
    variance, the spectrum, and the mean and extremes of the signal over time. The result does not
    depend on the sizes of the blocks, to the last bit, because samples are always processed in the
    same chunks. The curve is equation (4) of docs/statistics.md, the spectrum P of (6).

    Parameters
    ----------
    axes : int, optional
        Number of axes, which are processed together.

    Attributes
    ----------
    samples, interpolated : int
        Number of samples added, and how many of them are interpolated.
    reference : ndarray, shape (axes,), or None
        The first sample, which is subtracted from all.
    pyramid, periodogram, signal, census
        Statistics of the samples.
    chunk : ndarray, shape (axes, n)
        Samples that are not processed yet.
    interpolated_rows : list of int
        Interpolated rows of the chunk, in rising order.
    run, first : int
        Current run, and the place of the first sample of the chunk in it.

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

    axes: int = 1
    samples: int = 0
    interpolated: int = 0
    run: int = 0
    first: int = 0
    reference: Array | None = field(default=None, metadata=AXES_FIRST)
    interpolated_rows: list[int] = field(default_factory=list)
    pyramid: Pyramid = field(init=False, metadata=begun(Pyramid))
    periodogram: Periodogram = field(init=False, metadata=begun(Periodogram))
    signal: Signal = field(init=False, metadata=begun(Signal))
    census: Census = field(init=False, metadata=begun(Census))
    chunk: Array = field(init=False, metadata=numbers(AXES, 0))

    @property
    def interpolated_share(self) -> float:
        """Return the share of the samples that are interpolated."""
        return self.interpolated / max(self.samples, 1)

    @property
    def measured(self) -> int:
        """Return the number of samples that are not interpolated."""
        return self.samples - self.interpolated

    @property
    def next_place(self) -> tuple[int, int]:
        """Return the number of the current run, and the place of its next sample."""
        return self.run, self.first + self.chunk.shape[1]

    def update(self, samples: ArrayLike, interpolated: Sequence[int] | Ints = ()) -> None:
        """
        Add the next samples of the segment.

        Parameters
        ----------
        samples : array_like, shape (n, axes) or, for one axis, (n,)
            Evenly spaced, finite samples.
        interpolated : sequence of int, optional
            Interpolated rows, in rising order. They are no values of the sensor, so they are
            excluded from the statistics of its range, steps and zeros.

        Raises
        ------
        ValueError
            If the shape does not match the axes, a sample is not finite or is masked, or
            `interpolated` are not rising row numbers.

        """
        block = np.asarray(np.real(samples), dtype=np.float64)
        if block.ndim == 1 and self.axes == 1:
            block = block[:, None]
        if block.ndim != 2 or block.shape[1] != self.axes:
            raise ValueError(f'samples must have shape (n, {self.axes}), not {block.shape}')
        # An array made of a masked one has values in place of those that are masked.
        # No sensor reaches a value whose fourth power overflows.
        if (np.iscomplexobj(samples) or np.ma.is_masked(samples)
                or not -1e30 < block.min(initial=0.0) <= block.max(initial=0.0) < 1e30):
            raise ValueError('samples must be finite, below 1e30, real, and none masked; '
                             'imu_allan.analyze reads a CSV file with gaps')
        places = [int(row) for row in interpolated]
        if any(later <= one for one, later in pairwise([-1, *places, len(block)])):
            raise ValueError(f'interpolated must be rising rows of the {len(block)} samples, not '
                             f'{places}')
        if not len(block):
            return
        if self.reference is None:
            self.reference = block[0].copy()
        # The chunk is the part in use of an array with room for more, unless it is a copy.
        room = self.chunk.base
        if not isinstance(room, np.ndarray) or room.shape != (self.axes, SHORTEST_SEGMENT):
            room = np.empty((self.axes, SHORTEST_SEGMENT))
            room[:, :self.chunk.shape[1]] = self.chunk
        start = 0
        while start < len(block):
            held = self.chunk.shape[1]
            take = min(SHORTEST_SEGMENT - held, len(block) - start)
            self.chunk = room[:, :held + take]
            np.subtract(block[start:start + take].T, self.reference[:, None],
                        out=self.chunk[:, held:])
            if places:
                low, high = (bisect_left(places, end) for end in (start, start + take))
                self.interpolated_rows += [held + row - start for row in places[low:high]]
            start += take
            if held + take == SHORTEST_SEGMENT:
                self._absorb()
        self.samples += len(block)
        self.interpolated += len(places)

    def skip(self, missing: int) -> None:
        """
        Skip `missing` samples and begin a new segment after them.

        Raises
        ------
        ValueError
            If `missing` is negative or no whole number.

        """
        missing = whole('missing', missing)
        self._absorb()
        self.pyramid.start_segment()
        self.signal.skip(missing)
        self.first += missing

    def start_run(self) -> None:
        """Begin a new run, with an unknown distance in time from the previous one."""
        self._absorb()
        self.pyramid.start_segment()
        # Runs fit into the rest of a signed 64-bit key: one a minute for eight years. The last
        # that can be numbered goes on.
        if self.run < (1 << (62 - RUN_SHIFT)) - 1:
            self.run, self.first = self.run + 1, 0

    def finished(self) -> 'Estimator':
        """Return a copy with all samples processed, ready to be fitted."""
        twin = self.copy()
        twin.finish()
        return twin

    def finish(self) -> None:
        """Process all samples; then add no more."""
        self._absorb()
        self.periodogram.finish()

    @property
    def mean(self) -> Array:
        """Mean of each axis over all samples, shape (axes,); NaN before the first."""
        if self.reference is None:
            return np.full(self.axes, np.nan)
        series = self.periodogram.series
        total = series.sums.sum(axis=1) + self.chunk.sum(axis=1)
        return np.asarray(self.reference + total / (series.counts.sum() + self.chunk.shape[1]))

    def _absorb(self) -> None:
        """Process the samples in the chunk."""
        rows, own = self.chunk, self._without_interpolated()
        if self.reference is None or not rows.size:
            return
        if own.shape[1]:
            self.census.count(own, self.reference)
        self.pyramid.absorb(rows)
        self.periodogram.absorb(rows, self.run, self.first)
        self.signal.absorb(rows)
        self.first += rows.shape[1]
        self.chunk, self.interpolated_rows = rows[:, :0], []

    def _without_interpolated(self) -> Array:
        """Return the samples in the chunk that are not interpolated."""
        if not self.interpolated_rows:
            return self.chunk
        own = np.ones(self.chunk.shape[1], dtype=np.bool_)
        own[self.interpolated_rows] = False
        # `take` keeps the rows contiguous, for speed; `delete` would not.
        return self.chunk.take(np.flatnonzero(own), axis=1)

    def to_state(self) -> State:
        """
        Return the state as plain arrays, a few hundred kilobytes at most per axis.

        Returns
        -------
        dict of str to ndarray
            State for `from_state`, without object arrays, so that it can be stored without pickle.

        """
        return state_of(self)

    @classmethod
    def from_state(cls, state: Mapping[str, NDArray[np.generic]]) -> 'Estimator':
        """
        Restore an estimator from the result of `to_state`; KeyError if a part is missing.

        The parts are not checked: the arrays have to be as `to_state` returned them.
        """
        return restored(cls, state)
