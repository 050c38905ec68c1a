# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Meaning of the columns of a CSV file, as given by the user or inferred from their names.

Recognized are the names of this project (``time_s``, ``gyro_x``), of EuRoC and TUM-VI
(``#timestamp [ns],w_RS_S_x [rad s^-1]``), ``rostopic echo -p`` (``field.angular_velocity.x``),
UZH-FPV (``# timestamp ang_vel_x lin_acc_x``), PlotJuggler (``__time,/imu/angular_velocity/x``),
phyphox (``"Gyroscope x (rad/s)"``), bagpy (``header.stamp.secs,header.stamp.nsecs``), phone apps
(SensorLog, AndroSensor, Physics Toolbox), Shimmer, VectorNav, Xsens and short names (``t,gx,ay``).
Words for time and sensors may be German, Spanish, French, Italian or Portuguese.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
import re

from imu_allan.errors import ImuAllanError, printable
from imu_allan.noise.terms import AXES
from imu_allan.recordings.options import M_PER_S2, RAD_PER_S, RecordingOptions
from imu_allan.sensor.units import convert

EXAMPLE = 'time_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z'
"""A header line that needs no option."""
QUOTES = ' \t\r\n"'
"""Characters that may surround the text of a cell."""

# Before the words may stand the path to a name, or the device it belongs to.
_AXES = [(sensor, choice, re.compile(
    r'(?:.*[/.])?(?:(?:imu|sensor|(?:lsm|ism|bm[ix]|bno|mpu|icm|iim|adis)\w*?)\d*[._/])?'
    rf'(?:(?:{words})[/._-]{{0,2}}(?:(?P<axis>[xyz])|\[(?P<number>[0-2])\])'
    rf'|(?P<first>[xyz])[._-](?:{words}))'))
    for sensor, choice, words in (
        ('gyro', 0, r'angular_?(?:velocity|rate|speed)|ang_?(?:vel|rate)|rot(?:ation)?_?rate'
                    r'|g[iy]ros[ck][oó]p(?:e|io)?|gyro_?rotation|gyro_rad|gyro|gyr|w_rs_s|omega'
                    r'|drehrate|winkelgeschwindigkeit'),
        ('accel', 0, r'(?:total_?|accelerometer_?)?ac?c[eé]l[eé]r(?:a[czt]i[oó]ne?|a[cç][aã]o)'
                     r'|ac?c[eé]l[eé]r[oóô]m[eéè]t(?:er|r[eo])|accelerometer_m_s2|acc?e?l|acc'
                     r'|a_rs_s|g_?f(?:orce)?|accel_ln|beschleunigung'),
        # These are taken if no column has one of the above: gravity may be removed, or noise
        # higher.
        ('gyro', 1, r'un_?comp_?(?:ang_?rate|gyro)'),
        ('accel', 1, r'lin(?:ear)?_?acc(?:el(?:eration)?)?|un_?comp_?acc(?:el)?|accel_wr'))]
"""Words that name the axes of a sensor, with 0 for those preferred."""
_UNITS = {
    'deg/s': r'dps|deg_?s|deg_?per_?s(?:ec)?', 'rad/s': r'rad_?p?s|rad_?per_?s(?:ec)?',
    'm/s^2': r'm_?ss|mp?s2|m_s\^?2|m_per_s2', 'mdeg/s': r'mdps', 'g': r'g', 'mg': r'mg'}
_UNIT_BEHIND = re.compile(f'(.*[xyz])_(?:{"|".join(f"({form})" for form in _UNITS.values())})')
"""A unit at the end of a name, as in ``gx_dps``."""
_IN = r'(?:_([mun]?s(?:ec)?))?'
_CLOCKS = tuple(re.compile(form) for form in (
    rf'(?:[#%_]*(?:time|time_?stamp|stamp|zeit|temps|tiempo|tempo){_IN}'
    r'|(?:.*[/.])?header[./]stamp|millis|micros|timestamp_unix)',
    rf'(?:accelerometer|gyro)?timestamp_sincereboot|time_?startup|sampletimefine|[#%_]*t{_IN}'
    r'|time(?:stamp)?([mun]s)',
    rf'(?:seconds|time)_(?:elapsed|since_start)(?:_in)?{_IN}|elapsed(?:_time)?{_IN}|(ms|us)',
    rf'(?:unix|system|device)_?(?:time|stamp)(?:_?stamp)?{_IN}|epoch?{_IN}'
    r'|timestamp(?:sync|_formattedunix|sync_(?:formatted)?unix)'))
"""Names of times, best first: of the sensor, since reboot, since the start of the log, of the
day. The T of an autopilot is a temperature."""
_OF_SHIMMER = re.compile(r'(?:\w+?_)?((?:accel_(?:ln|wr)|gyro)_[xyz]|timestamp\w*)_cal')
"""Calibrated values, behind the name that the user gave the device."""
_STAMP = re.compile(r'((?:.*[/.])?)header[./]stamp')


class NamesNoAxis(ImuAllanError):
    """The header line names columns, but not those of an IMU, or that the user gives."""


@dataclass(frozen=True)
class Clock:
    """
    A column of times.

    Attributes
    ----------
    column : int
        Index of the column.
    unit : str or None
        Unit of the times; None if it is to be inferred from the numbers.
    nanoseconds : int or None
        Index of a column of nanoseconds to add to the whole seconds.

    """

    column: int
    unit: str | None = None
    nanoseconds: int | None = None


@dataclass(frozen=True)
class Columns:
    """
    Meaning of the columns of a file.

    Attributes
    ----------
    delimiter : str or None
        Separator between cells; None for blanks.
    clock : Clock or None
        The times, if there are any.
    axes : tuple of (int, int, float)
        Column index in the file, column index in the samples, and factor to SI units.
    ignored : tuple of str
        Names of the unused columns.
    temperature : int or None
        Index of a column with the temperature.
    headless : bool
        Whether the first line holds the first sample instead of names.

    """

    delimiter: str | None
    clock: Clock | None
    axes: tuple[tuple[int, int, float], ...]
    ignored: tuple[str, ...] = ()
    temperature: int | None = None
    headless: bool = False


def read_header(header: str, options: RecordingOptions, is_usable: Callable[[Clock], bool],
                ) -> Columns:
    """
    Parse the header line of a file; raise NamesNoAxis if it names no axis.

    `is_usable` returns whether the stamps of a clock change, or its two columns are seconds and
    nanoseconds.
    """
    delimiter, cells = cells_of(header)
    bare = [cell.strip(' "') for cell in cells]
    named = [name_and_unit(cell) for cell in cells]
    names = [name for name, _ in named]
    # Without a header line, numbers given by the user are positions, even if a cell equals one.
    headless = any(map(is_number, cells)) and not any(map(meaning_of, names))
    chosen = _chosen(options.columns, [''] * len(cells) if headless else bare)
    if headless and not chosen:
        raise ImuAllanError(_no_header(cells))
    units = {column: unit or _unit_in_name(name) for column, (name, unit) in enumerate(named)
             } | {column: unit for column, (_, unit) in chosen.items() if unit}
    meanings = {column: meaning for column, (meaning, _) in chosen.items()}
    times = [column for column, meaning in meanings.items() if meaning == 'time']
    parts = own_stamp = None
    # Axes that the user gives are all that are read; a given rate takes the place of the time.
    axes_given = len(times) < len(chosen)
    if not headless and not (axes_given and (times or options.rate_hz)):
        found = {column: meaning for column, meaning in _meanings(named).items()
                 if meaning == 'time' or not axes_given}
        if not times:
            parts = next(filter(is_usable, _split_seconds(names)), None)
        if not (times or parts):
            own_stamp, times = _times(names, found, is_usable)
        meanings = {column: meaning for column, meaning in found.items()
                    if meaning != 'time' or column in times} | meanings
    axes: dict[str, tuple[int, int, float]] = {}
    for column, meaning in sorted(meanings.items()):
        if meaning in axes:
            raise _both(meaning, axes[meaning][0], column)
        if meaning != 'time':
            axes[meaning] = column, list(AXES).index(meaning), _factor(
                names[column], units[column], meaning, options)
    if not axes:
        shown = printable(','.join(cell.strip() for cell in cells)[:80])
        raise NamesNoAxis(
            f'the header line names none of the axes {", ".join(AXES)} ({shown}). A CSV recording '
            f'begins with a line such as {EXAMPLE}, and --columns '
            'gyro_x=NAME,accel_z=NAME,time=NAME says what others are, by name or number from 1')
    clock = parts or _best_clock({column: names[column] for column in times}, units, own_stamp)
    read = {*meanings, *((parts.column, parts.nanoseconds) if parts else ())}
    temperature = next((
        column for column in range(len(cells)) if column not in meanings and (
            re.fullmatch(r'(?:.*[/.])?(?:imu_|gyro_|sensor_)?temp(?:erature)?(?:_(?:deg)?c)?',
                         names[column].lower()) if options.temperature is None
            else options.temperature in ([str(column + 1)] if headless
                                         else [names[column], bare[column]]))), None)
    ignored = [] if headless else [cell.strip() for column, cell in enumerate(cells)
                                   if column not in read and column != temperature]
    return Columns(delimiter, clock, tuple(axes.values()), tuple(ignored), temperature, headless)


def _times(names: Sequence[str], found: Mapping[int, str], is_usable: Callable[[Clock], bool],
           ) -> tuple[int | None, list[int]]:
    """Return the stamp of the axes' own message, if usable, and all usable times."""
    times = [column for column, meaning in found.items() if meaning == 'time']
    others = [column for column in times if not _STAMP.fullmatch(names[column].lower())]
    own = _stamp_of_axes(names)
    if own is not None and (not others or is_usable(Clock(own))):
        return own, [own, *others]
    return None, others if len(times) > 1 else times


def _best_clock(times: Mapping[int, str], units: Mapping[int, str | None], own_stamp: int | None,
                ) -> Clock | None:
    """Choose the best time column by name, and determine its unit."""
    def rank(column: int) -> tuple[bool, int]:
        # Text in place of a unit may describe a date format; such a column ranks last.
        try:
            convert(1.0, (units[column] or 's').strip(), 's')
        except ImuAllanError:
            return True, 0
        return False, -1 if column == own_stamp else (_clock_named(times[column]) or (0,))[0]

    ranks = sorted((rank(column), column) for column in times)
    if not ranks:
        return None
    if [place for place, _ in ranks[:2]] == [(False, 0)] * 2:
        raise _both('time', ranks[0][1], ranks[1][1])
    time = ranks[0][1]
    unit = units[time]
    return Clock(time, unit and unit.strip())


def is_remark(line: str) -> bool:
    """Return whether a line is empty or begins like a comment, as some headers do, too."""
    # Spreadsheets take their separator from sep=.
    return line.isspace() or line.lstrip(' \t"').startswith(('#', '%', '//', 'sep='))


def names_columns(line: str, options: RecordingOptions) -> bool:
    """Return whether a line has the name of an axis, or one that the user gives."""
    # Searching a hundred lines of a megabyte for axis names takes seconds.
    cells = cells_of(line[:1 << 14])[1]
    names = [cell.strip(' "') for cell in cells]
    return (any(meaning_of(name_and_unit(cell)[0]) in AXES for cell in cells)
            or any(_with_name(name, names) for _, text in options.columns
                   for name in (text, text.rpartition(' ')[0])))


def with_units_below(header: str, line: str, columns: Columns, options: RecordingOptions,
                     is_usable: Callable[[Clock], bool]) -> Columns | None:
    """Parse a header whose units are on the next line; return None if they are not."""
    delimiter, names = cells_of(header)
    units = cells_of(line)[1]
    if (columns.headless or delimiter is None or len(names) != len(units)
            or any(map(is_number, units))):
        return None
    # The brackets of m/(s^2) belong to it.
    bare = [match[1] if (match := re.fullmatch(r'[\[(](.*)[\])]', plain)) else plain.strip('-')
            for plain in (unit.strip(' "\r') for unit in units)]
    of_axes = [bare[axis[0]] for axis in columns.axes]
    if not any(of_axes) or any(unit and unit in names[axis[0]]
                               for unit, axis in zip(of_axes, columns.axes, strict=True)):
        # The line has no units, or repeats the names.
        return None
    joined = delimiter.join(
        f'{name} [{unit}]' if unit and not set(name) & set('[(') else name
        for name, unit in zip((name.strip(' "') for name in names), bare, strict=True))
    try:
        return read_header(joined, options, is_usable)
    except ImuAllanError:
        if any('/' in unit for unit in of_axes):
            raise
        # The line holds other text.
        return None


def echoed_imu(line: str) -> Columns | None:
    """
    Recognize the output of ``ros2 topic echo --csv`` for sensor_msgs/Imu, without a header.

    The columns are sec, nanosec, frame_id, orientation (4), covariance (9), angular velocity (3),
    covariance (9), linear acceleration (3), covariance (9).
    """
    cells = line.rstrip('\r\n').split(',')
    if len(cells) != 40 or not (cells[0].lstrip('-').isdecimal() and cells[1].isdecimal()):
        return None
    return Columns(',', Clock(0, 's', 1), tuple(
        (16 + axis if axis < 3 else 25 + axis, axis, 1.0) for axis in range(6)), headless=True)


def _no_header(cells: Sequence[str]) -> str:
    names = [*(['time'] if len(cells) > len(AXES) else []), *AXES][:len(cells)]
    example = ','.join(f'{name}={number}' for number, name in enumerate(names, 1))
    return (f'no line names the {len(cells)} columns. Say what they are, such as --columns '
            f"{example} if that is their order, with units as in 'time=1 us,gyro_x=2 deg/s'. Or "
            f'write a first line such as {EXAMPLE}')


# ----------------------------------------------------------------------------- the user's names

def _chosen(pairs: Sequence[tuple[str, str]], names: Sequence[str],
            ) -> Mapping[int, tuple[str, str | None]]:
    """Map columns that the user gives, by name or number from 1, to meaning and unit."""
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
            raise NamesNoAxis(f'--columns: no column {printable(text)}; there are '
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
    """Find the columns with this name, in capitals or not, whether or not a unit follows it."""
    # The comment mark before the first name is not part of it.
    name = name.lstrip('# ')
    for spelled in (str, str.lower):
        wanted = spelled(name)
        found = [column for column, each in enumerate(map(spelled, names))
                 if name and (each == wanted or each.startswith((f'{wanted} [', f'{wanted} (')))]
        if found:
            return found
    return []


# -------------------------------------------------------------------------------- names and units

def meaning_of(name: str) -> str | None:
    """Return the meaning of a column with this name: ``'time'``, one of the axes, or None."""
    return _choice(name, None)[1]


def _choice(name: str, unit: str | None) -> tuple[int, str | None]:
    """Return how well a name fits, 0 for the best, and its meaning."""
    lower = name.lower()
    if _clock_named(lower) is not None:
        return 0, 'time'
    if (with_unit := _UNIT_BEHIND.fullmatch(lower)) is not None:
        lower = with_unit[1]
    elif (of_shimmer := _OF_SHIMMER.fullmatch(lower)) is not None:
        lower = of_shimmer[1]
    if (short := re.fullmatch(r'(?:(?:.*[/.])?imu\d*[._/])?([gwa])[._]?([xyz])', lower)
            ) is not None:
        return 1, f'{"accel" if short[1] == "a" else "gyro"}_{short[2]}'
    for sensor, choice, pattern in _AXES:
        if (match := pattern.fullmatch(lower)) is not None:
            axis = match['axis'] or match['first'] or 'xyz'[int(match['number'])]
            return choice, f'{sensor}_{axis}'
    letter = re.fullmatch(r'([xyz])(?:[._-]?axis)?', lower)
    # A capital G is not among them, as magnetometers use it (gauss).
    letter_units = {'gyro': ('rad/s', 'deg/s', '°/s', 'dps', 'mdps'),
                    'accel': ('m/s^2', 'm/s²', 'm/s2', 'g', 'mg')}
    sensors = [sensor for sensor, units in letter_units.items() if (unit or '').strip() in units]
    return 0, f'{sensors[0]}_{letter[1]}' if letter and sensors else None


def _meanings(named: Sequence[tuple[str, str | None]]) -> Mapping[int, str]:
    """Map columns, given by name and unit, to times and to the axes with the best names."""
    found = {column: (choice, meaning) for column, (name, unit) in enumerate(named)
             for choice, meaning in [_choice(name, unit)] if meaning is not None}
    best: dict[str, int] = {}
    for choice, meaning in found.values():
        sensor = meaning.partition('_')[0]
        best[sensor] = min(choice, best.get(sensor, choice))
    return {column: meaning for column, (choice, meaning) in found.items()
            if choice == best[meaning.partition('_')[0]]}


def name_and_unit(cell: str) -> tuple[str, str | None]:
    """Split a cell into name and unit; blanks in a name become underscores."""
    # Column names are shorter. Collapsed blanks and limited length keep the regular expression
    # from excessive backtracking.
    plain = ' '.join(cell.split()) if len(cell) <= 200 else ''
    match = re.fullmatch(
        r'"? ?([^"\[(]+?(?:\[[0-2]\])?) ?(?:\[([^\]]*)\]|\(([^)]*)\))? ?"?', plain)
    if match is None:
        return '', None
    return match[1].strip().replace(' ', '_'), match[2] if match[2] is not None else match[3]


def is_rest_of_imu(cell: str) -> bool:
    """Return whether a column is another field of an Imu: header, orientation or covariance."""
    return re.fullmatch(
        r'(?:.*[/.])?(?:header[./].*|orientation(?:[._/].*)?|'
        r'(?:orientation|angular_velocity|linear_acceleration)_covariance.*)',
        name_and_unit(cell)[0].lower()) is not None


def _split_seconds(names: Sequence[str]) -> Iterator[Clock]:
    """Find columns of whole seconds with their matching columns of nanoseconds."""
    whole, parts = ({match[1]: column for column, name in reversed([*enumerate(names)])
                     if (match := re.fullmatch(rf'((?:.*[/._])?)(?:{words})', name.lower()))}
                    for words in ('secs?|seconds', 'nano_?secs?|nano_?seconds|nsecs?'))
    for path in sorted(whole.keys() & parts.keys(), key=lambda path: whole[path]):
        yield Clock(whole[path], 's', parts[path])


def _clock_named(name: str) -> tuple[int, str | None] | None:
    """Return rank, 0 for the best, and unit of the name of a time; None if it is not a time."""
    lower = _OF_SHIMMER.sub(r'\1', name.lower())
    # Units that names imply: `rostopic echo -p`, Arduino's clocks, VectorNav.
    implied = {'%time': 'ns', 'field.header.stamp': 'ns', 'millis': 'ms', 'micros': 'us',
               'timestartup': 'ns'}
    for rank, form in enumerate(_CLOCKS):
        if (match := form.fullmatch(lower)) is not None:
            in_name = next((unit for unit in match.groups() if unit), None)
            return rank, implied.get(lower, in_name)
    return None


def _stamp_of_axes(names: Sequence[str]) -> int | None:
    """Find the column of the header stamp in the message that contains the first axis."""
    axis = next((name.lower() for name in names if meaning_of(name) not in (None, 'time')), '')
    stamps = {match[1]: column for column, name in enumerate(names)
              if (match := _STAMP.fullmatch(name.lower())) and axis.startswith(match[1])}
    return stamps[max(stamps, key=len)] if stamps else None


def _unit_in_name(name: str) -> str | None:
    """Return the unit in a name, of any quantity; a wrong quantity is rejected later."""
    if (clock := _clock_named(name)) is not None:
        return clock[1]
    if re.fullmatch('g_?f(?:orce)?_?[xyz]', name.lower()):
        # Physics Toolbox.
        return 'g'
    if (match := _UNIT_BEHIND.fullmatch(name.lower())) is not None:
        return next(unit for unit, found in zip(_UNITS, match.groups()[1:], strict=True) if found)
    return None


def _factor(name: str, unit: str | None, axis: str, options: RecordingOptions) -> float:
    if unit is None:
        return options.factors[0 if axis.startswith('gyro') else 1]
    # Handle the spellings of EuRoC (rad s^-1), others (m/s2) and phones (G).
    spelled = re.sub(r'(?<=\w)\s+(?=\w)', '*', unit.strip())
    spelled = re.sub(r'(?<=s)(?=-?2$)', '^', spelled)
    if spelled == 'G' and axis.startswith('accel'):
        spelled = 'g'
    return _converted(name, spelled, *((RAD_PER_S, f'{axis}=NAME deg/s') if axis[0] == 'g' else
                                       (M_PER_S2, f'{axis}=NAME g')))


def require_time(name: str, unit: str | None) -> None:
    """Raise an error unless a unit of times is one, or is to be inferred."""
    if unit is not None:
        _converted(name, unit, 's', 'time=NAME ms')


def _converted(name: str, unit: str, si_unit: str, example: str) -> float:
    try:
        return convert(1.0, unit.strip(), si_unit)
    except ImuAllanError as error:
        raise ImuAllanError(f'column {printable(name)}: {printable(error)}; --columns gives '
                            f"another unit, as in '{example}'") from error


def _both(meaning: str, column: int, other: int) -> ImuAllanError:
    return ImuAllanError(f'columns {column + 1} and {other + 1} are both {meaning}; --columns '
                         f'names those to read, such as {meaning}={column + 1}')


# ------------------------------------------------------------------------------------------- cells

def cells_of(header: str) -> tuple[str | None, list[str]]:
    """Determine the delimiter of a line and split it into cells."""
    plain = header.strip('\r\n').lstrip('# ').removeprefix('//').lstrip(' ')
    marks = [mark for mark in (',', ';', '\t', '|') if mark in plain]
    if len(marks) > 1 and all(map(is_number, filter(str.strip, plain.split(marks[1])))):
        # The commas are decimal commas.
        del marks[0]
    if marks:
        return marks[0], plain.split(marks[0])
    # names and their units
    words = re.findall(r'[^\s\[(]+(?:\s*[\[(][^\])]{0,40}[\])])?', plain)
    return (None, words) if len(words) > 1 else (',', [plain])


def is_number(text: str) -> bool:
    """Return whether a cell holds a number, with a decimal point or comma."""
    try:
        float(text.strip(QUOTES).replace(',', '.'))
    except ValueError:
        return False
    return True
