# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Logs of autopilots: records of numbers, decoded with the code for messages.

The fields with the samples are given by `imu_allan.recordings.messages.imu_fields.ImuFields`.
"""

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from typing import Any

from imu_allan.arrays import Ints
from imu_allan.block import ImuBlock
from imu_allan.cdr import record_of
from imu_allan.recordings.imu_topic import ImuTopic, MalformedMessages
from imu_allan.recordings.messages.columns import extract, time_of
from imu_allan.recordings.messages.imu_fields import ImuFields, Stamp
from imu_allan.recordings.recording import FileRecording
import numpy as np
from numpy.typing import NDArray

Records = NDArray[np.void]


class TableLog(FileRecording):
    """The log of an autopilot."""

    def add_imu(self, rate_hz: float, imu: ImuTopic, advice: str) -> None:
        """Add an IMU to `topics`, or note why it is not read and what to do."""
        # No IMU is this slow; such messages are only for monitoring.
        if rate_hz < 20.0:
            self.reasons[imu.name] = f'{rate_hz:.3g} Hz are too thin; {advice}'
            self.other_topics[imu.name] = imu.messages.type_name
        else:
            self.topics.append(imu)

    @abstractmethod
    def tables_of(self, topic: str) -> Iterator[tuple[str, Records, int]]:
        """Gather the messages of a recorded topic; yield its name, records and bytes consumed."""

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read blocks with the bytes consumed so far; the stamps serve as receive times."""
        imu = self.imu(topic)
        fields = imu.messages.fields
        assert fields is not None
        malformed = MalformedMessages()
        for name, records, position in self.tables_of(imu.topic):
            if name == imu.topic:
                # The timeline rejects values of a damaged log that are not finite.
                with np.errstate(invalid='ignore', over='ignore'):
                    columns = extract(fields, (), records, times_of(records, fields), malformed)
                    samples = columns['samples'] * np.repeat(imu.messages.factors, 3)
                times = columns['receive_ns']
                yield ImuBlock(times, times, samples, columns['absent'], ''), position
        malformed.report(imu, self.remark)


def with_elements(layout: np.dtype[Any]) -> np.dtype[Any]:
    """Add a field for each array element, such as ``name[0]`` for the first."""
    fields: dict[str, tuple[np.dtype[Any], int]] = {}
    for name, (kind, offset, *_) in (layout.fields or {}).items():
        fields[name] = kind, offset
        fields |= {f'{name}[{place}]': (kind.base, offset + place * kind.base.itemsize)
                   for place in range(kind.shape[0] if kind.shape else 0)}
    return record_of(fields, layout.itemsize)


def fastest(rates: Mapping[str, float], partner: Mapping[str, str]) -> tuple[str, ...]:
    """Choose the topic, or the gyroscope and its partner, with the highest rate."""
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


def lacking(layout: np.dtype[Any], fields: ImuFields, *others: str) -> str | None:
    """Return the first required field that is missing or not numeric; None if all are there."""
    needed = [*others, *sorted(fields.numbers() - {
        path for stamp in fields.stamps for path in stamp.paths})]
    if _stamp(layout, fields) is None:
        needed.append(fields.stamps[-1].path)
    bursts = [path for _, vector in fields.vectors() for path in vector.paths
              if fields.burst is not None]
    found: Mapping[str, Any] = layout.fields or {}
    shape = found[bursts[0]][0].shape if bursts and bursts[0] in found else ()
    return next((
        name for name in needed
        if name not in found or found[name][0].base.kind in 'SV'
        or found[name][0].shape != (shape if name in bursts else ())
        or (name in bursts and not shape)), None)


def _stamp(layout: np.dtype[Any], fields: ImuFields) -> Stamp | None:
    return next((stamp for stamp in fields.stamps if stamp.path in (layout.names or ())), None)


def times_of(records: Records, fields: ImuFields) -> Ints:
    """Return the stamps of records in nanoseconds."""
    stamp = _stamp(records.dtype, fields)
    assert stamp is not None
    return time_of(records, stamp)
