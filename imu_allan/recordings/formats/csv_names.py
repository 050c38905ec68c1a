# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What the name of a column of a table says: which axis it is, the time, or the temperature."""

from collections.abc import Iterator, Sequence
import re

_COLUMN = re.compile(
    r'"? ?([^"\[(]+?(?:\[[0-2]\])?) ?(?:\[([^\]]*)\]|\(([^)]*)\))? ?"?')
_LONGEST_CELL = 200
"""Characters of a column name."""
WORDS = {
    'gyro': r'angular_?velocity|ang_?vel|gyroscope|gyro|gyr|w_rs_s|omega',
    'accel': r'linear_?acceleration|lin_?acc|acceleration|accelerometer|accel|acc|a_rs_s'}
_LONG = {sensor: re.compile(rf'(?:.*[/.])?(?:{words})[/._]?(?:([xyz])|\[([0-2])\])')
         for sensor, words in WORDS.items()}
_SHORT = re.compile(r'([gwa])[_]?([xyz])')
_TIME = re.compile(
    r'[#%_]*(?:time|timestamp|stamp|t)(?:_(s|ms|us|ns))?|(?:.*[/.])?header[./]stamp')
_NANOSECONDS = ('%time', 'field.header.stamp')
"""Columns that are nanoseconds without saying so."""
_TEMPERATURE = re.compile(r'(?:.*[/.])?(?:imu_|gyro_|sensor_)?temp(?:erature)?(?:_(?:deg)?c)?')


def meaning_of(name: str) -> str | None:
    """
    Tell what a column of this name is: ``'time'``, one of the axes, or None.

    Examples
    --------
    >>> [meaning_of(name) for name in ('w_RS_S_x', '/imu/linear_acceleration/z', 'ax', 'mag_x')]
    ['gyro_x', 'accel_z', 'accel_x', None]

    """
    lower = name.lower()
    if _TIME.fullmatch(lower):
        return 'time'
    if (short := _SHORT.fullmatch(lower)) is not None:
        return f'{"accel" if short[1] == "a" else "gyro"}_{short[2]}'
    for sensor, pattern in _LONG.items():
        if (match := pattern.fullmatch(lower)) is not None:
            return f'{sensor}_{match[1] or "xyz"[int(match[2])]}'
    return None


def name_and_unit(cell: str) -> tuple[str, str | None]:
    """Take a cell apart; blanks in a name count as underscores."""
    # Runs of blanks are what an expression goes through over and over.
    plain = ' '.join(cell.split()) if len(cell) <= _LONGEST_CELL else ''
    match = _COLUMN.fullmatch(plain)
    if match is None:
        return '', None
    return match[1].strip().replace(' ', '_'), match[2] if match[2] is not None else match[3]


def is_temperature(names: Sequence[str], wanted: str | None, found: bool) -> bool:
    """Whether a column of these names is the one asked for, or else the first called so."""
    if wanted is not None:
        return wanted in names
    return not found and _TEMPERATURE.fullmatch(names[0].lower()) is not None


def is_better_clock(before: str, name: str) -> bool:
    """Whether a second time column is the header's stamp beside that of the recorder."""
    return before.startswith('%') and name.endswith('stamp')


def unit_in_name(name: str) -> str | None:
    """Tell the unit that the name of a column of times has, as in ``time_ms``."""
    lower = name.lower()
    if lower in _NANOSECONDS:
        return 'ns'
    match = _TIME.fullmatch(lower)
    return match[1] if match is not None else None


def is_later_clock(before: str, name: str) -> bool:
    """Whether a second time column may stand beside the first."""
    return is_better_clock(before, name) or before.endswith('header.stamp')


def lookalikes(ignored: Sequence[str]) -> Iterator[str]:
    """Name the columns of three that differ in a last x, y or z alone."""
    names = [name_and_unit(cell)[0] for cell in ignored]
    known = {*names}
    for name, cell in zip(names, ignored, strict=True):
        if name[-1:] in ('x', 'y', 'z') and {f'{name[:-1]}{axis}' for axis in 'xyz'} <= known:
            yield cell
