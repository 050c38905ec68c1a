# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Numbers from a caller: one that makes no sense is reported in one line, before any work."""

from numbers import Real
from typing import Any

from imu_allan.errors import ImuAllanError, printable, shorten

SHORTEST_S = 1e-6
"""Of a time: no IMU has a sample in less."""
LONGEST_S = 3.2e9
"""A hundred years: with any stamp of today it still fits into 64 bits of nanoseconds."""
_LEAST, _MOST = 1e-30, 1e30
"""Of any other number: its square is still far from the ends of a double."""


def positive_number(name: str, value: Any) -> float:
    """
    Return an argument as a number above zero.

    Parameters
    ----------
    name : str
        Of the argument, for the message.
    value : object
        What the caller gave.

    Raises
    ------
    ImuAllanError
        If it is no number, not above zero, or beyond what can be squared.

    """
    number = _real(value)
    if number is None or not 0 < number < float('inf'):
        raise ImuAllanError(f'{name} must be above zero, not {_shown(value)}')
    if not _LEAST <= number <= _MOST:
        raise ImuAllanError(f'{name} must be between {_LEAST:g} and {_MOST:g}, '
                            f'not {_shown(value)}')
    return number


def positive_time(name: str, value: Any) -> float:
    """
    Return an argument as a time in seconds.

    Parameters
    ----------
    name : str
        Of the argument, for the message.
    value : object
        What the caller gave.

    Raises
    ------
    ImuAllanError
        If it is no number, or no time between a microsecond and a hundred years.

    """
    number = _real(value)
    if number is None or not 0 < number < float('inf'):
        raise ImuAllanError(f'{name} must be a positive time, not {_shown(value, " s")}')
    if not SHORTEST_S <= number <= LONGEST_S:
        raise ImuAllanError(f'{name} must be between a microsecond and a hundred years, not '
                            f'{_shown(value, " s")}')
    return number


def positive_times(name: str, values: Any) -> list[float]:
    """
    Return an argument as times in seconds.

    Parameters
    ----------
    name : str
        Of the argument, for the message.
    values : object
        What the caller gave: a sequence is wanted.

    Raises
    ------
    ImuAllanError
        If it is no sequence, or holds what is no time.

    """
    try:
        given = None if isinstance(values, (str, bytes)) else list(values)
    except TypeError:
        given = None
    if given is None:
        raise ImuAllanError(f'{name} must be a sequence of positive times, not {_shown(values)}')
    return [positive_time(name, value) for value in given]


def _real(value: Any) -> float | None:
    """Return a number as a float, infinite where it is beyond one; None for what is none."""
    # True is an integer to Python, but no time and no factor: an argument in the wrong place.
    if isinstance(value, bool) or not isinstance(value, Real):
        return None
    try:
        return float(value)
    except OverflowError:
        return float('inf')


def _shown(value: Any, unit: str = '') -> str:
    number = _real(value)
    return shorten(printable(repr(value)), 60) if number is None else f'{number:g}{unit}'
