# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
CSV files: a line of names, then a sample a line; in one class as lines say how lines are read.

Comments may stand before it, and where it is missing the user says what the columns are. Which
names are understood stands in `imu_allan.recordings.formats.csv_header`.
"""

from codecs import BOM_UTF8
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import compress
from pathlib import Path
import re

from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError, printable
from imu_allan.recordings.formats.csv_cells import cell, cells_of, filled_cells, QUOTES
from imu_allan.recordings.formats.csv_header import (
    Columns,
    echoed_imu,
    is_remark,
    MOST_COMMENTS,
    read_header,
    with_units_below,
)
from imu_allan.recordings.formats.csv_names import is_rest_of_imu
from imu_allan.recordings.formats.csv_rows import (
    are_split_seconds,
    QUOTED_COMMA,
    refuse_grouped_times,
    refuse_more_fields_than_names,
)
from imu_allan.recordings.formats.csv_times import interval_of_no_imu, seconds_in
from imu_allan.recordings.formats.csv_written_times import written_time, WrittenTimes
from imu_allan.recordings.imu_topic import ImuTopic
from imu_allan.recordings.options import RecordingOptions
from imu_allan.recordings.recording import FileRecording
from imu_allan.wording import NO_TOPIC
import numpy as np
from numpy.typing import NDArray

TOPIC = NO_TOPIC
"""The name that stands for a topic."""

_PIECE = 1 << 20
"""Some 10,000 lines, so that numpy works on many at once; longer than any line."""
_LONGEST_HEADER = 1 << 20
"""30,000 columns with names of 30 characters: all topics of a robot in one export."""
_NAMED_COLUMNS = 10
"""Of those left out: more take more than a line or two."""
_LOOKED_AT = 1 << 16
"""Bytes of samples in which decimal commas are sought: the first ones may all be zero."""
_FIRST_LINES = 64
"""By which times without a unit are judged: two batches of a FIFO of 32."""
_DECIMAL_COMMA = re.compile(r'(?<![\d,])-?\d+,\d+(?![\d,])')
_LATEST_S = 9.2e9
"""Seconds that still fit into 64 bits of nanoseconds."""


class CsvRecording(FileRecording):
    """
    A CSV file.

    Parameters
    ----------
    path, stored : Path
        The recording as the user knows it, and where its bytes are.
    options : RecordingOptions
        With the sample rate, which is needed without a time column.

    Raises
    ------
    ImuAllanError
        If the header line is missing or names no axis, a unit is wrong, or a rate is needed.

    """

    def __init__(self, path: Path, stored: Path, options: RecordingOptions) -> None:
        super().__init__(path, stored, options)
        self._columns = self._found_columns()
        if self._columns.time is None and options.rate_hz is None:
            raise ImuAllanError(
                f'{printable(path)}: no time_s column; give the sample rate with --rate, or say '
                "which column is the time: --columns 'time=NAME ms'")
        self._rate_hz = options.rate_hz
        self.topics = [ImuTopic(TOPIC, None)]
        if self._columns.temperature is not None:
            self.thermometers = [
                ImuTopic(f'{TOPIC}:{options.temperature or "temperature"}', None)]

    @property
    def sensors(self) -> list[str]:
        """Which sensors have columns in it: 'gyro', 'accel' or both."""
        return sorted({'gyro' if axis < 3 else 'accel' for _, axis, _ in self._columns.axes})

    def span_ns(self) -> tuple[int, int] | None:
        """Return the least and the greatest stamp at its two ends; None where there are none."""
        columns = self._columns
        if columns.time is None:
            return None
        written = WrittenTimes(columns.delimiter, columns.time) if columns.written else None
        found: list[int] = []
        unit_s: float | None = None
        with self._stored.open('rb') as file:
            for start in (self._data_at, max(self._data_at, self.size_bytes - _LOOKED_AT)):
                file.seek(start)
                data = file.read(_LOOKED_AT)
                # Part of a number is another one.
                lines = self._with_points(data.decode('utf-8', 'replace')).split('\n')[
                    start > self._data_at:None if file.tell() == self.size_bytes else -1]
                _, stamps, unit_s, _ = _parse(
                    lines if written is None else written.counted(lines), columns, unit_s)
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
        written = (WrittenTimes(columns.delimiter, columns.time)
                   if columns.written and columns.time is not None else None)
        for text, position in self._texts():
            lines = self._with_points(text).split('\n')
            if lines[-1] == '':
                lines.pop()
            table, stamps, time_unit_s, bad = _parse(
                lines if written is None else written.counted(lines), columns, time_unit_s)
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

    def _with_known_times(self, columns: Columns, samples: str) -> Columns:
        """Ask for the unit of times that would be no IMU's, or count where the rate is given."""
        if _are_written(samples.split('\n')[:_FIRST_LINES], columns):
            return replace(columns, time_unit='ns', written=True)
        found = interval_of_no_imu(
            _first_times(samples.split('\n')[:_FIRST_LINES], columns))
        if found is None:
            return columns
        if self.options.rate_hz is not None:
            return replace(columns, time=None)
        interval, unit, rate_hz = found
        digits = '.0f' if interval >= 1000 else '.3g'
        raise ImuAllanError(
            f'{printable(self.path)}: the times are {interval:{digits}} apart, which in {unit} '
            f'would be {rate_hz:.3g} Hz, the rate of no IMU; say what they are, such as --columns '
            "'time=NAME ms' (or s, us, ns, min), or give the sample rate with --rate")

    def _texts(self) -> Iterator[tuple[str, int]]:
        """Read whole lines, about a MiB at a time, with the bytes consumed so far."""
        rest = b''
        position = self._data_at
        with self._stored.open('rb') as file:
            file.seek(position)
            while data := file.read(_PIECE):
                position += len(data)
                lines, newline, end = data.rpartition(b'\n')
                if newline:
                    yield (rest + lines + newline).decode('utf-8', 'replace'), position
                    rest = end
                else:
                    rest += end
                if len(rest) > _PIECE:
                    raise ImuAllanError(
                        f'{printable(self.path)}: a line ending at byte {position} is longer '
                        f'than {_PIECE} bytes; not a CSV file of samples')
        if rest:
            yield rest.decode('utf-8', 'replace'), position

    def _block(self, table: NDArray[np.float64], stamps: NDArray[np.int64] | None,
               first: int, columns: Columns) -> ImuBlock:
        if stamps is None:
            assert self._rate_hz is not None
            seconds = np.arange(first, first + len(table)) / self._rate_hz
            stamps = np.rint(seconds * 1e9).astype(np.int64)
        samples = np.full((len(table), 6), np.nan)
        absent = np.ones((len(table), 2), np.bool_)
        for place, (_, axis, factor) in enumerate(columns.axes):
            samples[:, axis] = table[:, place] * factor
            absent[:, axis // 3] = False
        return ImuBlock(stamps, stamps, samples, absent, '')

    def _found_columns(self) -> Columns:
        """Find the header line and understand it; sets where the samples begin."""
        with self._stored.open('rb') as file:
            for number in range(1, MOST_COMMENTS + 2):
                self._data_at, self._first_line = file.tell(), number
                line = file.readline(_LONGEST_HEADER)
                if len(line) == _LONGEST_HEADER and not line.endswith(b'\n'):
                    raise ImuAllanError(f'{printable(self.path)}: line {number} is longer than '
                                        '1 MiB: it is no table of samples')
                header = line.decode('utf-8-sig', 'replace')
                if not is_remark(header, self.options):
                    break
            behind, after = file.tell(), file.read(_LOOKED_AT)
        columns = echoed_imu(header) or self._read_header(header)
        below, newline, rest = after.decode('utf-8', 'replace').partition('\n')
        try:
            units = with_units_below(header, below, columns, self.options)
        except ImuAllanError as error:
            raise ImuAllanError(f'{printable(self.path)}: {error}') from error
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
                              and QUOTED_COMMA.search(samples) is not None)
        samples = self._with_points(samples)
        rows = samples.split('\n')
        if not (columns.headless or columns.nanoseconds is None or are_split_seconds(
                rows, columns.delimiter, *columns.used[:2])):
            columns = self._read_header(header, split=False)
        if columns.stamped and _stand_still(rows[:_FIRST_LINES], columns):
            other = self._read_header(header, stamped=False)
            columns = columns if other.time is None else other
        try:
            if not columns.headless:
                refuse_more_fields_than_names(cells_of(header)[1], columns.delimiter, rows)
            if columns.time is not None:
                refuse_grouped_times(rows, columns.delimiter, columns.time)
        except ImuAllanError as error:
            raise ImuAllanError(f'{printable(self.path)}: {error}') from error
        columns = self._with_known_times(columns, samples)
        self._tell_ignored(columns)
        return columns

    def _with_points(self, text: str) -> str:
        """Write decimal commas as points."""
        if self._quoted_comma:
            return QUOTED_COMMA.sub(r'\1.\2', text)
        return text.replace(',', '.') if self._decimal_comma else text

    def _read_header(self, header: str, split: bool = True, stamped: bool = True) -> Columns:
        try:
            return read_header(header, self.options, self.path.name, split, stamped)
        except ImuAllanError as error:
            raise ImuAllanError(f'{printable(self.path)}: {error}') from error

    def _tell_ignored(self, columns: Columns) -> None:
        if columns.by_file_name is not None:
            self.remark('guessed_columns', sensor=columns.by_file_name)
        if columns.lookalikes:
            self.remark('ignored_columns', perhaps_axes=True,
                        columns=_first(columns.lookalikes), count=len(columns.lookalikes))
        alike = {*columns.lookalikes}
        others = [cell for cell in columns.ignored
                  if cell and cell not in alike and not is_rest_of_imu(cell)]
        if others:
            self.remark('ignored_columns', perhaps_axes=False, columns=_first(others),
                        count=len(others))


def _first(cells: Sequence[str]) -> list[str]:
    """Name the first of some columns."""
    return [printable(cell[:40]) for cell in cells[:_NAMED_COLUMNS]]


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
    width = len(columns.used)
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
        table = np.array(rows, np.float64).reshape(-1, width)
        places = np.array(numbers, np.intp)
    if columns.time is None:
        return table, None, None, bad
    times = table[:, 0]
    known = np.isfinite(times)
    if time_unit_s is None and known.any():
        time_unit_s = seconds_in(columns.time_unit, float(times[known][0]))
    unit = time_unit_s or 1.0
    timely = np.abs(times * unit) < _LATEST_S
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


def _stand_still(lines: Sequence[str], columns: Columns) -> bool:
    """Whether the times of many lines are one: a driver leaves its stamps zero."""
    assert columns.time is not None
    times = list(filled_cells(lines, columns.delimiter, columns.time))
    return len(times) > 1 and len(set(times)) == 1


def _are_written(lines: Sequence[str], columns: Columns) -> bool:
    """Whether the first time of all is a date, or a time of day."""
    if columns.time is None or columns.nanoseconds is not None:
        return False
    first = next(filled_cells(lines, columns.delimiter, columns.time), '')
    return written_time(first) is not None


def _first_times(lines: Sequence[str], columns: Columns) -> NDArray[np.float64]:
    """Read the times alone, those that are numbers; none where their unit is known."""
    times = []
    if columns.time is not None and columns.time_unit is None and columns.nanoseconds is None:
        for text in filled_cells(lines, columns.delimiter, columns.time):
            with suppress(ValueError):
                times.append(float(text))
    return np.array(times)


def _exact(lines: Iterable[str], columns: Columns) -> NDArray[np.int64] | None:
    """Read nanoseconds as whole numbers: a double has not enough digits for those of today."""
    assert columns.time is not None
    try:
        return np.array([int(cell(line, columns.delimiter, columns.time)) for line in lines],
                        np.int64)
    except (ValueError, OverflowError):
        return None
