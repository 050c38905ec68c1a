# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
CSV files: a line of names, then a sample a line.

Comments may stand before it, and where it is missing the user says what the columns are. Which
names are understood stands in `imu_allan.recordings.formats.csv_header`.
"""

from codecs import BOM_UTF8
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import compress, pairwise
from pathlib import Path
import re

from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError, printable
from imu_allan.recordings.formats.csv_header import (
    cells_of,
    Columns,
    echoed_imu,
    is_remark,
    is_rest_of_imu,
    MOST_COMMENTS,
    QUOTES,
    read_header,
    with_units_below,
)
from imu_allan.recordings.imu_topic import ImuTopic
from imu_allan.recordings.options import RecordingOptions
from imu_allan.recordings.recording import FileRecording
from imu_allan.sensor.units import convert
from imu_allan.wording import NO_TOPIC
import numpy as np
from numpy.typing import NDArray

TOPIC = NO_TOPIC
"""The name that stands for a topic."""

_READ_BYTES = 1 << 20
"""Some 10,000 lines, so that numpy works on many at once; longer than any line."""
_LONGEST_HEADER = 1 << 20
"""30,000 columns with names of 30 characters: all topics of a robot in one export."""
_LOOKED_AT = 1 << 16
"""Bytes of samples in which decimal commas are sought: the first ones may all be zero."""
_FIRST_LINES = 64
"""By which fields are counted and times without a unit judged: two batches of a FIFO of 32."""
_MAGNITUDES = ((1e17, 'ns'), (1e14, 'us'), (1e11, 'ms'))
"""From which number on a time is in a unit, if it is one of this century: 1e9 is 2001 in s."""
_SLOWEST_HZ, _FASTEST_HZ = 5.0, 20_000.0
"""Rates of IMUs; beyond, times without a unit are in another one than they seem to be."""
_DECIMAL_COMMA = re.compile(r'(?<![\d,])-?\d+,\d+(?![\d,])')
_QUOTED_COMMA = re.compile(r'"\s*(-?\d+),(\d+(?:[eE][-+]?\d+)?)\s*"')
"""A number with a decimal comma in a file whose cells commas part."""
_QUOTED = re.compile('"[^"]*"?')
_GROUPED = re.compile(r'\d{1,3}(?:[.,]\d{3})+')


class CsvRecording(FileRecording):
    """A CSV file; raises ImuAllanError where its header names no axis, or a rate is needed."""

    def __init__(self, path: Path, stored: Path, options: RecordingOptions) -> None:
        super().__init__(path, stored, options)
        try:
            self._columns = self._found_columns()
        except ImuAllanError as error:
            raise ImuAllanError(f'{printable(path)}: {error}') from error
        self.topics = [ImuTopic(TOPIC, None)]
        self.untimed = self._columns.time is None
        if self._columns.temperature is not None:
            self.thermometers = [
                ImuTopic(f'{TOPIC}:{options.temperature or "temperature"}', None)]

    @property
    def sensors(self) -> list[str]:
        """Which sensors have columns in it: 'gyro', 'accel' or both."""
        return sorted({'gyro' if axis < 3 else 'accel' for _, axis, _ in self._columns.axes})

    def span_ns(self) -> tuple[int, int] | None:
        """Return the least and the greatest stamp at its two ends; None where there are none."""
        found: list[int] = []
        unit_s: float | None = None
        with self._stored.open('rb') as file:
            for start in (self._data_at, max(self._data_at, self.size_bytes - _LOOKED_AT)):
                file.seek(start)
                data = file.read(_LOOKED_AT)
                # Part of a number is another one.
                lines = self._with_points(data.decode('utf-8', 'replace')).split('\n')[
                    start > self._data_at:None if file.tell() == self.size_bytes else -1]
                _, stamps, unit_s, _ = _parse(lines, self._columns, unit_s)
                if stamps is None or not len(stamps):
                    return None
                found += [int(stamps.min()), int(stamps.max())]
        return min(found), max(found)

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read blocks, each with the bytes consumed so far."""
        columns = self._columns
        if topic != TOPIC and columns.temperature is not None:
            # A thermometer may be slower than the samples, its cells empty most of the time.
            columns = replace(columns, axes=((columns.temperature, 0, 1.0),), ignored=('axes',))
        rejected = samples = 0
        first_rejected = ''
        line = self._first_line
        time_unit_s: float | None = None
        for text, position in self._texts():
            lines = self._with_points(text).split('\n')
            if lines[-1] == '':
                lines.pop()
            table, stamps, time_unit_s, bad = _parse(lines, columns, time_unit_s)
            if bad:
                first_rejected = first_rejected or (
                    f'line {line + bad[0]}: {printable(lines[bad[0]][:80])}')
                rejected += len(bad)
            line += len(lines)
            if len(table):
                yield self._block(table, stamps, samples, columns), position
                samples += len(table)
        if rejected and not samples:
            raise ImuAllanError(
                f'{printable(self.path)}: {first_rejected} lacks a number in a column that is '
                'read; a column that holds none can be left out: --columns names the others, and '
                '--rate takes the place of the time')
        if rejected:
            self.remark(
                'malformed_messages', what='line', count=rejected, first=first_rejected)

    def _texts(self) -> Iterator[tuple[str, int]]:
        """Read whole lines, about a MiB at a time, with the bytes consumed so far."""
        with self._stored.open('rb') as file:
            file.seek(self._data_at)
            while data := file.read(_READ_BYTES):
                last = file.readline(_READ_BYTES + 1)
                if len(last) > _READ_BYTES:
                    raise ImuAllanError(
                        f'{printable(self.path)}: a line ending at byte {file.tell()} is longer '
                        f'than {_READ_BYTES} bytes; not a CSV file of samples')
                yield (data + last).decode('utf-8', 'replace'), file.tell()

    def _block(self, table: NDArray[np.float64], stamps: NDArray[np.int64] | None,
               first: int, columns: Columns) -> ImuBlock:
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

    def _found_columns(self) -> Columns:
        """Find the header line and understand it; sets where the samples begin."""
        options = self.options
        with self._stored.open('rb') as file:
            for number in range(1, MOST_COMMENTS + 2):
                self._data_at, self._first_line = file.tell(), number
                line = file.readline(_LONGEST_HEADER)
                if len(line) == _LONGEST_HEADER and not line.endswith(b'\n'):
                    raise ImuAllanError(f'line {number} is longer than 1 MiB: it is no table of '
                                        'samples')
                header = line.decode('utf-8-sig', 'replace')
                if not is_remark(header, options):
                    break
            behind, after = file.tell(), file.read(_LOOKED_AT)
        columns = echoed_imu(header) or read_header(header, options)
        below, newline, rest = after.decode('utf-8', 'replace').partition('\n')
        units = with_units_below(header, below, columns, options)
        if units is not None:
            header, columns = units
            behind += len(after.partition(b'\n')[0]) + 1
            self._first_line += 1
        if not columns.headless:
            self._data_at, self._first_line = behind, self._first_line + 1
        elif line.startswith(BOM_UTF8):
            self._data_at += len(BOM_UTF8)
        samples = (header if columns.headless else '') + below + newline + rest
        self._decimal_comma = (columns.delimiter != ','
                               and _DECIMAL_COMMA.search(samples) is not None)
        self._quoted_comma = (columns.delimiter == ','
                              and _QUOTED_COMMA.search(samples) is not None)
        rows = self._with_points(samples).split('\n')
        if not (columns.headless or columns.nanoseconds is None
                or _are_split_seconds(rows, columns)):
            columns = read_header(header, options, split=False)
        if columns.stamped and _stand_still(rows[:_FIRST_LINES], columns):
            other = read_header(header, options, stamped=False)
            columns = columns if other.time is None else other
        if not columns.headless:
            _refuse_more_fields_than_names(cells_of(header)[1], rows, columns)
        _refuse_grouped_times(rows, columns)
        columns = _with_known_times(columns, rows, options.rate_hz)
        self._report_ignored(columns)
        if columns.time is None and options.rate_hz is None:
            raise ImuAllanError('no time_s column; give the sample rate with --rate, or say '
                                "which column is the time: --columns 'time=NAME ms'")
        return columns

    def _with_points(self, text: str) -> str:
        """Write decimal commas as points."""
        if self._quoted_comma:
            return _QUOTED_COMMA.sub(r'\1.\2', text)
        return text.replace(',', '.') if self._decimal_comma else text

    def _report_ignored(self, columns: Columns) -> None:
        lookalikes = {*columns.lookalikes}
        others = [cell for cell in columns.ignored
                  if cell and cell not in lookalikes and not is_rest_of_imu(cell)]
        for cells in (columns.lookalikes, others):
            if cells:
                # More than ten names take more than a line or two.
                self.remark('ignored_columns', perhaps_axes=cells is not others, count=len(cells),
                            columns=[printable(cell[:40]) for cell in cells[:10]])


def _parse(lines: list[str], columns: Columns, time_unit_s: float | None,
           ) -> tuple[NDArray[np.float64], NDArray[np.int64] | None, float | None, list[int]]:
    """
    Read the numbers of the columns used.

    Returns
    -------
    table : ndarray of float64, shape (n, axes)
        Rows of the lines that are numbers throughout; empty cells are NaN. A row without any
        number is left out where there are other columns: it belongs to another topic.
    stamps : ndarray of int64, shape (n,), or None
        In nanoseconds; None without a time column.
    time_unit_s : float or None
        Seconds in one unit of time; None as long as there is none.
    bad : list of int
        The other lines, in order.

    """
    bad: list[int] = []
    kept, places = lines, np.arange(len(lines))
    try:
        table = np.loadtxt(lines, delimiter=columns.delimiter, usecols=columns.used, ndmin=2,
                           comments=None)
        whole = len(table) == len(lines)
    except ValueError:
        whole = False
    if not whole:
        rows: list[list[float]] = []
        kept, numbers = [], []
        for number, line in enumerate(lines):
            if not line.strip():
                continue
            cells = line.split(columns.delimiter)
            try:
                rows.append([float(cells[column].strip(QUOTES) or 'nan')
                             for column in columns.used])
                kept.append(line)
                numbers.append(number)
            except (ValueError, IndexError):
                bad.append(number)
        table = np.array(rows, np.float64).reshape(-1, len(columns.used))
        places = np.array(numbers, np.intp)
    if columns.time is None:
        return table, None, None, bad
    times = table[:, 0]
    known = np.isfinite(times)
    if time_unit_s is None and known.any():
        time_unit_s = convert(1.0, columns.time_unit or _apparent_unit(times[known][0]), 's')
    unit = time_unit_s or 1.0
    # More seconds do not fit into 64 bits of nanoseconds.
    timely = np.abs(times * unit) < 9.2e9
    if columns.nanoseconds is not None:
        # Of a total, the first second looks like nanoseconds since a whole one.
        timely &= (np.floor(times) == times) & ~((table[:, 1] < 0) | (table[:, 1] >= 1e9))
    with_numbers = 1 if columns.nanoseconds is None else 2
    some = np.ones_like(timely)
    if columns.ignored:
        some &= ~np.isnan(table[:, with_numbers:]).all(axis=1)
    if not timely.all():
        # A row without any number may have no time of this topic either.
        bad = sorted([*bad, *places[some & ~timely].tolist()])
    some &= timely
    stamps = np.zeros(len(times), np.int64)
    exact = _exact(compress(kept, timely), columns) if unit == 1e-9 else None
    stamps[timely] = np.rint(times[timely] * (unit * 1e9)) if exact is None else exact
    if columns.nanoseconds is not None:
        stamps = stamps + np.nan_to_num(table[:, 1]).astype(np.int64)
    return table[some, with_numbers:], stamps[some], time_unit_s, bad


def _exact(lines: Iterable[str], columns: Columns) -> NDArray[np.int64] | None:
    """Read nanoseconds as whole numbers: a double has not enough digits for those of today."""
    try:
        return np.array([int(_cell(line, columns, columns.time)) for line in lines], np.int64)
    except (ValueError, OverflowError):
        return None


def _cell(line: str, columns: Columns, column: int | None) -> str:
    """Return one cell, without what stands about its text; raises IndexError."""
    assert column is not None
    return line.split(columns.delimiter, column + 1)[column].strip(QUOTES)


# ------------------------------------------------------------ whether the first rows are plausible

def _times(rows: Iterable[str], columns: Columns) -> Iterator[str]:
    """Yield the cells of the time column that hold anything."""
    for row in rows:
        with suppress(IndexError):
            if text := _cell(row, columns, columns.time):
                yield text


def _stand_still(rows: Sequence[str], columns: Columns) -> bool:
    """Whether the times of many lines are one: a driver leaves its stamps zero."""
    times = list(_times(rows, columns))
    return len(times) > 1 and len(set(times)) == 1


def _are_split_seconds(rows: Iterable[str], columns: Columns) -> bool:
    """Whether times are whole seconds and nanoseconds since, in all rows but a damaged one."""
    others = 0
    for row in rows:
        with suppress(ValueError, IndexError):
            whole, part = (float(_cell(row, columns, column)) for column in columns.used[:2])
            others += not (whole.is_integer() and 0 <= part < 1e9)
    return others < 2


def _refuse_more_fields_than_names(names: Sequence[str], rows: Sequence[str], columns: Columns,
                                   ) -> None:
    """Refuse a table most of whose rows have more fields than the header has names."""
    named = _filled(names)
    counts: Counter[int] = Counter()
    for row in rows[:_FIRST_LINES]:
        if row.strip():
            # What stands between quotes parts no cells; blanks part them in any number.
            cells = row.split() if columns.delimiter is None else _QUOTED.sub(
                lambda quoted: quoted[0].replace(str(columns.delimiter), ''), row).split(
                    columns.delimiter)
            # An unnamed column at the end, of remarks say, has its place.
            counts[_filled(cells) if len(cells) > len(names) else named] += 1
    fields = counts.most_common(1)[0][0] if counts else 0
    if fields > named:
        advice = ('name every column, the number of the row, too, as R does with col.names=NA'
                  if fields < 2 * named else
                  'where that comes of decimal commas, write semicolons between the cells')
        raise ImuAllanError(f'the rows have {fields} fields, the header names {named}, so that '
                            f'none can be recognized by its name; {advice}')


def _filled(cells: Sequence[str]) -> int:
    """Count cells up to the last that holds anything."""
    return max((place for place, text in enumerate(cells, 1) if text.strip(QUOTES)), default=0)


def _refuse_grouped_times(rows: Iterable[str], columns: Columns) -> None:
    """Refuse whole numbers whose thousands are set apart, which read as fractions."""
    if columns.time is None:
        return
    for before, time in pairwise(_times(rows, columns)):
        whole = before.isascii() and before.isdecimal() and len(before) < 4
        if not (whole or _GROUPED.fullmatch(before)):
            return
        # As a fraction it would lie before the number that it follows.
        if (whole and _GROUPED.fullmatch(time) and int(re.sub(r'\D', '', time)) > int(before)
                and int(before) > int(re.split(r'\D', time)[0]) + 1):
            raise ImuAllanError(f'the time {time} comes after {before}: it is written with a mark '
                                'between thousands; write the times without')


def _with_known_times(columns: Columns, rows: Sequence[str], rate_hz: float | None) -> Columns:
    """Ask for the unit of times that would be no IMU's, or count where the rate is given."""
    if columns.time is None or columns.time_unit or columns.nanoseconds is not None:
        return columns
    times = []
    for text in _times(rows[:_FIRST_LINES], columns):
        with suppress(ValueError):
            times.append(float(text))
    finite = [time for time in times if np.isfinite(time)]
    # A clock that is set back says nothing of the rate.
    steps = np.sort([after - before for before, after in pairwise(finite) if after >= before])
    # A table of fewer rows is no record of anything.
    if len(steps) < 8:
        return columns
    unit = _apparent_unit(finite[0])
    # Samples of a batch may be a microsecond apart, and one outage makes no sensor slow.
    for interval, least_hz, most_hz in ((float(steps.mean()), 0.0, _FASTEST_HZ),
                                        (float(steps[:-1].mean()), _SLOWEST_HZ, np.inf)):
        if interval > 0 and not least_hz <= (
                apparent_hz := 1 / (interval * convert(1.0, unit, 's'))) <= most_hz:
            if rate_hz is not None:
                return replace(columns, time=None)
            digits = '.0f' if interval >= 1000 else '.3g'
            raise ImuAllanError(
                f'the times are {interval:{digits}} apart, which in {unit} would be '
                f'{apparent_hz:.3g} Hz, the rate of no IMU; say what they are, such as --columns '
                "'time=NAME ms' (or s, us, ns, min), or give the sample rate with --rate")
    return columns


def _apparent_unit(first: float) -> str:
    return next((unit for least, unit in _MAGNITUDES if abs(first) >= least), 's')
