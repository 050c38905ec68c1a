# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
CSV files: a header line that names the columns, then one sample a line.

Columns are ``time_s`` and any of the six axes ``gyro_x`` .. ``accel_z``, in any order, in SI units
or in the unit that the header names, such as ``gyro_x [deg/s]``.
"""

from collections.abc import Iterator
from dataclasses import dataclass
import math
from pathlib import Path
import re

from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError, printable
from imu_allan.noise.terms import AXES
from imu_allan.recordings.recording import ImuTopic, Recording
import numpy as np
from numpy.typing import NDArray

TOPIC = 'csv'
"""The name that stands for a topic."""

_PIECE = 1 << 20
_LONGEST_LINE = 1 << 16
_COLUMN = re.compile(r'\s*"?\s*([A-Za-z_0-9]+)\s*(?:\[([^\]]*)\])?\s*"?\s*')
_EXAMPLE = 'time_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z'
_LATEST_S = 9.2e9
"""Seconds that still fit into 64 bits of nanoseconds."""


@dataclass(frozen=True)
class _Columns:
    """
    What the columns of the file are.

    Attributes
    ----------
    delimiter : str
        What stands between them.
    time : int or None
        Number of the time column, and seconds in its unit.
    time_unit_s : float
        Seconds in one unit of time.
    axes : list of (int, int, float)
        Column of the file, column of the samples, factor to SI units.

    """

    delimiter: str
    time: int | None
    time_unit_s: float
    axes: list[tuple[int, int, float]]

    @property
    def used(self) -> list[int]:
        """Columns of the file that are read: time, if there is one, then axes."""
        time = [] if self.time is None else [self.time]
        return time + [column for column, _, _ in self.axes]


class CsvRecording(Recording):
    """
    A CSV file.

    Parameters
    ----------
    path, stored : Path
        The recording as the user knows it, and where its bytes are.
    rate_hz : float, optional
        Sample rate in Hz; needed without a time column.

    Raises
    ------
    ImuAllanError
        If the header line is missing or names no axis, a unit is wrong, or a rate is needed.

    """

    def __init__(self, path: Path, stored: Path, rate_hz: float | None = None) -> None:
        super().__init__(path)
        self._stored = stored
        self.size_bytes = stored.stat().st_size
        with stored.open('rb') as file:
            header = file.readline(_LONGEST_LINE)
            self._data_at = file.tell()
        self._columns = self._read_header(header.decode('utf-8-sig', 'replace'))
        if self._columns.time is None:
            if rate_hz is None:
                raise ImuAllanError(
                    f'{printable(path)}: no time_s column; give the sample rate with --rate')
            if not (math.isfinite(rate_hz) and rate_hz > 0):
                raise ImuAllanError(f'rate {rate_hz}: not a positive number of Hz')
        self._rate_hz = rate_hz
        self.topics = [ImuTopic(TOPIC, None)]

    def close(self) -> None:
        """Release nothing: each reading opens and closes the file itself."""

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read blocks, each with the bytes consumed so far; `topic` can only be `TOPIC`."""
        del topic
        rejected = samples = 0
        first_rejected = ''
        line = 2
        for text, position in self._texts():
            lines = text.split('\n')
            if lines[-1] == '':
                lines.pop()
            table, bad = _parse(lines, self._columns)
            if bad:
                first_rejected = first_rejected or (
                    f'line {line + bad[0]}: {printable(lines[bad[0]][:80])}')
                rejected += len(bad)
            line += len(lines)
            if len(table):
                yield self._block(table, samples), position
                samples += len(table)
        if rejected and not samples:
            raise ImuAllanError(
                f'{printable(self.path)}: {first_rejected} is not a line of '
                f'{len(self._columns.used)} numbers like the header says')
        if rejected:
            self.remark(
                'malformed_messages',
                f'{rejected} lines are not numbers and were left out; the first: '
                f'{first_rejected}')

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

    def _block(self, table: NDArray[np.float64], first: int) -> ImuBlock:
        columns = self._columns
        if columns.time is None:
            assert self._rate_hz is not None
            seconds = np.arange(first, first + len(table)) / self._rate_hz
        else:
            seconds = table[:, 0] * columns.time_unit_s
            table = table[:, 1:]
        stamps = np.rint(seconds * 1e9).astype(np.int64)
        samples = np.full((len(table), 6), np.nan)
        absent = np.ones((len(table), 2), np.bool_)
        for place, (_, axis, factor) in enumerate(columns.axes):
            samples[:, axis] = table[:, place] * factor
            absent[:, axis // 3] = False
        return ImuBlock(stamps, stamps, samples, absent, '')

    def _read_header(self, header: str) -> _Columns:
        path = printable(self.path)
        delimiter = next((mark for mark in (',', ';', '\t') if mark in header), ',')
        time: int | None = None
        time_unit_s = 1.0
        axes: dict[str, tuple[int, int, float]] = {}
        ignored: list[str] = []
        for column, cell in enumerate(header.rstrip('\r\n').split(delimiter)):
            match = _COLUMN.fullmatch(cell)
            name, unit = match.groups() if match else ('', None)
            if name in ('time_s', 'time'):
                if time is not None:
                    raise ImuAllanError(f'{path}: two time columns')
                time = column
                time_unit_s = self._factor(name, unit, 's')
            elif name in AXES:
                if name in axes:
                    raise ImuAllanError(f'{path}: two columns named {name}')
                axes[name] = (
                    column, list(AXES).index(name), self._factor(name, unit, AXES[name].unit))
            else:
                ignored.append(cell.strip())
        if not axes:
            raise ImuAllanError(
                f'{path}: the first line names none of the axes {", ".join(AXES)}; a CSV '
                f'recording begins with a line such as {_EXAMPLE}')
        if ignored:
            self.remark(
                'ignored_columns',
                'columns that are no axes were left out: '
                + ', '.join(printable(cell[:40]) for cell in ignored[:10]))
        return _Columns(delimiter, time, time_unit_s, list(axes.values()))

    def _factor(self, name: str, unit: str | None, si_unit: str) -> float:
        if unit is None or unit.strip() == si_unit:
            return 1.0
        from imu_allan.noise.units import convert
        try:
            return convert(1.0, unit.strip(), si_unit)
        except ImuAllanError as error:
            raise ImuAllanError(
                f'{printable(self.path)}: column {name}: {printable(error)}') from error


def _parse(lines: list[str], columns: _Columns) -> tuple[NDArray[np.float64], list[int]]:
    """
    Read the numbers of the columns used.

    Returns
    -------
    table : ndarray of float64, shape (n, columns used)
        Rows of the lines that are numbers throughout; empty cells are NaN.
    bad : list of int
        The other lines.

    """
    width = len(columns.used)
    bad: list[int] = []
    try:
        table = np.loadtxt(lines, delimiter=columns.delimiter, usecols=columns.used, ndmin=2,
                           comments=None)
        whole = len(table) == len(lines)
    except ValueError:
        whole = False
    if not whole:
        rows: list[list[float]] = []
        for number, line in enumerate(lines):
            if not line.strip():
                continue
            cells = line.split(columns.delimiter)
            try:
                rows.append([float(cells[column].strip() or 'nan') for column in columns.used])
            except (ValueError, IndexError):
                bad.append(number)
        table = np.array(rows, np.float64).reshape(-1, width)
    if columns.time is not None and len(table):
        timely = np.abs(table[:, 0] * columns.time_unit_s) < _LATEST_S
        if not timely.all():
            bad += np.flatnonzero(~timely).tolist()
            table = table[timely]
    return table, bad
