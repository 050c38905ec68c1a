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
from imu_allan.noise.trends.temperature_series import TemperatureSeries
from imu_allan.result import Signal
from imu_allan.state import Record
import numpy as np
from numpy.typing import ArrayLike

_SCALE = 1_000_000
"""Readings are stored in millionths of a degree: sums of integers do not depend on the order."""
SHOWN = 128
"""Points of the temperature that are shown."""
COVERED = 0.9
"""Least share of the record that the readings must cover; the rest is interpolated."""


@dataclass(frozen=True)
class Temperature:
    """The temperature over a record."""

    covered: float    # share of the record with readings
    series: TemperatureSeries | None    # None if too little is covered

    @property
    def changes(self) -> bool:
        """Return whether the temperature is known and changes."""
        return self.series is not None and self.series.highest > self.series.lowest


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
    # (cells,): stamps divided by `width`
    keys: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    # (2, cells): sum and number of the readings of each cell
    readings: Ints = field(default_factory=lambda: np.zeros((2, 0), np.int64))
    # (runs, 5): run, then place in the run and stamp, both of its first and of its last sample
    runs: Ints = field(default_factory=lambda: np.zeros((0, 5), np.int64))

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
        self._combine(
            np.append(self.keys, stamps // self.width), np.concatenate((
                self.readings, (scaled, np.ones_like(scaled))), axis=1))
        # Half as many cells as the record itself has are enough, as temperatures are slower.
        while len(self.keys) > 4096:
            self.width *= 2
            self._combine(self.keys // 2, self.readings)

    def _combine(self, keys: Ints, readings: Ints) -> None:
        """Set the cells to these readings, with those of the same cell combined."""
        order = np.argsort(keys, kind='stable')
        self.keys, starts = np.unique(keys[order], return_index=True)
        self.readings = np.add.reduceat(readings[:, order], starts, axis=1)

    def place(self, run: int, first: int, samples: int, first_ns: int, last_ns: int) -> None:
        """
        Record the stamps of samples.

        `run`: their run, as numbered by the estimator. `first`, `samples`: place of the first of
        them on the grid of the run, and their number. `first_ns`, `last_ns`: stamps of the first
        and the last.
        """
        new = np.array([run, first, first_ns, first + samples - 1, last_ns], dtype=np.int64)
        if len(self.runs) and self.runs[-1, 0] == run:
            self.runs = self.runs.copy()
            self.runs[-1, 3:] = new[3:]
        else:
            # With more runs, the temperature of the oldest is lost.
            self.runs = np.concatenate((self.runs, new[None]))[-256:]

    def forget_samples(self) -> None:
        """Forget the samples, but keep the readings."""
        self.runs = self.runs[:0]

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
        usual = float(np.median(np.diff(keys))) if len(keys) > 1 else 0.0
        # The longest gap, in ns, that is interpolated: ten usual intervals, or five minutes, as a
        # sensor takes several minutes to settle.
        reach = max(10 * usual * self.width, 300e9)
        after = np.clip(np.searchsorted(times, at), 0, len(times) - 1)
        before = np.maximum(after - 1, 0)
        gap = (times[after] - times[before] > reach) & (at > times[0]) & (at < times[-1])
        # A thermometer that comes late has missed the fastest part of a warm-up.
        early = 10 * usual * self.width or reach
        outside = (at < times[0] - early) | (at > times[-1] + reach)
        values[gap | outside] = np.nan
        return np.asarray(values)

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
        of_time = None
        if covered >= COVERED:
            values = np.interp(in_a_row, in_a_row[known], values[known])
            of_time = TemperatureSeries(in_a_row * dt, values, np.flatnonzero(np.diff(runs)) + 1)
        return Temperature(covered, of_time)

    def _stamps(self, runs: Ints, places: Array) -> Array:
        """Return stamps, in ns, of places on the grids of runs; NaN for unknown runs."""
        row = np.clip(np.searchsorted(self.runs[:, 0], runs), 0, len(self.runs) - 1)
        run, first, first_ns, last, last_ns = self.runs[row].T.astype(np.float64)
        slope = (last_ns - first_ns) / np.maximum(last - first, 1)
        return np.where(run == runs, first_ns + (places - 0.5 - first) * slope, np.nan)


def shown(temperature: Temperature | None) -> Signal | None:
    """Return the temperature over time as it is drawn, in degrees Celsius; None if unknown."""
    if temperature is None or temperature.series is None:
        return None
    series = temperature.series
    step_s = float(series.time[-1] + series.time[0]) / SHOWN
    means = np.interp((np.arange(SHOWN) + 0.5) * step_s, series.time, series.celsius)
    values = tuple(means.round(3).tolist())
    return Signal(step_s, values, values, values)
