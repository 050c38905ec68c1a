# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Temperature over a record, as measured or with a lag between thermometer and sensor."""

from dataclasses import dataclass, field

from imu_allan.arrays import Array, Ints
from imu_allan.noise.trends.leakage import Waveform
import numpy as np


@dataclass(frozen=True)
class TemperatureSeries:
    """Temperature over a record."""

    time: Array    # (n,): seconds from the beginning, with runs joined end to end
    celsius: Array    # (n,)
    # First reading of each run but the first: between runs, any time may have passed.
    begins: Ints = field(default_factory=lambda: np.zeros(0, np.int64))

    @property
    def lowest(self) -> float:
        """Lowest temperature, in degrees Celsius."""
        return float(self.celsius.min())

    @property
    def highest(self) -> float:
        """Highest temperature, in degrees Celsius."""
        return float(self.celsius.max())

    @property
    def trend(self) -> Waveform:
        """Return the temperature about its mean, in kelvin."""
        about = self.celsius - self.celsius.mean()
        return lambda time: np.asarray(np.interp(time, self.time, about))

    @property
    def duration_s(self) -> float:
        """Seconds from the first to the last reading."""
        return float(self.time[-1] - self.time[0])

    def of_sensor(self, lag_s: float) -> 'TemperatureSeries':
        """
        Return the temperature of the sensor, given the lag of the thermometer behind it.

        `lag_s`: time constant of a first-order lag in seconds; negative if the sensor lags behind
        the thermometer.
        """
        if lag_s == 0 or self.duration_s <= 0:
            return self
        time = np.linspace(self.time[0], self.time[-1], max(len(self.time), 3))
        step = float(time[1] - time[0])
        # A jump between runs is none for the sensor, which changed meanwhile like the thermometer.
        jumps = np.zeros(len(self.time))
        jumps[self.begins] = self.celsius[self.begins] - self.celsius[self.begins - 1]
        jumps = np.cumsum(jumps)
        celsius = np.interp(time, self.time, self.celsius - jumps)
        sensor = _ahead(celsius, lag_s, step) if lag_s > 0 else _behind(celsius, -lag_s, step)
        return TemperatureSeries(
            time, sensor + jumps[np.searchsorted(self.time, time, 'right') - 1])


def _ahead(celsius: Array, lag_s: float, step: float) -> Array:
    """Undo a first-order lag, from the temperature and its slope, both smoothed."""
    # Readings in steps have no useful slope, so smooth over a quarter of the lag on either side.
    # An additional lag of that length would not matter.
    count = min(max(round(lag_s / 4 / step), 1), len(celsius) - 1)
    # Continue the slopes beyond both ends.
    total = np.concatenate(([0.0], np.cumsum(
        np.pad(celsius, count, mode='reflect', reflect_type='odd'))))
    at = np.arange(len(celsius)) + count
    before = (total[at] - total[at - count]) / count
    after = (total[at + 1 + count] - total[at + 1]) / count
    return np.asarray((before + after) / 2 + lag_s * (after - before) / ((count + 1) * step))


def _behind(celsius: Array, lag_s: float, step: float) -> Array:
    """Apply a first-order lag, with a constant temperature before the first reading."""
    from scipy.signal import lfilter  # seldom needed, and slow to import

    kept = float(np.exp(-step / lag_s))
    middle = np.concatenate((celsius[:1], (celsius[1:] + celsius[:-1]) / 2))
    return np.asarray(lfilter([1 - kept], [1, -kept], middle, zi=[kept * celsius[0]])[0])
