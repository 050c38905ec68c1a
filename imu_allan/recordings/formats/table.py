# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The columns of a log of an autopilot to blocks of samples.

A table is one array of equal length a column. Which columns are the samples, and how they are
scaled, is said by `imu_allan.recordings.messages.imu_fields`, and they are turned into SI units by
`imu_allan.recordings.messages.values`, both as for messages.
"""

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from typing import Any

from imu_allan.block import ImuBlock
from imu_allan.cdr import MalformedImu
from imu_allan.recordings.imu_topic import MalformedMessages
from imu_allan.recordings.messages.forms import OnMalformed
from imu_allan.recordings.messages.imu_fields import ImuFields, Vector
from imu_allan.recordings.messages.values import to_si, unrolled, unsound
from imu_allan.recordings.recording import FileRecording
import numpy as np
from numpy.typing import NDArray

Table = Mapping[str, NDArray[Any]]


class TableLog(FileRecording):
    """The log of an autopilot."""

    @abstractmethod
    def tables_of(self, topic: str) -> Iterator[tuple[str, Table, int]]:
        """Gather the messages of a topic that is recorded: its name, columns, bytes consumed."""

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read blocks, each with the bytes consumed so far."""
        imu = self.imu(topic)
        fields = imu.messages.fields
        assert fields is not None
        factors = np.repeat(imu.messages.factors, 3)
        malformed = MalformedMessages()
        for name, table, position in self.tables_of(imu.topic):
            if name == imu.topic:
                yield table_block(table, fields, factors, malformed), position
        malformed.report(imu, self.remark)


def columns_of(rows: NDArray[Any]) -> Table:
    """Take records apart; ``name[0]`` is the first element of arrays."""
    columns = {}
    for name in rows.dtype.names or ():
        column = rows[name]
        if column.ndim == 1:
            columns[name] = column
        else:
            columns |= {f'{name}[{place}]': column[:, place] for place in range(column.shape[1])}
    return columns


def fastest(rates: Mapping[str, float], partner: Mapping[str, str]) -> tuple[str, ...]:
    """Choose the topic, or gyroscope with its partner, that has the highest rate."""
    choices: dict[tuple[str, ...], float] = {}
    for name, rate in rates.items():
        base, dot, number = name.partition('.')
        if base in partner:
            other = f'{partner[base]}{dot}{number}'
            if other in rates:
                choices[name, other] = rate
        elif base not in partner.values():
            choices[(name,)] = rate
    return max(choices, key=lambda names: choices[names], default=())


def lacking(table: Table, fields: ImuFields, *others: str) -> str | None:
    """Return the first column that is needed and not there, or no number; None if none is."""
    needed = [*others]
    for _, vector in fields.vectors():
        needed += [f'{path}[0]' if fields.burst else path for path in vector.paths]
        needed += [name for name in (vector.scale, vector.per) if name]
    if fields.burst is not None:
        needed += [fields.burst.samples, fields.burst.step_us]
    if not any(stamp.path in table for stamp in fields.stamps):
        needed.append(fields.stamps[-1].path)
    # The elements of x are counted, and y and z have as many.
    width = _width(table, fields) if fields.burst is not None else 0
    needed += [f'{path}[{number}]' for _, vector in fields.vectors() for path in vector.paths
               for number in range(width)]
    return next((name for name in needed if name not in table or table[name].dtype.kind in 'SV'),
                None)


def table_times(table: Table, fields: ImuFields) -> NDArray[np.int64]:
    """Return the times of all samples in nanoseconds."""
    stamp = next(stamp for stamp in fields.stamps if stamp.path in table)
    times = table[stamp.path].astype(np.int64) * stamp.unit_ns
    if fields.burst is None:
        return times
    before, filled, _ = unrolled(fields.burst, _width(table, fields), table.__getitem__)
    return (times[:, np.newaxis] - before)[filled]


def table_block(table: Table, fields: ImuFields, factors: NDArray[np.float64],
                on_malformed: OnMalformed) -> ImuBlock:
    """Return all samples of a table; the stamps are the receive time, too."""
    times = table_times(table, fields)
    samples = np.zeros((len(times), 6))
    absent = np.ones((len(times), 2), np.bool_)
    # What is not finite in a damaged log is rejected by the timeline.
    with np.errstate(invalid='ignore', over='ignore'):
        for first, vector in fields.vectors():
            samples[:, first:first + 3] = _vector(table, fields, vector, on_malformed)
            absent[:, first // 3] = False
        samples *= factors
    return ImuBlock(times, times, samples, absent, '')


def _width(table: Table, fields: ImuFields) -> int:
    [(_, vector)] = fields.vectors()
    return sum(name.startswith(f'{vector.paths[0]}[') for name in table)


def _vector(table: Table, fields: ImuFields, vector: Vector, on_malformed: OnMalformed,
            ) -> NDArray[np.float64]:
    """Return the numbers of a vector in SI units, shape (n, 3)."""
    column = table.__getitem__
    if fields.burst is None:
        values = np.stack([table[path] for path in vector.paths], axis=1).astype(np.float64)
        to_si(values, vector, column)
        return values
    width = _width(table, fields)
    _, filled, sound = unrolled(fields.burst, width, column)
    if not sound.all():
        on_malformed(int((~sound).sum()), MalformedImu(unsound(fields.burst, width)))
    bursts = np.stack([[table[f'{path}[{number}]'] for number in range(width)]
                       for path in vector.paths]).astype(np.float64).transpose(2, 1, 0)
    to_si(bursts, vector, column)
    return bursts[filled]
