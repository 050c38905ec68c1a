# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Readings of a thermometer in constant memory.

Readings arrive with stamps, in any order and any number at a time, before or after the samples
that they belong to. The stamps of samples on the same clock are noted as they arrive. The two are
combined when a fit asks for the temperature over the record. This is one class because everything
uses the same cells.
"""

from dataclasses import dataclass, field

from imu_allan.arrays import Array, Ints
from imu_allan.noise.record.cells import Cells, centres
from imu_allan.noise.record.signal_over_time import Columns
from imu_allan.noise.trends.temperature_series import between_steps, TemperatureSeries
from imu_allan.result import Signal
from imu_allan.state import Record
import numpy as np
from numpy.typing import ArrayLike

_SCALE = 1_000_000
"""Readings are stored in millionths of a degree: sums of integers do not depend on the order."""
COVERED = 0.9
"""Least share of the record that the readings must cover; the rest is interpolated."""


@dataclass(frozen=True)
class Temperature:
    """The temperature over a record."""

    covered: float    # share of the record with readings
    # None if too little is covered or the temperature never changes
    series: TemperatureSeries | None
    gaps: int    # number of gaps between readings that are too long for a line
    step: float    # smallest change between successive readings, in kelvin; 0 if there is none


@dataclass(eq=False)
class Thermometer(Record):
    """
    Readings of one thermometer.

    Examples
    --------
    >>> thermometer = Thermometer()
    >>> thermometer.take([0, 2_000_000_000], [20.0, 22.0])
    >>> thermometer.celsius(np.array([1e9])).round(1)
    array([21.])

    """

    # Width of a cell in ns: 0.07 s at first, as no sensor follows its temperature any faster.
    width: int = 1 << 26
    step: int = 0    # smallest change between readings, in 1 / `_SCALE` K; 0 if there is none
    shown: int = 0    # place in the signal after the newest sample
    # (cells,): stamps divided by `width`
    keys: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    # (4, cells): sum, number, minimum and maximum of the readings of each cell
    readings: Ints = field(default_factory=lambda: np.zeros((4, 0), np.int64))
    # (runs, 7): run, then place in the run, place in the signal and stamp, both of its first and
    # of its last sample
    runs: Ints = field(default_factory=lambda: np.zeros((0, 7), np.int64))

    def __len__(self) -> int:
        """Return the number of readings."""
        return int(self.readings[1].sum())

    def take(self, stamps_ns: ArrayLike, celsius: ArrayLike) -> None:
        """
        Add readings.

        `stamps_ns`, shape (n,): on the clock of the samples. `celsius`, shape (n,): values that
        are not finite, or beyond a million degrees, are left out. Raises ValueError: if the two
        differ in length.
        """
        stamps = np.asarray(stamps_ns, dtype=np.int64).reshape(-1)
        values = np.asarray(celsius, dtype=np.float64).reshape(-1)
        if len(stamps) != len(values):
            raise ValueError(f'{len(stamps)} stamps for {len(values)} temperatures')
        # A million degrees is not a temperature, and far from overflow of the integers.
        usable = np.abs(values) < 1e6
        values, stamps = values[usable], stamps[usable]
        if not len(values):
            return
        scaled = np.rint(values * _SCALE).astype(np.int64)
        changes = np.abs(np.diff(scaled))
        changes = changes[changes > 0]
        if len(changes):
            self.step = min(self.step or int(changes.min()), int(changes.min()))
        self._combine(
            np.append(self.keys, stamps // self.width), np.concatenate((
                self.readings, (scaled, np.ones_like(scaled), scaled, scaled)), axis=1))
        # Half as many cells as the record itself has are enough, as temperatures are slower.
        while len(self.keys) > 4096:
            self.width *= 2
            self._combine(self.keys // 2, self.readings)

    def _combine(self, keys: Ints, readings: Ints) -> None:
        """Set the cells to these readings, with those of the same cell combined."""
        order = np.argsort(keys, kind='stable')
        self.keys, starts = np.unique(keys[order], return_index=True)
        self.readings = np.stack([how.reduceat(row[order], starts) for how, row in zip(
            (np.add, np.add, np.minimum, np.maximum), readings, strict=True)])

    def place(self, run: int, first: int, samples: int, skipped: int, first_ns: int | None,
              last_ns: int | None) -> None:
        """
        Record the stamps of samples.

        `run`: their run, as numbered by the estimator. `first`, `samples`: place of the first of
        them on the grid of the run, and their number. `skipped`: places left empty before them.
        `first_ns`, `last_ns`: stamps of the first and the last; None without a clock.
        """
        begin = self.shown + skipped
        self.shown = begin + samples
        if first_ns is None or last_ns is None:
            return
        new = np.array([run, first, begin, first_ns, first + samples - 1, self.shown - 1,
                        last_ns], dtype=np.int64)
        if len(self.runs) and self.runs[-1, 0] == run:
            self.runs = self.runs.copy()
            self.runs[-1, 4:] = new[4:]
        else:
            # With more runs, the temperature of the oldest is lost.
            self.runs = np.concatenate((self.runs, new[None]))[-256:]

    def forget_samples(self) -> None:
        """Forget the samples, but keep the readings."""
        self.runs, self.shown = self.runs[:0], 0

    def celsius(self, stamps: Array) -> Array:
        """Return the temperature at stamps in ns, interpolated linearly; NaN far from readings."""
        keys, readings = self.keys, self.readings
        if not len(keys):
            return np.full(len(stamps), np.nan)
        # Relative to the first: a present-day stamp in ns is rounded to 256 ns in a double.
        origin = float(keys[0]) * self.width
        times = (keys - keys[0] + 0.5) * self.width
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
        """Return the longest gap, in ns, that is interpolated linearly."""
        usual = float(np.median(np.diff(self.keys))) if len(self.keys) > 1 else 0.0
        # Ten usual intervals, or five minutes, as a sensor takes several minutes to settle.
        return max(10 * usual * self.width, 300e9)

    def temperature(self, series: Cells, size: int, dt: float) -> Temperature | None:
        """
        Return the temperature over a record.

        `series`: the whole-record series of the estimator. `size`: samples in one of its full
        cells. None without readings or samples.
        """
        whole = series.take(series.counts >= size / 2)
        if not len(self.keys) or not len(whole) or not len(self.runs):
            return None
        runs, places, in_a_row = centres(whole, size)
        values = self.celsius(self._stamps(runs, places))
        known = np.isfinite(values)
        covered = float(whole.counts[known].sum() / whole.counts.sum())
        gaps = int((np.diff(self.keys) * float(self.width) > self._reach()).sum())
        of_time = None
        if covered >= COVERED and np.ptp(values[known]) > 0:
            values = np.interp(in_a_row, in_a_row[known], values[known])
            # Beyond a fiftieth of the range, the steps of the readings exceed their noise.
            if self.step > 0.02 * np.ptp(values) * _SCALE:
                values = between_steps(in_a_row, values, self.step / _SCALE)
            of_time = TemperatureSeries(in_a_row * dt, values)
        return Temperature(covered, of_time, gaps, self.step / _SCALE)

    def _stamps(self, runs: Ints, places: Array) -> Array:
        """Return stamps, in ns, of places on the grids of runs; NaN for unknown runs."""
        row = np.clip(np.searchsorted(self.runs[:, 0], runs), 0, len(self.runs) - 1)
        stamps = self._between_ends(row, places - 0.5, 1, 4)
        return np.where(self.runs[row, 0] == runs, stamps, np.nan)

    def _between_ends(self, row: Ints, places: Array, first: int, last: int) -> Array:
        """Interpolate stamps between the ends of runs, at the places in two columns of `runs`."""
        known = self.runs[row].astype(np.float64)
        span = np.maximum(known[:, last] - known[:, first], 1)
        slope = (known[:, 6] - known[:, 3]) / span
        return np.asarray(known[:, 3] + (places - known[:, first]) * slope)

    def signal(self, columns: Columns, dt: float) -> Signal | None:
        """
        Return the temperature over time, in segments of whole columns of the signal.

        `columns`: of the signal of the axes, whose time axis is used. Returns degrees Celsius;
        None if no segment has a temperature.
        """
        if not len(self.keys) or not len(self.runs) or not len(columns.counts):
            return None
        # At most 128 segments of the temperature are shown.
        count = -(-len(columns.counts) // 128)
        width = columns.width * count
        segments = -(-len(columns.counts) // count)
        edges = np.minimum(np.arange(segments + 1.0) * width, self.shown)
        row = np.clip(np.searchsorted(self.runs[:, 2], edges, 'right') - 1, 0, None)
        stamps = self._between_ends(row, edges, 2, 5)
        middle = self.celsius((stamps[:-1] + stamps[1:]) / 2)
        times = (self.keys + 0.5) * self.width
        shown = []
        for begin, end, at in zip(stamps[:-1], stamps[1:], middle, strict=True):
            inside = self.readings[:, (times >= begin) & (times < end)] / _SCALE
            own = (inside[2].min(), inside[0].sum() / (inside[1].sum() * _SCALE),
                   inside[3].max()) if inside.size else (at, at, at)
            shown.append([None if np.isnan(value) else round(float(value), 3) for value in own])
        lows, means, highs = zip(*shown, strict=True)
        return None if not any(mean is not None for mean in means) else Signal(
            width * dt, lows, means, highs)
