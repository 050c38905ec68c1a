# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Readings of a thermometer in constant memory, in one class as all of it reads the same cells.

Readings come by their stamps, in any order and any number at a time, before or after the samples
that they belong to; where the samples lie on the same clock is noted as they come. The two meet
when a fit asks for the temperature over the record.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from imu_allan.noise.courses.temperature import between_steps, TemperatureCourse
from imu_allan.noise.record.cells import Cells, centres
from imu_allan.noise.record.signal_over_time import Columns
from imu_allan.result import Signal
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
State = Mapping[str, NDArray[np.generic]]

_SHORTEST_CELL = 1 << 26
"""In ns, 0.07 s: no sensor follows its temperature any faster."""
_CELLS = 4096
"""Of readings: half as many as the record itself has, and temperatures are slower."""
_RUNS = 256
"""Runs whose place on the clock is kept; with more of them the temperature of the oldest goes."""
_SECOND = 1_000_000_000  # in ns
_SCALE = 1_000_000
"""Readings are kept in millionths of a degree: sums of integers do not depend on their order."""
_BEYOND = 1e6
"""In degrees: no temperature, and far from what the integers hold."""
_TYPICAL_GAPS = 10         # of usual intervals ...
_LONGEST_GAP_S = 300.0
"""A gap of so many usual intervals, or so long, is bridged by a line: a sensor's temperature
settles in several minutes."""
COVERED = 0.9
"""Share of the record that the readings have to cover; the rest keeps the nearest."""
_STEPPING = 0.02
"""Share of the range from which on steps of the readings are more than their noise."""
_SHOWN = 128
"""Most stretches of the temperature in a result."""


@dataclass(frozen=True)
class Temperature:
    """
    The temperature over a record.

    Attributes
    ----------
    covered : float
        Share of the record with readings.
    course : TemperatureCourse or None
        None where too little is covered or the temperature never changes.
    gaps : int
        How many gaps of the readings are too long for a line.
    step : float
        Smallest change from one reading to the next, in kelvin; 0 where there is none.

    """

    covered: float
    course: TemperatureCourse | None
    gaps: int
    step: float


class Thermometer:
    """
    Readings of one thermometer.

    Examples
    --------
    >>> thermometer = Thermometer()
    >>> thermometer.take([0, 2_000_000_000], [20.0, 22.0])
    >>> thermometer.celsius(np.array([1e9])).round(1)
    array([21.])

    """

    def __init__(self) -> None:
        self._width = _SHORTEST_CELL
        self._keys: Ints = np.zeros(0, np.int64)
        # Sum, number, lowest and highest of the readings of each cell.
        self._readings: Ints = np.zeros((4, 0), np.int64)
        self._step = 0
        # Run, and of its first and last sample: place in the run, place in the signal, stamp.
        self._runs: Ints = np.zeros((0, 7), np.int64)
        self._shown = 0

    def __len__(self) -> int:
        """How many readings were taken."""
        return int(self._readings[1].sum())

    def take(self, stamps_ns: ArrayLike, celsius: ArrayLike) -> None:
        """
        Take readings.

        Parameters
        ----------
        stamps_ns : array_like of int, shape (n,)
            On the clock of the samples.
        celsius : array_like, shape (n,)
            What is not finite, or beyond a million degrees, is left out.

        Raises
        ------
        ValueError
            If the two differ in length.

        """
        stamps = np.asarray(stamps_ns, dtype=np.int64).reshape(-1)
        values = np.asarray(celsius, dtype=np.float64).reshape(-1)
        if len(stamps) != len(values):
            raise ValueError(f'{len(stamps)} stamps for {len(values)} temperatures')
        usable = np.abs(values) < _BEYOND
        values, stamps = values[usable], stamps[usable]
        if not len(values):
            return
        scaled = np.rint(values * _SCALE).astype(np.int64)
        changes = np.abs(np.diff(scaled))
        changes = changes[changes > 0]
        if len(changes):
            self._step = min(self._step or int(changes.min()), int(changes.min()))
        self._add(stamps // self._width,
                  np.stack((scaled, np.ones(len(scaled), np.int64), scaled, scaled)))
        while len(self._keys) > _CELLS:
            self._width *= 2
            keys, readings = self._keys // 2, self._readings
            self._keys, self._readings = np.zeros(0, np.int64), np.zeros((4, 0), np.int64)
            self._add(keys, readings)

    def _add(self, keys: Ints, readings: Ints) -> None:
        """Add up readings of the same cell."""
        every = np.append(self._keys, keys)
        self._keys, place = np.unique(every, return_inverse=True)
        order = np.argsort(place, kind='stable')
        starts = np.searchsorted(place[order], np.arange(len(self._keys)))
        rows = np.concatenate((self._readings, readings), axis=1)[:, order]
        self._readings = np.stack((
            np.add.reduceat(rows[0], starts), np.add.reduceat(rows[1], starts),
            np.minimum.reduceat(rows[2], starts), np.maximum.reduceat(rows[3], starts)))

    def place(self, run: int, first: int, samples: int, skipped: int, first_ns: int | None,
              last_ns: int | None) -> None:
        """
        Note where samples lie on the clock.

        Parameters
        ----------
        run : int
            Their run, as the estimator numbers it.
        first, samples : int
            Place of the first of them on the grid of the run, and how many they are.
        skipped : int
            Places left empty before them.
        first_ns, last_ns : int or None
            Stamps of the first and the last; None where there is no clock.

        """
        begin = self._shown + skipped
        self._shown = begin + samples
        if first_ns is None or last_ns is None:
            return
        new = np.array([run, first, begin, first_ns, first + samples - 1, self._shown - 1,
                        last_ns], dtype=np.int64)
        if len(self._runs) and self._runs[-1, 0] > run:
            # The estimator has numbered its runs anew: which is which is not known any more.
            self._runs = self._runs[:0]
        if len(self._runs) and self._runs[-1, 0] == run:
            self._runs = self._runs.copy()
            self._runs[-1, 4:] = new[4:]
        else:
            self._runs = np.concatenate((self._runs, new[None]))[-_RUNS:]

    def forget_samples(self) -> None:
        """Begin anew with the samples; the readings stay."""
        self._runs, self._shown = self._runs[:0], 0

    def celsius(self, stamps: Array) -> Array:
        """Temperature at some stamps, in ns, by a line between readings; NaN where too far."""
        keys, readings = self._keys, self._readings
        if not len(keys):
            return np.full(len(stamps), np.nan)
        # About the first: a stamp of today leaves a double only a resolution of 256 ns.
        origin = float(keys[0]) * self._width
        times = (keys - keys[0] + 0.5) * self._width
        at = np.asarray(stamps - origin, dtype=np.float64)
        values = np.interp(at, times, readings[0] / readings[1] / _SCALE)
        reach = self._reach()
        after = np.clip(np.searchsorted(times, at), 0, len(times) - 1)
        before = np.maximum(after - 1, 0)
        gap = (times[after] - times[before] > reach) & (at > times[0]) & (at < times[-1])
        outside = (at < times[0] - reach) | (at > times[-1] + reach)
        values[gap | outside] = np.nan
        return np.asarray(values)

    def _reach(self) -> float:
        """Longest gap, in ns, over which a line is drawn."""
        usual = float(np.median(np.diff(self._keys))) if len(self._keys) > 1 else 0.0
        return max(_TYPICAL_GAPS * usual * self._width, _LONGEST_GAP_S * _SECOND)

    def temperature(self, series: Cells, size: int, dt: float) -> Temperature | None:
        """
        Return the temperature over a record.

        Parameters
        ----------
        series : Cells
            The whole-record series of the estimator.
        size : int
            Samples in one of its full cells.
        dt : float
            Sample interval in seconds.

        Returns
        -------
        Temperature or None
            None without readings or samples.

        """
        whole = series.take(series.counts >= size / 2)
        if not len(self._keys) or not len(whole) or not len(self._runs):
            return None
        runs, places, in_a_row = centres(whole, size)
        values = self.celsius(self._stamps(runs, places))
        known = np.isfinite(values)
        covered = float(whole.counts[known].sum() / whole.counts.sum())
        gaps = int((np.diff(self._keys) * float(self._width) > self._reach()).sum())
        course = None
        if covered >= COVERED and np.ptp(values[known]) > 0:
            values = np.interp(in_a_row, in_a_row[known], values[known])
            if self._step > _STEPPING * np.ptp(values) * _SCALE:
                values = between_steps(in_a_row, values, self._step / _SCALE)
            course = TemperatureCourse(in_a_row * dt, values)
        return Temperature(covered, course, gaps, self._step / _SCALE)

    def _stamps(self, runs: Ints, places: Array) -> Array:
        """Stamps of places on the grids of runs, in ns; NaN where a run is not known."""
        row = np.clip(np.searchsorted(self._runs[:, 0], runs), 0, len(self._runs) - 1)
        known = self._runs[row].astype(np.float64)
        span = np.maximum(known[:, 4] - known[:, 1], 1)
        stamps = known[:, 3] + (places - 0.5 - known[:, 1]) * (known[:, 6] - known[:, 3]) / span
        return np.where(known[:, 0] == runs, stamps, np.nan)

    def signal(self, columns: Columns, dt: float) -> Signal | None:
        """
        Return the temperature over time, in stretches of whole columns of the signal.

        Parameters
        ----------
        columns : Columns
            Of the signal of the axes, on whose time axis it stands.
        dt : float
            Sample interval in seconds.

        Returns
        -------
        Signal or None
            In degrees Celsius; None where no stretch has a temperature.

        """
        if not len(self._keys) or not len(self._runs) or not len(columns.counts):
            return None
        count = -(-len(columns.counts) // _SHOWN)
        width = columns.width * count
        stretches = -(-len(columns.counts) // count)
        edges = np.minimum(np.arange(stretches + 1.0) * width, self._shown)
        row = np.clip(np.searchsorted(self._runs[:, 2], edges, 'right') - 1, 0, None)
        known = self._runs[row].astype(np.float64)
        span = np.maximum(known[:, 5] - known[:, 2], 1)
        stamps = known[:, 3] + (edges - known[:, 2]) * (known[:, 6] - known[:, 3]) / span
        middle = self.celsius((stamps[:-1] + stamps[1:]) / 2)
        times = (self._keys + 0.5) * self._width
        lows: list[float | None] = []
        means: list[float | None] = []
        highs: list[float | None] = []
        for begin, end, at in zip(stamps[:-1], stamps[1:], middle, strict=True):
            inside = self._readings[:, (times >= begin) & (times < end)] / _SCALE
            if inside.size:
                own = (inside[2].min(), inside[0].sum() / (inside[1].sum() * _SCALE),
                       inside[3].max())
            else:
                own = at, at, at
            for values, value in zip((lows, means, highs), own, strict=True):
                values.append(None if np.isnan(value) else round(float(value), 3))
        if all(value is None for value in means):
            return None
        return Signal(width * dt, tuple(lows), tuple(means), tuple(highs))

    def copy(self) -> 'Thermometer':
        """Return an independent copy; arrays are shared, for they are never written to."""
        twin = Thermometer()
        twin.__dict__.update(vars(self))
        return twin

    def to_state(self) -> dict[str, NDArray[np.generic]]:
        """Return the state as plain arrays."""
        return {'keys': self._keys, 'readings': self._readings, 'runs': self._runs,
                'about': np.array([self._width, self._step, self._shown])}

    @classmethod
    def from_state(cls, state: State) -> 'Thermometer':
        """
        Go on from `to_state`.

        Raises
        ------
        KeyError, ValueError
            If the state is not one of a thermometer.

        """
        self = cls()
        self._width, self._step, self._shown = (int(value) for value in state['about'])
        self._keys = np.array(state['keys'], dtype=np.int64)
        self._readings = np.array(state['readings'], dtype=np.int64)
        self._runs = np.array(state['runs'], dtype=np.int64)
        if (self._width < 1 or self._keys.ndim != 1
                or self._readings.shape != (4, len(self._keys))
                or self._runs.ndim != 2 or self._runs.shape[1] != 7
                or (np.diff(self._keys) <= 0).any() or (self._readings[1] < 1).any()):
            raise ValueError('arrays of the thermometer do not fit together')
        return self
