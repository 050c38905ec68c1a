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


def positive(name: str, value: Any, least: float = 1e-30, most: float = 1e30) -> float:
    """Return an argument as a positive number whose square neither overflows nor underflows."""
    number = real(value)
    if number is None or not least <= number <= most:
        raise ImuAllanError(f'{name} must be a number from {least:g} to {most:g}, '
                            f'not {shown(value)}')
    return number


def positive_time(name: str, value: Any) -> float:
    """Return an argument as a time in seconds."""
    return positive(name, value, SHORTEST_S, LONGEST_S)


def real(value: Any) -> float | None:
    """Return a number as a float; None for anything else."""
    # True is an integer in Python, but not a time or factor: an argument in the wrong place.
    return None if isinstance(value, bool) or not isinstance(value, Real) else float(value)


def shown(value: Any) -> str:
    """Return an argument as an error quotes it."""
    number = real(value)
    return shorten(printable(repr(value)), 60) if number is None else f'{number:g}'
