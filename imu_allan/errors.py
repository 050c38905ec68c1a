# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The exception that imu_allan raises for unusable input, checks of arguments, and text made safe.

An invalid argument is reported in one line, before any work is done.
"""

from numbers import Integral, Real
from typing import Any

SHORTEST_S = 1e-6
"""Shortest time: no IMU samples any faster."""
LONGEST_S = 3.2e9
"""Longest time, a hundred years: added to a present-day stamp, it fits into 64 bits of
nanoseconds."""


class ImuAllanError(ValueError):
    """
    A problem the user can act on.

    The message is one line: it names the file, topic, field or option and says what to do. The
    command prints it on stderr and exits with status 1; any other exception is a bug and keeps its
    traceback.
    """


def error_about(path: object, reason: str) -> ImuAllanError:
    """Return an error about a file, whose path comes first."""
    return ImuAllanError(f'{printable(path)}: {reason}')


def printable(text: object) -> str:
    r"""
    Make text from files (paths, topics, frame_id) safe for one line of a terminal.

    Newlines, escape sequences, lone surrogates and other control characters appear as escapes
    such as ``\n``; printable characters are unchanged.
    """
    return ''.join(
        character if character.isprintable() else character.encode('unicode_escape').decode()
        for character in str(text))


def shorten(text: str, longest: int = 200) -> str:
    """Return `text`, with its middle left out if it is longer than `longest`."""
    if len(text) <= longest:
        return text
    half = (longest - 1) // 2
    return f'{text[:half]}…{text[-half:]}'


def brief(text: str, longest: int = 200) -> str:
    """Return text from a file for one line of a terminal, shortened as by `shorten`."""
    return printable(shorten(text, longest))


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


def whole(name: str, value: Any, least: int = 0) -> int:
    """Return an argument as a whole number, `least` or above."""
    if isinstance(value, bool) or not isinstance(value, Integral) or value < least:
        raise ImuAllanError(f'{name} must be a whole number, {least} or above, not '
                            f'{shorten(printable(repr(value)), 60)}')
    return int(value)


def real(value: Any) -> float | None:
    """Return a number as a float; None for anything else."""
    # True is an integer in Python, but not a time or factor: an argument in the wrong place.
    return None if isinstance(value, bool) or not isinstance(value, Real) else float(value)


def shown(value: Any) -> str:
    """Return an argument as an error quotes it."""
    number = real(value)
    return shorten(printable(repr(value)), 60) if number is None else f'{number:g}'
