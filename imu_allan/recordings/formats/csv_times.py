# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The unit of the times of a CSV file, where nobody has stated it: by their size and rate."""

from imu_allan.sensor.units import convert
import numpy as np
from numpy.typing import NDArray

_MAGNITUDES = ((1e17, 'ns'), (1e14, 'us'), (1e11, 'ms'))
"""From which number on a time is in a unit, if it is one of this century: 1e9 is 2001 in s."""
_FEWEST_STEPS = 8
"""Below, a table is no record of anything."""
_SLOWEST_HZ, _FASTEST_HZ = 5.0, 20_000.0
"""Rates of IMUs; beyond, times without a unit are in another one than they seem to be."""


def seconds_in(unit: str | None, first: float) -> float:
    """Return how many seconds a unit of time is; the first number tells where it is None."""
    return convert(1.0, _apparent_unit(first) if unit is None else unit, 's')


def interval_of_no_imu(times: NDArray[np.float64]) -> tuple[float, str, float] | None:
    """
    Judge the first times of a file, whose unit nobody stated.

    Returns
    -------
    interval, unit, rate_hz : float, str, float
        By how much they advance, in which unit that would be by their size, and the rate then;
        None if that is an IMU's.

    """
    times = times[np.isfinite(times)]
    # A clock that is set back says nothing of the rate.
    steps = np.sort([step for step in np.diff(times) if step >= 0])
    if len(steps) < _FEWEST_STEPS:
        return None
    unit = _apparent_unit(float(times[0]))
    # Samples of a batch may be a microsecond apart, and one outage makes no sensor slow.
    for interval, least_hz, most_hz in ((float(steps.mean()), 0.0, _FASTEST_HZ),
                                        (float(steps[:-1].mean()), _SLOWEST_HZ, np.inf)):
        if interval > 0:
            rate_hz = 1 / (interval * seconds_in(unit, 0.0))
            if not least_hz <= rate_hz <= most_hz:
                return interval, unit, rate_hz
    return None


def _apparent_unit(first: float) -> str:
    return next((unit for least, unit in _MAGNITUDES if abs(first) >= least), 's')
