# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Checks of arguments: an invalid one is reported in one line, before any work is done."""

from numbers import Real
from typing import Any

from imu_allan.errors import ImuAllanError, printable, shorten
from imu_allan.result import AxisResult, DriftModel

SHORTEST_S = 1e-6
"""Shortest time: no IMU samples any faster."""
LONGEST_S = 3.2e9
"""Longest time, a hundred years: added to a present-day stamp, it fits into 64 bits of
nanoseconds."""


def drift_model_of(axis: AxisResult) -> DriftModel:
    """Return the drift model of an axis; ImuAllanError if it has none."""
    if not isinstance(axis, AxisResult):
        raise TypeError(f"expected an axis of a result, such as result.axes['gyro_x'], not "
                        f'{type(axis).__name__}')
    if axis.drift_model is None:
        raise ImuAllanError('this axis has no drift model (it is constant, too short, or from a '
                            'result of an older version): analyze the recording again')
    return axis.drift_model


def positive_number(name: str, value: Any) -> float:
    """Return an argument as a number above zero whose square neither overflows nor underflows."""
    least = 1e-30   # its square is still far from the limits of a double
    most = 1e30
    return _in_range(name, value, 'positive', (least, most),
                     f'between {least:g} and {most:g}')


def positive_time(name: str, value: Any) -> float:
    """Return an argument as a time in seconds, between a microsecond and a hundred years."""
    return _in_range(name, value, 'a positive time', (SHORTEST_S, LONGEST_S),
                     'between a microsecond and a hundred years', ' s')


def positive_times(name: str, values: Any) -> list[float]:
    """Return an argument, which must be a sequence, as times in seconds."""
    try:
        given = None if isinstance(values, (str, bytes)) else list(values)
    except TypeError:
        given = None
    if given is None:
        raise ImuAllanError(f'{name} must be a sequence of positive times, not {shown(values)}')
    return [positive_time(name, value) for value in given]


def _in_range(name: str, value: Any, positive: str, ends: tuple[float, float], between: str,
              unit: str = '') -> float:
    number = real(value)
    if number is None or not 0 < number < float('inf'):
        raise ImuAllanError(f'{name} must be {positive}, not {shown(value, unit)}')
    if not ends[0] <= number <= ends[1]:
        raise ImuAllanError(f'{name} must be {between}, not {shown(value, unit)}')
    return number


def real(value: Any) -> float | None:
    """Return a number as a float, infinite on overflow; None for anything else."""
    # True is an integer in Python, but not a time or factor: an argument in the wrong place.
    if isinstance(value, bool) or not isinstance(value, Real):
        return None
    try:
        return float(value)
    except OverflowError:
        return float('inf')


def shown(value: Any, unit: str = '') -> str:
    """Return an argument as an error quotes it."""
    number = real(value)
    return shorten(printable(repr(value)), 60) if number is None else f'{number:g}{unit}'
