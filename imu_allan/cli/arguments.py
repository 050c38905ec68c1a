# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Types of command line arguments: what is out of range is wrong usage, told before any work."""

import argparse
import math
import re

_SECONDS = {'': 1.0, 's': 1.0, 'min': 60.0, 'h': 3600.0, 'd': 86_400.0}


def positive_number(text: str) -> float:
    """Read a finite number above zero."""
    value = _number(text)
    if value <= 0:
        raise argparse.ArgumentTypeError(f'{text} is not above zero')
    return value


def duration(text: str) -> float:
    """Read a time above zero, in seconds or with a unit (``90``, ``90s``, ``10min``, ``3h``)."""
    value = moment(text)
    if value <= 0:
        raise argparse.ArgumentTypeError(f'{text} is not above zero')
    return value


def moment(text: str) -> float:
    """Read a time of zero or above, in seconds or with a unit; return seconds."""
    match = re.fullmatch(r'(.*?)\s*(s|min|h|d|)', text.strip())
    assert match is not None
    value = _number(match[1]) * _SECONDS[match[2]]
    if value < 0:
        raise argparse.ArgumentTypeError(f'{text} is below zero')
    return value


def count(text: str) -> int:
    """Read a whole number, one or above."""
    value = whole_number(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f'{text} is below one')
    return value


def whole_number(text: str) -> int:
    """Read a whole number, zero or above."""
    try:
        value = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text!r} is not a whole number') from None
    if value < 0:
        raise argparse.ArgumentTypeError(f'{text} is below zero')
    return value


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text!r} is not a number') from None
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f'{text} is not a finite number')
    return value
