# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What the name of a column of a table says: which axis it is, the time, or the temperature."""

from collections.abc import Iterator, Mapping, Sequence
import re

_COLUMN = re.compile(
    r'"? ?([^"\[(]+?(?:\[[0-2]\])?) ?(?:\[([^\]]*)\]|\(([^)]*)\))? ?"?')
_LONGEST_CELL = 200
"""Characters of a column name."""
WORDS = {
    'gyro': r'angular_?(?:velocity|rate|speed)|ang_?(?:vel|rate)|rot(?:ation)?_?rate'
            r'|gyroscope|gyro_?rotation|gyro|gyr|w_rs_s|omega',
    'accel': r'linear_?acceleration|total_?acceleration|lin_?acc|accelerometer_?acceleration'
             r'|acceleration|accelerometer|accel|acc|a_rs_s'}
_OF = r'(?:.*[/.])?(?:(?:imu|sensor)\d*[._/])?'
"""What may stand before a name: the path to it, or whose it is."""
_LONG = {sensor: re.compile(rf'{_OF}(?:(?:{words})[/._-]?(?:(?P<axis>[xyz])|\[(?P<number>[0-2])\])'
                            rf'|(?P<first>[xyz])[._-](?:{words}))')
         for sensor, words in WORDS.items()}
_SHORT = re.compile(r'(?:(?:.*[/.])?imu\d*[._/])?([gwa])[_]?([xyz])')
_NUMBERED = {sensor: re.compile(rf'({_OF}(?:{words})_?)([0-3])')
             for sensor, words in WORDS.items()}
_UNITS = {
    'deg/s': r'dps|deg_?s|deg_?per_?s(?:ec)?', 'rad/s': r'rad_?s|rad_?per_?s(?:ec)?',
    'm/s^2': r'm_?ss|mp?s2|m_s\^?2|m_per_s2', 'mdeg/s': r'mdps', 'g': r'g', 'mg': r'mg'}
_UNIT_BEHIND = re.compile('(.*[xyz])_(?:' + '|'.join(
    f'(?P<u{number}>{form})' for number, form in enumerate(_UNITS.values())) + ')')
"""A unit at the end of a name, as in ``gx_dps``."""
_CLOCKS = tuple(re.compile(form) for form in (
    r'(?:[#%_]*(?:time|time_?stamp|stamp|t)(?:_(s|ms|us|ns))?|(?:.*[/.])?header[./]stamp)',
    r'(?:accelerometer|gyro)?timestamp_sincereboot',
    r'(?:seconds|time)_(?:elapsed|since_start)(?:_in)?(?:_(s|ms|us|ns))?'
    r'|elapsed(?:_time)?(?:_(s|ms|us|ns))?',
    r'(?:date|unix|utc|local|system|device)_?(?:time|stamp)(?:_?stamp)?(?:_(s|ms|us|ns))?'
    r'|time_?stamp_?(?:utc|local)|utc|epoch?(?:_(s|ms|us|ns))?',
    r'logging_?time'))
"""
Names of times, the best first: of the sensor, since the beginning of the log, of the day, and
last what an application notes when it writes a line.
"""
_STAMP = re.compile(r'((?:.*[/.])?)header[./]stamp')
_REST_OF_IMU = re.compile(
    r'(?:.*[/.])?(?:header[./].*|orientation(?:[._/].*)?|'
    r'(?:orientation|angular_velocity|linear_acceleration)_covariance.*)')
_LETTER = re.compile(r'(.*?)[._-]?([xyz])([._-]?axis)?')
_SECONDS = re.compile(r'((?:.*[/._])?)(?:secs?|seconds)')
_PARTS_OF_SECONDS = re.compile(r'((?:.*[/._])?)(?:nano_?secs?|nano_?seconds|nsecs?)')
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
    >>> [meaning_of(name) for name in ('x_gyro', 'gy_dps', 'imu.wz', 'datetime')]
    ['gyro_x', 'gyro_y', 'gyro_z', 'time']

    """
    lower = name.lower()
    if clock_rank(lower) is not None:
        return 'time'
    if (with_unit := _UNIT_BEHIND.fullmatch(lower)) is not None:
        lower = with_unit[1]
    if (short := _SHORT.fullmatch(lower)) is not None:
        return f'{"accel" if short[1] == "a" else "gyro"}_{short[2]}'
    for sensor, pattern in _LONG.items():
        if (match := pattern.fullmatch(lower)) is not None:
            axis = match['axis'] or match['first'] or 'xyz'[int(match['number'])]
            return f'{sensor}_{axis}'
    return None


def numbered_axes(names: Sequence[str]) -> Mapping[str, str]:
    """
    Tell which axis each column is of three that are counted, from 0 or from 1.

    Examples
    --------
    >>> numbered_axes(['t', 'gyro1', 'gyro2', 'gyro3'])
    {'gyro1': 'gyro_x', 'gyro2': 'gyro_y', 'gyro3': 'gyro_z'}

    """
    found: dict[str, str] = {}
    for sensor, pattern in _NUMBERED.items():
        of: dict[str, dict[int, str]] = {}
        for name in names:
            if (match := pattern.fullmatch(name.lower())) is not None:
                of.setdefault(match[1], {})[int(match[2])] = name
        for columns in of.values():
            if sorted(columns) in ([0, 1, 2], [1, 2, 3]):
                found |= {name: f'{sensor}_{"xyz"[number - min(columns)]}'
                          for number, name in columns.items()}
    return found


def split_seconds(names: Sequence[str]) -> tuple[int, int] | None:
    """
    Find a column of whole seconds and that of the nanoseconds that belong to them.

    Examples
    --------
    >>> split_seconds(['Time', 'header.stamp.secs', 'header.stamp.nsecs', 'linear_acceleration.x'])
    (1, 2)

    """
    parts = {match[1]: column for column, name in enumerate(names)
             if (match := _PARTS_OF_SECONDS.fullmatch(name.lower())) is not None}
    return next(((column, parts[match[1]]) for column, name in enumerate(names)
                 if (match := _SECONDS.fullmatch(name.lower())) is not None
                 and match[1] in parts), None)


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


def unit_in_name(name: str) -> str | None:
    """Tell the unit that the name of a column has, as in ``time_ms`` and ``gx_dps``."""
    lower = name.lower()
    if lower in _NANOSECONDS:
        return 'ns'
    for form in _CLOCKS:
        if (match := form.fullmatch(lower)) is not None:
            return next((unit for unit in match.groups() if unit), None)
    if (match := _UNIT_BEHIND.fullmatch(lower)) is not None:
        return next(unit for number, unit in enumerate(_UNITS) if match[f'u{number}'])
    return None


def clock_rank(name: str) -> int | None:
    """Tell how good a name of a time is: 0 for the best, None for none."""
    lower = name.lower()
    return next((rank for rank, form in enumerate(_CLOCKS) if form.fullmatch(lower)), None)


def stamp_of_axes(names: Sequence[str]) -> int | None:
    """
    Find the column of the header's stamp in the message of which the first axis is a field.

    Examples
    --------
    >>> stamp_of_axes(['__time', '/cam/header/stamp', '/imu/header/stamp',
    ...                '/imu/angular_velocity/x'])
    2

    """
    axis = next((name.lower() for name in names if meaning_of(name) not in (None, 'time')), '')
    stamps = {match[1]: column for column, name in enumerate(names)
              if (match := _STAMP.fullmatch(name.lower())) and axis.startswith(match[1])}
    return stamps[max(stamps, key=len)] if stamps else None


def is_stamp(name: str) -> bool:
    """Whether a column is the header's stamp of some message."""
    return _STAMP.fullmatch(name.lower()) is not None


def is_rest_of_imu(cell: str) -> bool:
    """Whether a column is another field of an Imu: its header, orientation or a covariance."""
    return _REST_OF_IMU.fullmatch(name_and_unit(cell)[0].lower()) is not None


def is_better_clock(before: str, name: str) -> bool:
    """Whether a second time column is better than the first."""
    first, second = clock_rank(before), clock_rank(name)
    return first is not None and second is not None and second < first


def may_stand_beside(before: str, name: str) -> bool:
    """Whether a second time column may stand beside the first."""
    first, second = clock_rank(before), clock_rank(name)
    return first is not None and second is not None and (first != second or first > 0)


def lookalikes(ignored: Sequence[str]) -> Iterator[str]:
    """Name the columns of three that differ in a last x, y or z alone."""
    for columns in triples([name_and_unit(cell)[0] for cell in ignored]).values():
        yield from (ignored[column] for column in columns)


def triples(names: Sequence[str]) -> Mapping[str, tuple[int, int, int]]:
    """
    Find columns whose names differ in an x, y and z alone, at the end or before ``axis``.

    Parameters
    ----------
    names : sequence of str
        Of all columns.

    Returns
    -------
    mapping of str to (int, int, int)
        The columns of x, y and z by the rest of their names.

    Examples
    --------
    >>> triples(['time', 'z', 'y', 'x', 'mag_x', 'mag_y'])
    {'': (3, 2, 1)}

    """
    found: dict[str, dict[str, int]] = {}
    for column, name in enumerate(names):
        if (match := _LETTER.fullmatch(name.lower())) is not None:
            rest = match[1] + (match[3] or '')
            found.setdefault(rest, {}).setdefault(match[2], column)
    return {rest: (at['x'], at['y'], at['z']) for rest, at in found.items() if len(at) == 3}
