# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Meaning of the columns of a CSV file, as given by the user or inferred from their names.

Recognized are the names of this project (``time_s``, ``gyro_x``), of EuRoC and TUM-VI
(``#timestamp [ns],w_RS_S_x [rad s^-1]``), ``rostopic echo -p`` (``field.angular_velocity.x``),
UZH-FPV (``# timestamp ang_vel_x lin_acc_x``), PlotJuggler (``__time,/imu/angular_velocity/x``),
phyphox (``"Gyroscope x (rad/s)"``), bagpy (``header.stamp.secs,header.stamp.nsecs``), phone apps
(SensorLog, AndroSensor), VectorNav, Xsens, Shimmer, WitMotion, autopilots (``gyroADC[0] (deg/s)``
of Betaflight, where blackbox_decode gives units) and short names (``t,gx,ay``).
Words for time and sensors may be German, Spanish, French, Italian or Portuguese.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
import re

from imu_allan.errors import ImuAllanError, printable
from imu_allan.noise.terms import AXES
from imu_allan.recordings.options import M_PER_S2, RAD_PER_S, RecordingOptions
from imu_allan.sensor.units import convert

_EXAMPLE = 'time_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z'
"""A header line that needs no option."""
QUOTES = ' \t\r\n"'
"""Characters that may surround the text of a cell."""

_CHIPS = 'lsm|ism|bm[ix]|bno|mpu|icm|iim|adis'
# Before the words may stand the path to a name, or the device it belongs to; a chip also behind.
_AXES = [
    *((sensor, re.compile(rf'(?:(?:.*[/.])?imu\d*[._/])?{letter}[._]?([xyz])'))
      for sensor, letter in (('gyro', '[gw]'), ('accel', 'a'))),
    *((sensor, re.compile(
        rf'(?:.*[/.])?(?:(?:imu|sensor|(?:{_CHIPS})\w*?)\d*[._/])?'
        rf'(?:(?:{words})(?:_(?:{_CHIPS})[a-z]*\d[a-z\d]*(?:_c)?(?=[/._-]))?'
        rf'[/._-]{{0,2}}(?:([xyz])|\[([0-2])\])|([xyz])[._-](?:{words}))'))
      for sensor, words in (
        ('gyro', r'angular_?(?:velocity|rate|speed)|ang_?(?:vel|rate)|rot(?:ation)?_?rate'
                 r'|g[iy]ros[ck][oó]p(?:e|io)?|gyro_?rotation|gyro_rad|gyro|gyr|w_rs_s|omega'
                 r'|drehrate|winkelgeschwindigkeit|uncompgyro|gyroadc|as'),
        ('accel', r'(?:total_?|accelerometer_?)?ac?c[eé]l[eé]r(?:a[czt]i[oó]ne?|a[cç][aã]o)'
                  r'|ac?c[eé]l[eé]r[oóô]m[eéè]t(?:er|r[eo])|accelerometer_m_s2|acc?e?l|acc'
                  r'|a_rs_s|lin(?:ear)?_?acc(?:el(?:eration)?)?|beschleunigung'
                  r'|uncompacc(?:el)?|accsmooth')))]
"""Names of the axes of a sensor."""
_UNITS = {
    'deg/s': r'dps|deg_?s|deg_?per_?s(?:ec)?', 'rad/s': r'rad_?p?s|rad_?per_?s(?:ec)?',
    'm/s^2': r'm_?ss|mp?s2|m_s\^?2|m_per_s2', 'mdeg/s': r'mdps', 'g': r'g', 'mg': r'mg'}
_UNIT_BEHIND = re.compile(f'(.*[xyz])_(?:{"|".join(f"({form})" for form in _UNITS.values())})')
"""A unit at the end of a name, as in ``gx_dps``."""
_SHIMMER = re.compile(r'.+_(gyro|accel)(?:_(?:ln|wr))?(_[xyz])_cal')
"""A name of Shimmer: that of the device, and perhaps low noise or wide range."""
_IN = r'(?:_([mun]?s(?:ec)?))?'
_CLOCKS = tuple(re.compile(form) for form in (
    rf'[#%_]*(?:time|time_?stamp|stamp|zeit|temps|tiempo|tempo|t){_IN}',
    r'(?:.*[/.])?header[./]stamp|millis|micros|(ms|us)|time(?:stamp)?([mun]s)',
    r'(?:accelerometer|gyro)?timestamp_sincereboot|time_?startup|sampletimefine',
    rf'(?:seconds|time)_(?:elapsed|since_start)(?:_in)?{_IN}|elapsed(?:_time)?{_IN}',
    rf'(?:unix|system|device|chip)_?(?:time|stamp)(?:_?stamp)?{_IN}|epoch?{_IN}',
    r'(?:.+_)?timestamp(?:sync)?_unix(?:_cal)?'))
"""Names of times. The T of an autopilot is a temperature."""
_IMPLIED = {'%time': 'ns', 'field.header.stamp': 'ns', 'millis': 'ms', 'micros': 'us',
            'timestartup': 'ns', 'gyroadc': 'counts', 'accsmooth': 'counts'}
"""Units that names imply: `rostopic echo -p`, Arduino's clocks, VectorNav, blackbox_decode."""


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
    parts : int or None
        Index of a column of parts of a second to add to the whole seconds.
    part_ns : int
        Nanoseconds in such a part: 1 or 1000.

    """

    column: int
    unit: str | None = None
    parts: int | None = None
    part_ns: int = 1


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
    unit_assumed : bool
        Whether nothing says that the angular velocity is in rad/s.

    """

    delimiter: str | None
    clock: Clock | None
    axes: tuple[tuple[int, int, float], ...]
    ignored: tuple[str, ...] = ()
    temperature: int | None = None
    headless: bool = False
    unit_assumed: bool = False


@dataclass(frozen=True)
class Name:
    """
    A cell of the header line.

    Attributes
    ----------
    cell : str
        Its text without quotes.
    name : str
        The name in it; blanks become underscores.
    meaning : str or None
        ``'time'``, one of the axes, or None.
    unit : str or None
        Unit behind the name or in it, of any quantity; a wrong one is rejected later.

    """

    cell: str
    name: str
    meaning: str | None
    unit: str | None


def read_header(header: str, options: RecordingOptions, is_usable: Callable[[Clock], bool],
                ) -> Columns:
    """
    Parse the header line of a file; raise NamesNoAxis if it names no axis.

    `is_usable` returns whether the stamps of a clock are numbers that change, or its two columns
    are seconds and parts of them.
    """
    delimiter, cells = cells_of(header)
    names = [_name_of(cell) for cell in cells]
    # Without a header line, numbers given by the user are positions, even if a cell equals one.
    headless = any(map(is_number, cells)) and not any(name.meaning for name in names)
    chosen = _chosen(options.columns, ['' if headless else name.cell for name in names])
    if headless and not chosen:
        raise ImuAllanError(_no_header(cells))
    for column, (meaning, unit) in chosen.items():
        known = names[column]
        names[column] = replace(known, meaning=meaning, unit=unit or known.unit)
    times = {column: Clock(column, name.unit) for column, name in enumerate(names)
             if name.meaning == 'time'}
    clock = next((times[column] for column in chosen if column in times), None)
    of_axes = [column for column in chosen if column not in times]
    # Axes that the user gives are all that are read; a given rate takes the place of the time.
    if not headless and not (of_axes and (clock or options.rate_hz)):
        of_axes = of_axes or _measured(names)
        clock = clock or next(filter(is_usable, (*_split_seconds(names), *times.values())),
                              next(iter(times.values()), None))
    places: dict[str, int] = {}
    for column in sorted(of_axes):
        places.setdefault(str(names[column].meaning), column)
    for column in sorted(of_axes):
        if (first := places[str(names[column].meaning)]) != column:
            example = ','.join(f'{axis}={place + 1}' for axis, place in places.items())
            raise ImuAllanError(
                f'columns {first + 1} and {column + 1} are both {names[column].meaning}; '
                f'--columns names all those to read, such as {example}')
    axes = [(column, list(AXES).index(axis), _factor(names[column], options))
            for axis, column in places.items()]
    if not axes:
        shown = printable(','.join(cell.strip() for cell in cells)[:80])
        raise NamesNoAxis(
            f'the header line names none of the axes {", ".join(AXES)} ({shown}). A CSV recording '
            f'begins with a line such as {_EXAMPLE}, with units as in gyro_x [deg/s]. '
            '--columns gyro_x=NAME,accel_z=NAME,time=NAME says what others are, by name or number '
            'from 1')
    read = {*of_axes, *times} | ({clock.column, clock.parts} if clock else set())
    temperature = next((
        column for column, name in enumerate(names) if column not in read and (
            re.fullmatch(r'(?:.*[/.])?(?:imu_|gyro_|sensor_)?temp(?:erature)?(?:_(?:deg)?c)?',
                         name.name.lower()) if options.temperature is None
            else options.temperature in ([str(column + 1)] if headless
                                         else [name.name, name.cell]))), None)
    ignored = [] if headless else [cell.strip() for column, cell in enumerate(cells)
                                   if column not in read and column != temperature]
    # Names of ROS imply rad/s (REP-103), as --columns does, and gyro_rad of PX4 says it.
    unit_assumed = options.gyro_unit is None and any(
        name.unit is None and str(name.meaning).startswith('gyro') and column not in chosen
        and not re.search('ang(?:ular)?_?vel|rad', name.name.lower())
        for column, name in enumerate(names) if column in of_axes)
    return Columns(delimiter, clock, tuple(axes), tuple(ignored), temperature, headless,
                   unit_assumed)


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
            f'write a first line such as {_EXAMPLE}')


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


def _columns_named(text: str, names: Sequence[str]) -> list[int]:
    """Find columns by name, in capitals or not, with a unit behind it or not; or by number."""
    # The comment mark before the first name is not part of it.
    name = text.lstrip('# ')
    for spelled in (str, str.lower):
        wanted = spelled(name)
        found = [column for column, each in enumerate(map(spelled, names))
                 if name and (each == wanted or each.startswith((f'{wanted} [', f'{wanted} (')))]
        if found:
            return found
    number = int(text) if text.isdecimal() and len(text) < 7 else 0
    return [number - 1] if 1 <= number <= len(names) else []


# -------------------------------------------------------------------------------- names and units

def _name_of(cell: str) -> Name:
    """Determine what a cell of a header line says of its column."""
    # Column names are shorter. Collapsed blanks and limited length keep the regular expression
    # from excessive backtracking.
    plain = ' '.join(cell.split()) if len(cell) <= 200 else ''
    match = re.fullmatch(
        r'"? ?([^"\[(]+?(?:\[[0-2]\])?) ?(?:\[([^\]]*)\]|\(([^)]*)\))? ?"?', plain)
    name = match[1].strip().replace(' ', '_') if match else ''
    unit = (match[2] or match[3] or '').strip() if match else ''
    meaning, implied = _meaning(name.lower())
    return Name(cell.strip(' "'), name, meaning, unit or implied)


def _meaning(name: str) -> tuple[str | None, str | None]:
    """Return the meaning of a name in lower case, and the unit in it."""
    for form in _CLOCKS:
        if (match := form.fullmatch(name)) is not None:
            return 'time', _IMPLIED.get(name) or next(filter(None, match.groups()), None)
    implied = None
    name = _SHIMMER.sub(r'\1\2', name)
    if (match := _UNIT_BEHIND.fullmatch(name)) is not None:
        name, *found = match.groups()
        implied = next(unit for unit, text in zip(_UNITS, found, strict=True) if text)
    for sensor, form in _AXES:
        if (match := form.fullmatch(name)) is not None:
            axis = next(filter(None, match.groups()))
            return f'{sensor}_{"xyz"["xyz012".index(axis) % 3]}', (
                implied or _IMPLIED.get(name.partition('[')[0]))
    return None, implied


def names_column(line: str) -> bool:
    """Return whether a line names an axis or a time."""
    return any(_name_of(cell).meaning for cell in cells_of(line)[1])


def with_units(names: str, units: str) -> str | None:
    """Put a line of units, such as ``(s),(deg/s)``, behind the names of axes in the line above."""
    (delimiter, above), (_, below) = cells_of(names), cells_of(units)
    named, others = (any(_name_of(cell).meaning in AXES for cell in cells)
                     for cells in (above, below))
    if not named or others or len(above) != len(below) or any(map(is_number, below)):
        return None
    bare = [re.sub(r'^[(\[](.*)[])]$', r'\1', cell.strip(QUOTES)) for cell in below]
    return (delimiter or ' ').join(
        f'{name.strip(QUOTES)} [{unit}]' if unit else name
        for name, unit in zip(above, bare, strict=True))


def is_rest_of_imu(cell: str) -> bool:
    """Return whether a column is another field of an Imu: header, orientation or covariance."""
    return re.fullmatch(
        r'(?:.*[/.])?(?:header[./].*|orientation(?:[._/].*)?|'
        r'(?:orientation|angular_velocity|linear_acceleration)_covariance.*)',
        _name_of(cell).name.lower()) is not None


def _split_seconds(names: Sequence[Name]) -> Iterator[Clock]:
    """Find columns of whole seconds with their matching columns of nano- or microseconds."""
    whole, *others = ({match[1]: column for column, name in reversed([*enumerate(names)])
                       if (match := re.fullmatch(rf'((?:.*[/._])?)(?:{words})',
                                                 name.name.lower()))}
                      for words in ('s|secs?|seconds|unix_time', 'ns|n(?:ano)?_?sec(?:ond)?s?',
                                    'us|u_?secs?|micro_?sec(?:ond)?s?'))
    for parts, part_ns in zip(others, (1, 1000), strict=True):
        for path in sorted(whole.keys() & parts.keys(), key=lambda path: whole[path]):
            yield Clock(whole[path], 's', parts[path], part_ns)


def _measured(names: Sequence[Name]) -> list[int]:
    """Find the columns of axes; an uncompensated one counts if there is no other of its axis."""
    columns = [column for column, name in enumerate(names) if name.meaning in AXES]
    raw = {column for column in columns if names[column].name.lower().startswith('uncomp')}
    others = {names[column].meaning for column in columns if column not in raw}
    return [column for column in columns
            if column not in raw or names[column].meaning not in others]


def _factor(name: Name, options: RecordingOptions) -> float:
    is_gyro = str(name.meaning).startswith('gyro')
    stated = options.gyro_unit if is_gyro else options.accel_unit
    if name.unit is None or (name.unit == 'counts' and stated is not None):
        return options.factors[0 if is_gyro else 1]
    # Handle the spellings of EuRoC (rad s^-1), others (m/s2) and phones (G, g-force).
    spelled = re.sub(r'(?<=\w)\s+(?=\w)', '*', name.unit)
    spelled = re.sub(r'(?<=s)(?=-?2$)', '^', spelled)
    if not is_gyro and re.fullmatch(r"m?g(?:'?s|[-*]?force)?", spelled.lower()):
        spelled = 'mg' if spelled.startswith('m') else 'g'
    si_unit, other = (RAD_PER_S, 'deg/s') if is_gyro else (M_PER_S2, 'g')
    return _converted(name.name, spelled, si_unit, f'{name.meaning}=NAME {other}')


def require_time(name: str, unit: str | None) -> None:
    """Raise an error unless a unit of times is one, or is to be inferred."""
    if unit is not None:
        _converted(name, unit, 's', 'time=NAME ms')


def _converted(name: str, unit: str, si_unit: str, example: str) -> float:
    try:
        return convert(1.0, unit, si_unit)
    except ImuAllanError as error:
        raise ImuAllanError(f'column {printable(name)}: {printable(error)}; --columns gives '
                            f"another unit, as in '{example}'") from error


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
