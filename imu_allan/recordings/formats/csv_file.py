# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
CSV files: a line of column names, then one sample per line.

Comments may precede the header line. Without one, the user has to say what the columns are. The
recognized names are listed in `imu_allan.recordings.formats.csv_header`.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
import csv
from dataclasses import replace
from pathlib import Path
import re
from typing import Any, BinaryIO

from imu_allan.arrays import Array, Ints
from imu_allan.block import ImuBlock
from imu_allan.errors import error_about, ImuAllanError, printable
from imu_allan.finding import finding
from imu_allan.noise.terms import AXES
from imu_allan.recordings.formats.csv_header import (
    cells_of,
    Clock,
    Columns,
    echoed_imu,
    is_number,
    is_rest_of_imu,
    names_column,
    QUOTES,
    read_header,
    require_time,
    with_units,
)
from imu_allan.recordings.options import RecordingOptions
from imu_allan.recordings.recording import FileRecording, ImuTopic
from imu_allan.sensor.units import convert
from imu_allan.wording import NO_TOPIC, SENSORS
import numpy as np
from numpy.typing import NDArray

_LONGEST_LINE = 1 << 20
"""Bytes for 30,000 columns with names of 30 characters: all topics of a robot in one export."""
_FIRST_LINES = 64
"""Lines from which to count fields and infer the unit of times: two batches of a 32-sample
FIFO."""
_MISSING = {'', 'NA', 'N/A', 'null', 'NULL', 'None', '-', '--'}
"""What R, databases and Python write for no value."""
_DATE = re.compile(r'(?<![\w:])(\d{4})[-/](\d\d?)[-/](\d\d?)[T ](\d\d?:\d\d:\d\d)'
                   r'(?:(?:\.|:(?=\d{3}\b))(\d{1,9})\d*)?(?:Z|([+-]\d\d):?(\d\d))?')
"""A time of ISO 8601, or as 2024/6/24 and with a colon before the milliseconds."""


class CsvRecording(FileRecording):
    """A CSV file; raises ImuAllanError if it names no axis or a sample rate is needed."""

    def __init__(self, path: Path, stored: Path, options: RecordingOptions) -> None:
        super().__init__(path, stored, options)
        try:
            self._columns = self._found_columns()
        except ImuAllanError as error:
            raise type(error)(f'{printable(path)}: {error}') from error
        self.topics = [ImuTopic(NO_TOPIC, None)]
        if self._apart:
            self.topics = [ImuTopic(f'{sensor} columns', None) for sensor in SENSORS]
            self.preferred = tuple(self.by_name)
        self.untimed = self._columns.clock is None
        if self._columns.temperature is not None:
            self.thermometers = [
                ImuTopic(f'{imu.name}:{options.temperature or "temperature"}', None)
                for imu in self.topics]

    @property
    def sensors(self) -> list[str]:
        """Return the sensors that have columns: 'gyro', 'accel' or both."""
        return sorted({*map(_sensor_of, self._columns.axes)})

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read blocks, each with the number of bytes consumed so far."""
        columns = self._columns
        if self._apart and topic in self.by_name:
            columns = replace(columns, ignored=('axes',), axes=tuple(
                axis for axis in columns.axes if topic.startswith(_sensor_of(axis))))
        elif topic != NO_TOPIC and columns.temperature is not None:
            # A slow temperature sensor leaves most of its cells empty; such rows are skipped.
            columns = replace(columns, axes=((columns.temperature, 0, 1.0),), ignored=('axes',))
        if columns.unit_assumed and topic in self.by_name and any(
                axis < 3 for _, axis, _ in columns.axes):
            self.remark('unit_assumed')
        rejected = samples = 0
        first_rejected = ''
        line = self._first_line
        for lines, position in self._lines():
            table, stamps, bad = _parse(lines, columns)
            if bad:
                first_rejected = first_rejected or (
                    f'line {line + bad[0]}: {printable(lines[bad[0]][:80])}')
                rejected += len(bad)
            line += len(lines)
            if len(table):
                yield self._block(table, stamps, samples, columns), position
                samples += len(table)
        if rejected and not samples:
            raise error_about(self.path, f'{first_rejected} lacks a number in a column that is '
                              'read. A column that holds none can be left out: --columns names '
                              'the others, and --rate takes the place of the time. A time is a '
                              'number or like 2024-06-24 19:02:59.75')
        if rejected:
            self.remark(
                'malformed_messages', what='line', count=rejected, first=first_rejected,
                lost_share=rejected / (rejected + samples))

    def _lines(self) -> Iterator[tuple[list[str], int]]:
        """Read complete lines, about 1 MiB at a time, with the number of bytes consumed so far."""
        # Longer than any line; some 10,000 lines, for fast parsing by numpy.
        at_a_time = 1 << 20
        with self._stored.open('rb') as file:
            position = file.seek(self._data_at)
            # Of what is added meanwhile, only the rest of a line is read.
            while data := file.read(max(min(at_a_time, self.size_bytes - position), 0)):
                last = b'' if data.endswith(b'\n') else file.readline(at_a_time + 1)
                position = file.tell()
                if len(last) > at_a_time:
                    raise error_about(self.path, f'a line ending at byte {position} is longer '
                                      f'than {at_a_time} bytes; not a CSV file of samples')
                text = self._with_points(_decoded(data + last))
                yield text.removesuffix('\n').split('\n'), position

    def _block(self, table: Array, stamps: Ints | None, first: int, columns: Columns) -> ImuBlock:
        if stamps is None:
            assert self.options.rate_hz is not None
            seconds = np.arange(first, first + len(table)) / self.options.rate_hz
            stamps = np.rint(seconds * 1e9).astype(np.int64)
        samples = np.full((len(table), 6), np.nan)
        absent = np.ones((len(table), 2), np.bool_)
        for place, (_, axis, factor) in enumerate(columns.axes):
            samples[:, axis] = table[:, place] * factor
            absent[:, axis // 3] = False
        return ImuBlock(stamps, stamps, samples, absent, '')

    # ----------------------------------------------------------------------- what the columns are

    def _found_header(self, file: BinaryIO) -> str:
        """Find the last line before the first row of numbers, and stop after it."""
        lines: list[tuple[str, int, int]] = []
        # Devices that start write a few lines first.
        for number in range(1, 102):
            at, line = file.tell(), file.readline(_LONGEST_LINE)
            if b'\n' not in line and b'\r' in line[:-1]:
                raise ImuAllanError('the lines end with \\r alone, not \\n; replace it with: '
                                    "tr '\\r' '\\n' < OLD.csv > NEW.csv")
            if len(line) == _LONGEST_LINE and not line.endswith(b'\n'):
                raise ImuAllanError(f'line {number} is longer than 1 MiB: it is no table of '
                                    'samples')
            text = _decoded(line)
            if lines and _is_row(text, cells_of(lines[-1][0])[0]):
                if _is_message(lines[-1][0], text):
                    lines.append((text, at, number))
                elif lines[1:] and (named := with_units(lines[-2][0], lines[-1][0])) is not None:
                    lines.append((named, *lines[-1][1:]))
                del lines[:-1]
                break
            if text.strip(QUOTES + ',;|'):
                lines.append((text, at, number))
        header, self._data_at, self._first_line = lines[0] if lines else ('', 0, 1)
        file.seek(self._data_at)
        file.readline()
        return header

    def _found_columns(self) -> Columns:
        """Find and parse the header line; set where the samples begin."""
        options = self.options
        if options.gyro is not None or options.accel is not None:
            raise ImuAllanError('--gyro and --accel name fields of messages, or a unit alone as '
                                ':deg/s; --columns names the columns of a CSV file')
        with self._stored.open('rb') as file:
            header = self._found_header(file)
            behind = file.tell()
            # Enough to see decimal commas, as the first numbers may all be zero.
            after = file.read(1 << 16) + file.readline(_LONGEST_LINE)
        delimiter, names = cells_of(header)
        text = _decoded(after)
        self._decimal_comma = (delimiter != ',' and
                               re.search(r'(?<![\d,])-?\d+,\d+(?![\d,])', text) is not None)
        # Between blanks, date and time of day may be two cells.
        self._dated = ':' in text and _DATE.search(text) is not None and (
            delimiter is not None or not any(' ' in date[0] for date in _DATE.finditer(text)))
        rows = self._rows(text, delimiter)
        columns = echoed_imu(header) or read_header(
            header, options, lambda clock: _is_plausible_clock(rows, clock))
        if columns.headless:
            rows = self._rows(header, delimiter) + rows
        else:
            self._data_at, self._first_line = behind, self._first_line + 1
            _refuse_more_fields_than_names(names, rows)
        dates = [_cells(each, delimiter) for each in text.split('\n')] if self._dated else []
        dated = [column for column in range(len(names))
                 if any(map(_DATE.match, _column(dates, column)))]
        if columns.clock is None and options.rate_hz is None and dated:
            # A column of dates needs no name; pandas gives its index none.
            columns = replace(columns, clock=Clock(dated[0]), ignored=tuple(
                cell for cell in columns.ignored if cell != names[dated[0]].strip()))
        if (clock := columns.clock) is not None:
            if clock.column in dated:
                # Such a column may have a pattern such as hh:mm:ss in place of a unit.
                clock = replace(clock, unit='ns')
            require_time(names[clock.column].strip(QUOTES), clock.unit)
            # Another topic of the table may have begun long before, so this column starts empty.
            times = _column(rows, clock.column) or next(filter(None, (
                _column([_cells(line, delimiter) for line in lines], clock.column)
                for lines, _ in self._lines())), [])
            name = '' if columns.headless else names[clock.column].strip(QUOTES)
            columns = replace(columns, clock=None if rows and not times else _with_unit(
                clock, times, options.rate_hz, name or str(clock.column + 1)))
        self._apart = columns.clock is not None and _are_apart(columns, rows)
        self._report_ignored(columns)
        if columns.clock is None and options.rate_hz is None:
            raise ImuAllanError('no time_s column; give the sample rate with --rate, or say '
                                "which column is the time: --columns 'time=NAME ms'")
        return columns

    def _rows(self, text: str, delimiter: str | None) -> list[list[str]]:
        """Split the nonempty lines of a text into cells."""
        return [_cells(line, delimiter) for line in self._with_points(text).split('\n')
                if line.strip()]

    def _with_points(self, text: str) -> str:
        """Replace decimal commas by points and dates by nanoseconds."""
        if self._decimal_comma:
            text = text.replace(',', '.')
        return _DATE.sub(_nanoseconds, text) if self._dated else text

    def _report_ignored(self, columns: Columns) -> None:
        cells = [cell for cell in columns.ignored if cell and not is_rest_of_imu(cell)]
        if cells:
            # Ten names keep the remark to a line or two.
            self.remark('ignored_columns', count=len(cells),
                        columns=[printable(cell[:40]) for cell in cells[:10]])
        axes = {axis for _, axis, _ in columns.axes}
        sensors = {axis // 3 for axis in axes}
        for axis, name in enumerate(AXES):
            if axis // 3 in sensors and axis not in axes:
                self._keep_remark(finding('axis_not_finite', (name,), no_column=True))


def _decoded(data: bytes) -> str:
    """Decode text, in Latin-1 if it is not in UTF-8, as spreadsheets save it."""
    try:
        text = data.decode('utf-8-sig')
    except UnicodeDecodeError:
        text = data.decode('latin-1')
    # Numbers of some languages have a minus sign, not a hyphen.
    return text.replace('\N{MINUS SIGN}', '-')


def _parse(lines: list[str], columns: Columns) -> tuple[Array, Ints | None, list[int]]:
    """Parse lines to a table, axes first, stamps in ns (or None) and indices of bad lines."""
    axes = [column for column, _, _ in columns.axes]
    clock = columns.clock
    if clock is None:
        table, _, bad = _numbers(lines, columns.delimiter, axes)
        return table, None, bad
    seconds_and_parts = [column for column in (clock.column, clock.parts) if column is not None]
    table, places, bad = _numbers(lines, columns.delimiter, [*axes, *seconds_and_parts])
    times, parts = table[:, len(axes)], table[:, -1]
    unit_s = convert(1.0, str(clock.unit), 's')
    # Larger times do not fit into 64 bits of nanoseconds.
    timely = np.abs(times * unit_s) < 9.2e9
    if clock.parts is not None:
        parts = parts * clock.part_ns
        # During the first second, total nanoseconds look like a fraction; reject the later rows.
        timely &= (np.floor(times) == times) & ~((parts < 0) | (parts >= 1e9))
    # Rows of another topic may have no time for this one, and are not malformed.
    of_others = np.isnan(table[:, :len(axes)]).all(axis=1) & bool(columns.ignored)
    bad = sorted([*bad, *places[~of_others & ~timely].tolist()])
    kept = ~of_others & timely
    stamps = np.rint(times[kept] * (unit_s * 1e9)).astype(np.int64)
    if unit_s == 1e-9:
        # They exceed the digits of a double.
        exact, _, others = _numbers([lines[place] for place in places[kept]], columns.delimiter,
                                    [clock.column], int)
        if not others:
            stamps = exact[:, 0]
    if clock.parts is not None:
        stamps += np.nan_to_num(parts[kept]).astype(np.int64)
    return table[kept], stamps, bad


def _numbers(lines: list[str], delimiter: str | None, used: Sequence[int],
             kind: type[float] = float) -> tuple[NDArray[Any], Ints, list[int]]:
    """Parse columns; return the table, its line indices, and those of other nonempty lines."""
    # Of blank lines alone numpy would warn.
    if any(map(str.strip, lines)):
        with suppress(ValueError, OverflowError, DeprecationWarning):
            table = np.loadtxt(lines, kind, delimiter=delimiter, usecols=used, ndmin=2,
                               comments=None, quotechar='"')
            # After an unclosed quote numpy reads the following lines as part of the text.
            if len(table) == len(lines):
                return table, np.arange(len(lines)), []
    rows: list[list[float]] = []
    places, bad = [], []
    for number, line in enumerate(lines):
        if line.strip():
            cells = _split(line, delimiter)
            try:
                rows.append([kind(cells[column].strip(QUOTES) or 'nan') for column in used])
                places.append(number)
            except (ValueError, IndexError):
                bad.append(number)
    return np.array(rows, kind).reshape(-1, len(used)), np.array(places, np.int64), bad


def _nanoseconds(time: re.Match[str]) -> str:
    """Return a date and time as nanoseconds since 1970; what is none stays as it is."""
    year, month, day, clock, fraction, hours, minutes = time.groups('')
    written = f'{year}-{month:0>2}-{day:0>2}T{clock:0>8}.{fraction or 0}'
    try:
        stamp = int(np.datetime64(written, 'ns').astype(np.int64))
    except ValueError:
        return time[0]
    ahead_s = 3600 * int(hours or 0) + 60 * int(f'{hours[:1]}{minutes or 0}')
    return str(stamp - ahead_s * 10**9)


def _cells(line: str, delimiter: str | None) -> list[str]:
    """Split a line into cells, without surrounding blanks and quotes."""
    return [cell.strip(QUOTES) for cell in _split(line, delimiter)]


def _split(line: str, delimiter: str | None) -> list[str]:
    """Split a line at the delimiter; an unclosed quote hides no cells."""
    if delimiter is not None and '"' in line:
        with suppress(csv.Error):
            return next(csv.reader([line], delimiter=delimiter, strict=True))
    return line.split(delimiter)


# ------------------------------------------------------------ whether the first rows are plausible

def _is_row(line: str, delimiter: str | None) -> bool:
    """Return whether most cells of a line are numbers or times, split by this or another mark."""
    if line.startswith(('#', '%', '//')):
        return False
    for cells in (_cells(line, delimiter), cells_of(line)[1]):
        filled = [cell for cell in cells if cell.strip(QUOTES) not in _MISSING]
        numbers = [cell for cell in filled if is_number(cell) or _DATE.match(cell.strip(QUOTES))]
        if 2 * len(numbers) > len(filled):
            return True
    return False


def _is_message(line: str, row: str) -> bool:
    """Return whether a line above the first row of an IMU's numbers is a sentence, and no name."""
    delimiter, cells = cells_of(row)
    return (delimiter is not None and len(cells) >= 4 and len(_cells(line, delimiter)) == 1
            and not names_column(line))


def _column(rows: Sequence[Sequence[str]], column: int) -> list[str]:
    """Return the nonempty cells of a column."""
    return [row[column] for row in rows if len(row) > column and row[column]]


def _sensor_of(axis: tuple[int, int, float]) -> str:
    return 'gyro' if axis[1] < 3 else 'accel'


def _are_apart(columns: Columns, rows: Sequence[Sequence[str]]) -> bool:
    """Return whether rows often have one sensor only, as of two topics in one table."""
    filled = [{_sensor_of(axis) for axis in columns.axes
               if ''.join(row[axis[0]:axis[0] + 1]).lower() not in ('', 'nan')} for row in rows]
    counts = Counter(map(len, filled))
    return len(set().union(*filled)) == 2 and counts[1] > counts[2] / 4


def _is_plausible_clock(rows: Sequence[Sequence[str]], clock: Clock) -> bool:
    """Return whether a clock is changing numbers, or seconds and parts in all rows but one."""
    if clock.parts is None:
        # Some drivers leave the stamps at zero; a time of day may stand beside one in numbers.
        times = _column(rows[:_FIRST_LINES], clock.column)
        return len(times) < 2 or (len(set(times)) > 1 and any(map(is_number, times)))
    others = 0
    for row in rows:
        with suppress(ValueError, IndexError):
            whole, part = float(row[clock.column]), float(row[clock.parts])
            others += not (whole.is_integer() and 0 <= part * clock.part_ns < 1e9)
    return others < 2


def _filled(cells: Sequence[str]) -> int:
    """Return the number of cells up to the last that is not empty."""
    return max((place for place, text in enumerate(cells, 1) if text.strip(QUOTES)), default=0)


def _refuse_more_fields_than_names(names: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Raise an error if most rows have more fields than the header has names."""
    named = _filled(names)
    # Allow an unnamed last column, for example of remarks.
    counts = Counter(_filled(row) if len(row) > len(names) else named
                     for row in rows[:_FIRST_LINES])
    fields = counts.most_common(1)[0][0] if counts else 0
    if fields > named:
        advice = ('name every column, the number of the row, too, as R does with col.names=NA'
                  if fields < 2 * named else
                  'where that comes of decimal commas, write semicolons between the cells')
        raise ImuAllanError(f'the rows have {fields} fields, the header names {named}, so that '
                            f'none can be recognized by its name; {advice}')


def _with_unit(clock: Clock, texts: Sequence[str], rate_hz: float | None, name: str
               ) -> Clock | None:
    """Infer the unit of times or raise an error; return None if the given rate is used instead."""
    if clock.unit:
        return clock
    numbers: list[float] = []
    for text in texts:
        with suppress(ValueError):
            numbers.append(float(text))
    times = np.array([number for number in numbers if np.isfinite(number)][:_FIRST_LINES])
    # Use the median: the first value may be truncated or zero. Times of this century exceed 1e9 s
    # (2001), which separates the units.
    usual = np.sort(np.abs(times))[len(times) // 2] if len(times) else 0.0
    unit = next((unit for least, unit in ((1e17, 'ns'), (1e14, 'us'), (1e11, 'ms'))
                 if usual >= least), 's')
    if unit == 'ns' and usual < 1e18:
        if rate_hz is not None:
            return None
        raise ImuAllanError(
            'the times may be nanoseconds before 2001, or the ticks of 100 ns of Windows. For '
            f"nanoseconds give --columns 'time={printable(name)} ns', for ticks the sample rate "
            'with --rate')
    # A clock that is set back says nothing about the rate.
    steps = np.diff(times)
    steps = np.sort(steps[steps >= 0])
    # IMUs run at 5 to 20,000 Hz; other rates mean that the unit is another one. Samples of a batch
    # may be a microsecond apart, and the longest step may be an outage.
    for interval, least_hz, most_hz in () if len(steps) < 8 else (
            (float(steps.mean()), 0.0, 20_000.0), (float(steps[:-1].mean()), 5.0, np.inf)):
        if interval > 0 and not least_hz <= (
                apparent_hz := 1 / (interval * convert(1.0, unit, 's'))) <= most_hz:
            if rate_hz is not None:
                return None
            if (steps == 1).all():
                raise ImuAllanError(
                    'the times are 1 apart, as the numbers of rows are. Give the sample rate with '
                    f"--rate, or the unit of times with --columns 'time={printable(name)} ms'")
            digits = '.0f' if interval >= 1000 else '.3g'
            raise ImuAllanError(
                f'the times are {interval:{digits}} apart, which in {unit} would be '
                f'{apparent_hz:.3g} Hz, the rate of no IMU. Say what they are, such as --columns '
                f"'time={printable(name)} ms' (or s, us, ns, min, s/10000), or give the sample "
                'rate with --rate')
    return replace(clock, unit=unit)
