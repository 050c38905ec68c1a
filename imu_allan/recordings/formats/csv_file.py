# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
CSV files: a line of names, then a sample a line.

Comments may stand before it, and where it is missing the user says what the columns are. Which
names are understood stands in `imu_allan.recordings.formats.csv_header`.
"""

from codecs import BOM_UTF8
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
import csv
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError, printable
from imu_allan.recordings.formats.csv_header import (
    cells_of,
    Clock,
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

_PIECE = 1 << 20
"""Some 10,000 lines, so that numpy works on many at once; longer than any line."""
_LONGEST_HEADER = 1 << 20
"""30,000 columns with names of 30 characters: all topics of a robot in one export."""
_NAMED_COLUMNS = 10
"""Of those left out: more take more than a line or two."""
_LOOKED_AT = 1 << 16
"""Bytes of samples by which the times are judged."""
_FIRST_LINES = 64
"""By which fields are counted and times without a unit judged: two batches of a FIFO of 32."""
_LATEST_S = 9.2e9
"""Seconds that still fit into 64 bits of nanoseconds."""
_NO_TIME = -2**63
"""In place of an empty cell: no stamp is as early."""
_MAGNITUDES = ((1e17, 'ns'), (1e14, 'us'), (1e11, 'ms'))
"""From which number on a time is in a unit, if it is one of this century: 1e9 is 2001 in s."""
_FEWEST_STEPS = 8
"""Below, a table is no record of anything."""
_SLOWEST_HZ, _FASTEST_HZ = 5.0, 20_000.0
"""Rates of IMUs; beyond, times without a unit are in another one than they seem to be."""


class CsvRecording(FileRecording):
    """A CSV file; raises ImuAllanError where its header names no axis, or a rate is needed."""

    def __init__(self, path: Path, stored: Path, options: RecordingOptions) -> None:
        super().__init__(path, stored, options)
        self._clock: Clock | None = None
        try:
            self._columns = self._found_columns()
        except ImuAllanError as error:
            raise ImuAllanError(f'{printable(path)}: {error}') from error
        self.topics = [ImuTopic(NO_TOPIC, None)]
        if self._columns.temperature is not None:
            self.thermometers = [
                ImuTopic(f'{NO_TOPIC}:{options.temperature or "temperature"}', None)]

    @property
    def sensors(self) -> list[str]:
        """Which sensors have columns in it: 'gyro', 'accel' or both."""
        return sorted({'gyro' if axis < 3 else 'accel' for _, axis, _ in self._columns.axes})

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read blocks, each with the bytes consumed so far."""
        columns = self._columns
        if topic != NO_TOPIC and columns.temperature is not None:
            # A thermometer may be slower than the samples, its cells empty most of the time.
            columns = replace(columns, axes=((columns.temperature, 0, 1.0),), ignored=('axes',))
        rejected = samples = 0
        first_rejected = ''
        line = self._first_line
        for text, position in self._texts():
            lines = self._with_points(text).split('\n')
            if lines[-1] == '':
                lines.pop()
            table, stamps, bad = self._parse(lines, columns)
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

    def _with_points(self, text: str) -> str:
        """Write decimal commas as points."""
        return text if self._columns.delimiter == ',' else text.replace(',', '.')

    def _parse(self, lines: list[str], columns: Columns,
               ) -> tuple[NDArray[np.float64], NDArray[np.int64] | None, list[int]]:
        """
        Read the numbers of the columns used.

        Returns
        -------
        table : ndarray of float64, shape (n, axes)
            Rows of the lines that are numbers throughout; empty cells are NaN. A row without any
            number is left out where there are other columns: it belongs to another topic.
        stamps : ndarray of int64, shape (n,), or None
            In nanoseconds; None without a time column.
        bad : list of int
            The other lines, in order.

        """
        clock = self._clock
        # A double has not enough digits for the nanoseconds of today.
        exact = clock is not None and clock.unit == 'ns' and self._whole_times
        used, fields = [], []
        if clock is not None:
            used.append(clock.column)
            fields.append(('time', np.int64 if exact else np.float64, ()))
            if clock.nanoseconds is not None:
                used.append(clock.nanoseconds)
                fields.append(('part', np.float64, ()))
        table, places, bad = _numbers(
            lines, columns.delimiter, [*used, *(column for column, _, _ in columns.axes)],
            np.dtype([*fields, ('axes', np.float64, (len(columns.axes),))]))
        axes = table['axes']
        if clock is None:
            return axes, None, bad
        times = table['time']
        unit_s = convert(1.0, str(clock.unit), 's')
        timely = np.abs(times * unit_s) < _LATEST_S
        some = np.ones_like(timely)
        if clock.nanoseconds is not None:
            # Of a total, the first second looks like nanoseconds since a whole one.
            timely &= (np.floor(times) == times) & ~(
                (table['part'] < 0) | (table['part'] >= 1e9))
        if columns.ignored:
            some &= ~np.isnan(axes).all(axis=1)
        if not timely.all():
            # A row without any number may have no time of this topic either.
            bad = sorted([*bad, *places[some & ~timely].tolist()])
        some &= timely
        stamps = np.zeros(len(times), np.int64)
        stamps[timely] = times[timely] if exact else np.rint(times[timely] * (unit_s * 1e9))
        if clock.nanoseconds is not None:
            stamps += np.nan_to_num(table['part']).astype(np.int64)
        return axes[some], stamps[some], bad

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
        """Find the header line and understand it; sets where the samples begin, and the clock."""
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
        self._columns = columns = echoed_imu(header) or read_header(header, options)
        below = after.partition(b'\n')[0]
        units = with_units_below(header, below.decode('utf-8', 'replace'), columns)
        if units is not None:
            self._columns = columns = read_header(units, options)
            behind += len(below) + 1
            self._first_line += 1
        if not columns.headless:
            self._data_at, self._first_line = behind, self._first_line + 1
        elif line.startswith(BOM_UTF8):
            self._data_at += len(BOM_UTF8)
        rows = self._with_points(after.decode('utf-8', 'replace')).split('\n')
        if columns.headless:
            rows.insert(0, self._with_points(header))
        cells = [list(_cells(row, columns.delimiter)) for row in rows if row.strip()]
        if not columns.headless:
            _refuse_more_fields_than_names(cells_of(header)[1], cells)
        self._clock = _chosen_clock(columns, cells, options.rate_hz)
        self._whole_times = self._clock is not None and all(
            text.isdecimal() for text in _column(cells, self._clock.column))
        self._tell_ignored()
        if self._clock is None and options.rate_hz is None:
            raise ImuAllanError('no time_s column; give the sample rate with --rate, or say '
                                "which column is the time: --columns 'time=NAME ms'")
        return columns

    def _tell_ignored(self) -> None:
        ignored = [cell for cell in self._columns.ignored if cell and not is_rest_of_imu(cell)]
        if ignored:
            self.remark('ignored_columns', count=len(ignored),
                        perhaps_axes=len(self.sensors) < 2 and not self.options.columns,
                        columns=[printable(cell[:40]) for cell in ignored[:_NAMED_COLUMNS]])


def _numbers(lines: list[str], delimiter: str | None, used: Sequence[int],
             record: np.dtype[np.void],
             ) -> tuple[NDArray[np.void], NDArray[np.intp], list[int]]:
    """Read columns as records; returns also from which lines, and which others are not empty."""
    with suppress(ValueError):
        table: NDArray[np.void] = np.loadtxt(
            lines, record, delimiter=delimiter, usecols=used, ndmin=1, comments=None,
            quotechar='"')
        if len(table) == len(lines):
            return table, np.arange(len(lines)), []
    rows, places, bad = [], [], []
    alone = len(record.names or ()) - 1
    reads = [_whole_time if record[0] == np.int64 else float, *[float] * (len(used) - 1)]
    for number, line in enumerate(lines):
        if not line.strip():
            continue
        cells = list(_cells(line, delimiter))
        try:
            values = [read(cells[column] or 'nan')
                      for read, column in zip(reads, used, strict=True)]
        except (ValueError, IndexError):
            bad.append(number)
            continue
        rows.append((*values[:alone], values[alone:]))
        places.append(number)
    return np.array(rows, record), np.array(places, np.intp), bad


def _whole_time(text: str) -> int:
    """Read nanoseconds; raises ValueError where they are no whole number of 63 bits."""
    number = _NO_TIME if text == 'nan' else int(text)
    if not -2**63 <= number < 2**63:
        raise ValueError('no time')
    return number


def _cells(line: str, delimiter: str | None) -> Iterator[str]:
    """Take a line apart, without what stands about the text of its cells; none of a broken one."""
    with suppress(csv.Error):
        for row in [line.split()] if delimiter is None else csv.reader(
                [line.rstrip('\r')], delimiter=delimiter):
            yield from (cell.strip(QUOTES) for cell in row)


# ------------------------------------------------------------ whether the first rows are plausible

def _column(cells: Sequence[Sequence[str]], column: int) -> list[str]:
    """Return the cells of a column that hold anything."""
    return [row[column] for row in cells if len(row) > column and row[column]]


def _refuse_more_fields_than_names(names: Sequence[str], cells: Sequence[Sequence[str]]) -> None:
    """Refuse a table most of whose rows have more fields than the header has names."""
    named = _filled(names)
    # An unnamed column at the end, of remarks say, has its place.
    counts = Counter(_filled(row) if len(row) > len(names) else named
                     for row in cells[:_FIRST_LINES])
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


def _chosen_clock(columns: Columns, cells: Sequence[Sequence[str]], rate_hz: float | None,
                  ) -> Clock | None:
    """Choose the first clock that moves, with its unit; None where samples are to be counted."""
    clocks = [clock for clock in columns.clocks if _is_clock(clock, cells)]
    if not clocks:
        return None
    # A driver may leave its stamps zero.
    clock = next((each for each in clocks
                  if len({*_column(cells[:_FIRST_LINES], each.column)}) > 1), clocks[0])
    if clock.unit is not None:
        return clock
    times = []
    for text in _column(cells[:_FIRST_LINES], clock.column):
        with suppress(ValueError):
            times.append(float(text))
    finite = [time for time in times if np.isfinite(time)]
    unit = next((unit for least, unit in _MAGNITUDES if finite and abs(finite[0]) >= least), 's')
    # A clock that is set back says nothing of the rate.
    steps = np.sort([after - before for before, after in pairwise(finite) if after >= before])
    if len(steps) < _FEWEST_STEPS:
        return replace(clock, unit=unit)
    # Samples of a batch may be a microsecond apart, and one outage makes no sensor slow.
    for interval, least_hz, most_hz in ((float(steps.mean()), 0.0, _FASTEST_HZ),
                                        (float(steps[:-1].mean()), _SLOWEST_HZ, np.inf)):
        if interval > 0 and not least_hz <= (
                apparent_hz := 1 / (interval * convert(1.0, unit, 's'))) <= most_hz:
            if rate_hz is not None:
                return None
            digits = '.0f' if interval >= 1000 else '.3g'
            raise ImuAllanError(
                f'the times are {interval:{digits}} apart, which in {unit} would be '
                f'{apparent_hz:.3g} Hz, the rate of no IMU; say what they are, such as --columns '
                "'time=NAME ms' (or s, us, ns, min), or give the sample rate with --rate")
    return replace(clock, unit=unit)


def _is_clock(clock: Clock, cells: Sequence[Sequence[str]]) -> bool:
    """Whether a pair is whole seconds and nanoseconds since, in all rows but a damaged one."""
    if clock.nanoseconds is None:
        return True
    others = 0
    for row in cells:
        with suppress(ValueError, IndexError):
            whole, part = float(row[clock.column]), float(row[clock.nanoseconds])
            others += not (whole.is_integer() and 0 <= part < 1e9)
    return others < 2
