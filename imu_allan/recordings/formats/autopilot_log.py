# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Logs of autopilots: records of numbers, decoded with the code for messages.

The fields with the samples are given by `imu_allan.recordings.messages.imu_fields.ImuFields`.
"""

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from imu_allan.arrays import Ints
from imu_allan.block import ImuBlock
from imu_allan.recordings.imu_topic import ImuTopic, MalformedMessages
from imu_allan.recordings.messages.columns import extract, time_of
from imu_allan.recordings.messages.imu_fields import ImuFields, Stamp
from imu_allan.recordings.recording import FileRecording
import numpy as np
from numpy.typing import NDArray

Records = NDArray[np.void]


class TableLog(FileRecording):
    """The log of an autopilot."""

    def list_imus(self, imus: Sequence[tuple[ImuTopic, float]], partner: Mapping[str, str],
                  advice: str) -> None:
        """
        Add IMUs, given with their rates in Hz, or note why one is not read and what to do.

        Preferred is the fastest one, or the fastest gyroscope with its `partner`.
        """
        rates: dict[str, float] = {}
        for imu, rate_hz in imus:
            # No IMU is this slow; such messages are only for monitoring.
            if rate_hz < 20.0:
                self.reasons[imu.name] = f'{rate_hz:.3g} Hz are too thin; {advice}'
                self.other_topics[imu.name] = imu.messages.type_name
            else:
                self.topics.append(imu)
                rates[imu.name] = rate_hz
        choices: list[tuple[str, ...]] = []
        for name in rates:
            base, dot, number = name.partition('.')
            other = f'{partner.get(base)}{dot}{number}'
            if other in rates:
                choices.append((name, other))
            elif base not in {*partner, *partner.values()}:
                choices.append((name,))
        self.preferred = max(choices, key=lambda names: rates[names[0]], default=())

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


def lacking(layout: np.dtype[Any], fields: ImuFields, *others: str) -> str | None:
    """Return the first required field that is missing or not numeric; None if all are there."""
    needed = [*others, *sorted(fields.needed())]
    if _stamp(layout, fields) is None:
        needed.append(fields.stamps[-1].path)
    shapes = {name: kind.shape for name, (kind, *_) in (layout.fields or {}).items()
              if kind.base.kind not in 'SV'}
    bursts = [path for _, vector in fields.vectors() for path in vector.paths
              if fields.burst is not None]
    # Those of a burst are arrays of one length.
    length = shapes.get(bursts[0]) or None if bursts else None
    return next((name for name in needed if name not in shapes
                 or shapes[name] != (length if name in bursts else ())), None)


def has_temperature(layout: np.dtype[Any], fields: ImuFields) -> bool:
    """Return whether records hold the temperature, as a number."""
    thermometer = fields.thermometer()
    return thermometer is not None and lacking(layout, thermometer) is None


def _stamp(layout: np.dtype[Any], fields: ImuFields) -> Stamp | None:
    return next((stamp for stamp in fields.stamps if stamp.path in (layout.names or ())), None)


def times_of(records: Records, fields: ImuFields) -> Ints:
    """Return the stamps of records in nanoseconds."""
    stamp = _stamp(records.dtype, fields)
    assert stamp is not None
    return time_of(records, stamp)
