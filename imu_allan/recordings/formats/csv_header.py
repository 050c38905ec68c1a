# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What the columns of a CSV file are, by its header line, in one module as names share marks.

Known are the project's own names (``time_s``, ``gyro_x``), those of EuRoC and TUM-VI
(``#timestamp [ns],w_RS_S_x [rad s^-1]``), of ``rostopic echo -p``
(``%time,field.angular_velocity.x``), of PlotJuggler (``__time,/imu/angular_velocity/x``), of
phyphox (``"Gyroscope x (rad/s)"``), of UZH-FPV (``# timestamp ang_vel_x lin_acc_x``), of bagpy
(``header.stamp.secs,header.stamp.nsecs,angular_velocity.x``), of phones (SensorLog, AndroSensor),
short ones (``t,gx,ay``), and whatever the user names or, where there is no header line, numbers.
Where names say no more than x, y and z, their unit tells the sensor (``X (rad/s)``), or the file's
name does (``Gyroscope.csv``, as Sensor Logger writes it).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
import re

from imu_allan.errors import ImuAllanError, printable
from imu_allan.noise.terms import AXES
from imu_allan.recordings.formats.csv_cells import cells_of, is_number
from imu_allan.recordings.formats.csv_guesses import guessed_axes
from imu_allan.recordings.formats.csv_names import (
    is_better_clock,
    is_rest_of_imu,
    is_stamp,
    is_temperature,
    lookalikes,
    may_stand_beside,
    meaning_of,
    name_and_unit,
    numbered_axes,
    split_seconds,
    stamp_of_axes,
    unit_in_name,
    WORDS,
)
from imu_allan.recordings.options import M_PER_S2, RAD_PER_S, RecordingOptions

EXAMPLE = 'time_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z'
"""A first line that needs no option."""
_COMMENT = ('#', '%', '//')
MOST_COMMENTS = 100
"""Lines before the header line; loggers write some five about device and settings."""
_LOOKED_AT = 1 << 14
"""Characters of a comment in which names of axes are sought: a hundred such lines take seconds."""
_SHOWN = 80
"""Characters of a line that no name was found in."""
_WRITTEN_UNIT = re.compile(r'te?xt|text|iso.*|utc.*|gmt.*|local.*|[+-]\d\d:?\d\d|[yhd]+\W.*',
                           re.IGNORECASE)
"""What stands in the place of a unit where times are written out."""


@dataclass(frozen=True)
class Columns:
    """
    What the columns of the file are.

    Attributes
    ----------
    delimiter : str or None
        What stands between them; None for blanks.
    time : int or None
        Number of the time column.
    time_unit : str or None
        Its unit; None where the numbers themselves must tell.
    nanoseconds : int or None
        Number of a column of nanoseconds to be added to it.
    temperature : int or None
        Number of a column with the temperature.
    headless : bool
        Whether the line that was read holds no names, but the first sample.
    lookalikes : tuple of str
        Those of `ignored` that look like the axes of a sensor that was not found.
    axes : tuple of (int, int, float)
        Column of the file, column of the samples, factor to SI units.
    by_file_name : str or None
        'gyro' or 'accel', where nothing but the name of the file tells the sensor.
    written : bool
        Whether times are dates, or times of day.
    stamped : bool
        Whether the times are the stamps of the messages, beside others.
    ignored : tuple of str
        Names of the others.

    """

    delimiter: str | None
    time: int | None
    time_unit: str | None
    axes: tuple[tuple[int, int, float], ...]
    ignored: tuple[str, ...] = ()
    nanoseconds: int | None = None
    temperature: int | None = None
    headless: bool = False
    lookalikes: tuple[str, ...] = ()
    by_file_name: str | None = None
    written: bool = False
    stamped: bool = False

    @property
    def used(self) -> list[int]:
        """Columns of the file that are read: those of the time, if any, then axes."""
        time = [column for column in (self.time, self.nanoseconds) if column is not None]
        return time + [column for column, _, _ in self.axes]


def read_header(header: str, options: RecordingOptions, file_name: str = '', split: bool = True,
                stamped: bool = True) -> Columns:
    """
    Understand the header line of a file.

    Parameters
    ----------
    header : str
        The line.
    options : RecordingOptions
        With the columns that the user names.
    file_name : str, optional
        Which may tell the sensor where the line does not.
    split : bool, optional
        Whether columns of seconds and nanoseconds may be the two parts of a time.
    stamped : bool, optional
        Whether a column with the stamp of the messages may be preferred to other times.

    Raises
    ------
    ImuAllanError
        If it names no axis, names one twice, or a unit is wrong.

    """
    delimiter, cells = cells_of(header)
    headless = _is_headless(cells)
    # Without a header line a number is the place of a column, whatever stands in it.
    names = [''] * len(cells) if headless else [cell.strip(' "') for cell in cells]
    chosen = _chosen(options.columns, names)
    if headless and not chosen:
        raise ImuAllanError(_no_header(cells))
    by_name = all(meaning == 'time' for meaning, _ in chosen.values())
    time: int | None = None
    time_name, time_unit = '', None
    axes: dict[str, tuple[int, int, float]] = {}
    others: list[int] = []
    temperature: int | None = None
    plain = [name_and_unit(cell) for cell in cells]
    counted = numbered_axes([name for name, _ in plain])
    parts = (split_seconds([name for name, _ in plain])
             if split and not (headless or chosen) else None)
    own_stamp = stamp_of_axes([name for name, _ in plain]) if stamped else None
    clocks = sum(meaning_of(name) == 'time' for name, _ in plain)
    for column, (name, unit) in enumerate(plain):
        meaning, stated = chosen.get(column, (None, None))
        unit = stated or unit
        if by_name and meaning is None and not headless:
            meaning = counted.get(name) or meaning_of(name)
            # The user has named another, or two columns say it to the nanosecond.
            meaning = None if (chosen or parts) and meaning == 'time' else meaning
            # The stamp of another message is no time of these samples, unless there is no other.
            meaning = None if is_stamp(name) and column != own_stamp and clocks > 1 else meaning
        if meaning == 'time':
            has_own = own_stamp is not None and time == own_stamp
            if not (time is None or column == own_stamp or has_own
                    or may_stand_beside(time_name, name)):
                raise ImuAllanError('two time columns')
            if time is None or column == own_stamp or (
                    not has_own and is_better_clock(time_name, name)):
                time, time_name, time_unit = column, name, _time_unit(name, unit)
        elif meaning in AXES:
            if meaning in axes:
                raise ImuAllanError(f'two columns named {meaning}')
            axes[meaning] = column, list(AXES).index(meaning), _factor(
                name, unit, meaning, options)
        elif name and is_temperature(
                [str(column + 1)] if headless else [name, names[column]], options.temperature,
                temperature is not None):
            temperature = column
        elif parts is None or column not in parts:
            others.append(column)
    by_file_name = None
    if by_name and not headless:
        known = {axis.partition('_')[0] for axis in axes}
        guessed, by_file_name = guessed_axes(plain, others, known, file_name)
        axes |= {axis: (column, list(AXES).index(axis),
                        _factor('', plain[column][1], axis, options))
                 for axis, column in guessed.items()}
    taken = {column for column, _, _ in axes.values()}
    ignored = [cells[column].strip() for column in others if column not in taken]
    if not axes:
        shown = ','.join(cell.strip() for cell in cells)[:_SHOWN]
        raise ImuAllanError(
            f'the first line names none of the axes {", ".join(AXES)} ({printable(shown)}); a CSV '
            f'recording begins with a line such as {EXAMPLE}, and --columns '
            'gyro_x=NAME,accel_z=NAME,time=NAME tells what others are, by name or number from 1')
    if headless:
        ignored = []
    if parts is not None:
        time, time_unit = parts[0], 's'
    missing = any(all(not axis.startswith(sensor) for axis in axes) for sensor in WORDS)
    return Columns(delimiter, time, time_unit, tuple(axes.values()), tuple(ignored),
                   parts[1] if parts is not None else None, temperature, headless,
                   tuple(lookalikes([cell for cell in ignored if not is_rest_of_imu(cell)]))
                   if missing and not chosen else (), by_file_name,
                   stamped=own_stamp is not None and time == own_stamp)


def is_remark(line: str, options: RecordingOptions) -> bool:
    """Whether a line is empty or a comment, and not a header that begins like one."""
    if not line.lstrip().startswith(_COMMENT):
        return line.isspace()
    cells = cells_of(line[:_LOOKED_AT])[1]
    names = [cell.strip(' "') for cell in cells]
    return not (any(meaning_of(name_and_unit(cell)[0]) in AXES for cell in cells)
                or any(_with_name(name, names) for _, text in options.columns
                       for name in (text, text.rpartition(' ')[0])))


def with_units_below(header: str, line: str, columns: Columns, options: RecordingOptions,
                     ) -> tuple[str, Columns] | None:
    """Understand a header whose units stand in a line of their own; None if they do not."""
    delimiter, names = cells_of(header)
    units = cells_of(line)[1]
    if (columns.headless or delimiter is None or len(names) != len(units)
            or any(map(is_number, units))):
        return None
    bare = [unit.strip(' "[]()\r-') for unit in units]
    of_axes = [bare[axis[0]] for axis in columns.axes]
    if not any(of_axes) or any(unit and unit in names[axis[0]]
                               for unit, axis in zip(of_axes, columns.axes, strict=True)):
        # Nothing, or the names once more.
        return None
    plain = [name.strip(' "') for name in names]
    joined = delimiter.join(
        f'{name} [{unit}]' if unit and not set(name) & set('[(') else name
        for name, unit in zip(plain, bare, strict=True))
    try:
        return joined, read_header(joined, options)
    except ImuAllanError:
        if any('/' in unit for unit in of_axes):
            raise
        # Any other text.
        return None


def _is_headless(cells: Sequence[str]) -> bool:
    """Whether a line holds numbers where the names should be."""
    return any(map(is_number, cells)) and not any(
        meaning_of(name_and_unit(cell)[0]) for cell in cells)


def _no_header(cells: Sequence[str]) -> str:
    names = [*(['time'] if len(cells) > len(AXES) else []), *AXES][:len(cells)]
    example = ','.join(f'{name}={number}' for number, name in enumerate(names, 1))
    return (f'no line names its columns, the first one holds numbers ({len(cells)} columns); tell '
            f'what they are, such as --columns {example} if that is their order, with units as in '
            "'time=1 us,gyro_x=2 deg/s', or write a first line "
            f'such as {EXAMPLE}')


def echoed_imu(line: str) -> Columns | None:
    """
    Recognise what ``ros2 topic echo --csv`` prints of a sensor_msgs/Imu, without a header line.

    These are sec, nanosec, frame_id, orientation (4), covariance (9), angular velocity (3),
    covariance (9), linear acceleration (3), covariance (9).
    """
    cells = line.rstrip('\r\n').split(',')
    if len(cells) != 40 or not (cells[0].lstrip('-').isdecimal() and cells[1].isdecimal()):
        return None
    return Columns(',', 0, 's', tuple(
        (16 + axis if axis < 3 else 25 + axis, axis, 1.0) for axis in range(6)), (), 1,
        headless=True)


def _chosen(pairs: Sequence[tuple[str, str]], names: Sequence[str],
            ) -> Mapping[int, tuple[str, str | None]]:
    """Map the columns that the user names, or numbers from 1, to their meaning and unit."""
    found: dict[int, tuple[str, str | None]] = {}
    for meaning, text in pairs:
        if meaning not in AXES and meaning != 'time':
            raise ImuAllanError(f'--columns {printable(meaning)}: not time or one of '
                                f'{", ".join(AXES)}')
        columns, unit = _columns_named(text, names), None
        if not columns and ' ' in text:
            name, _, unit = text.rpartition(' ')
            columns = _columns_named(name.strip(), names)
        if not columns:
            shown = ', '.join(printable(name[:40]) for name in names[:20] if name)
            raise ImuAllanError(f'--columns: no column {printable(text)}; there are '
                                f'{shown or f"those from 1 to {len(names)}"}')
        if found.keys() & columns:
            raise ImuAllanError(f'--columns: column {printable(text)} is named twice')
        found.update(dict.fromkeys(columns, (meaning, unit)))
    return found


def _columns_named(name: str, names: Sequence[str]) -> list[int]:
    columns = _with_name(name, names)
    if not columns and name.isdecimal() and len(name) < 7 and 1 <= int(name) <= len(names):
        return [int(name) - 1]
    return columns


def _with_name(name: str, names: Sequence[str]) -> list[int]:
    """Find the columns of a name, with or without a unit behind it."""
    # The mark of a comment is none of the first name.
    name = name.lstrip('# ')
    return [column for column, each in enumerate(names)
            if name and (each == name or each.startswith((f'{name} [', f'{name} (')))]


def _time_unit(name: str, unit: str | None) -> str | None:
    if unit is not None and _WRITTEN_UNIT.fullmatch(unit.strip()) is None:
        _converted(name, unit.strip(), 's')
        return unit.strip()
    return unit_in_name(name)


def _factor(name: str, unit: str | None, axis: str, options: RecordingOptions) -> float:
    unit = unit or unit_in_name(name)
    if unit is None:
        return options.factors[0 if axis.startswith('gyro') else 1]
    # EuRoC writes rad s^-1, others m/s2, and phones G.
    spelled = re.sub(r'(?<=\w)\s+(?=\w)', '*', unit.strip())
    spelled = re.sub(r'(?<=s)(?=-?2$)', '^', spelled)
    if spelled == 'G' and axis.startswith('accel'):
        spelled = 'g'
    return _converted(name, spelled, RAD_PER_S if axis.startswith('gyro') else M_PER_S2)


def _converted(name: str, unit: str, si_unit: str) -> float:
    if unit == si_unit:
        return 1.0
    from imu_allan.sensor.units import convert
    try:
        return convert(1.0, unit, si_unit)
    except ImuAllanError as error:
        raise ImuAllanError(f'column {printable(name)}: {printable(error)}') from error
