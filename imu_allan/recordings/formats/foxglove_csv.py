# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Plot data exported from Foxglove (and Lichtblick, webviz): a CSV file with one number a line.

A line is ``elapsed time,receive time,header.stamp,topic,value``, its topic a message path such as
``/imu.angular_velocity.x``; the lines of a path follow each other, so a message is whole only when
the file has been read to its end.
"""

from array import array
from collections.abc import Iterator
from pathlib import Path
from typing import TypeAlias

from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError, printable
from imu_allan.noise.terms import AXES
from imu_allan.recordings.formats.csv_header import meaning_of
from imu_allan.recordings.imu_topic import ImuTopic
from imu_allan.recordings.options import RecordingOptions
from imu_allan.recordings.recording import FileRecording
import numpy as np

HEADER = b'receive time,header.stamp,topic,value'
"""How the first line ends; what stands before is the x axis of the plot."""

_LONGEST_LINE = 4096
"""Bytes: a value, two stamps and a message path; the rest of a longer line is another one."""
_BLOCK = 1 << 14
"""Rows at a time, 1 MB: 16 s at 1 kHz."""


_Series: TypeAlias = 'tuple[array[int], array[int], array[float]]'


class FoxgloveCsv(FileRecording):
    """Plot data; raises ImuAllanError where no path in it is an axis of an IMU."""

    def __init__(self, path: Path, stored: Path, options: RecordingOptions) -> None:
        super().__init__(path, stored, options)
        series = self._series()
        for topic in sorted({topic for topic, _ in series}):
            longest = max(len(found[2]) for (name, _), found in series.items() if name == topic)
            self.topics.append(ImuTopic(topic, longest))
        if not self.topics:
            raise ImuAllanError(
                f'{printable(path)}: no path in it is an axis of an IMU; plot paths such as '
                '/imu.angular_velocity.x and export them')

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Put the axes of a topic together by receive time; each block with its share of bytes."""
        series = {axis: [np.array(values) for values in found]
                  for (name, axis), found in self._series().items() if name == topic}
        # Messages that came at once share a receive time, not a stamp.
        moments, rows = np.unique(
            np.concatenate([np.stack(found[:2], axis=1) for found in series.values()]),
            axis=0, return_inverse=True)
        receive, header = np.ascontiguousarray(moments.T)
        rows = rows.reshape(-1)     # numpy 2.0 alone gives a column
        samples = np.full((len(receive), 6), np.nan)
        absent = np.ones((len(receive), 2), np.bool_)
        merged = 0
        for axis, (_, _, values) in series.items():
            place, rows = np.split(rows, [len(values)])
            merged = max(merged, len(values) - len(np.unique(place)))
            samples[place, axis] = values * self.options.factors[axis // 3]
            absent[:, axis // 3] = False
        if merged:
            self.remark('merged_messages', count=merged)
        for start in range(0, len(receive), _BLOCK):
            part = slice(start, start + _BLOCK)
            yield (ImuBlock(header[part], receive[part], samples[part], absent[part], ''),
                   self.size_bytes * start // len(receive))

    def _series(self) -> 'dict[tuple[str, int], _Series]':
        """Read receive times, header stamps and values, by topic and number of the axis."""
        series: dict[tuple[str, int], _Series] = {}
        known: dict[bytes, _Series | None] = {}
        malformed = 0
        with self._stored.open('rb') as file:
            file.readline(_LONGEST_LINE)
            while line := file.readline(_LONGEST_LINE):
                cells = line.strip().rsplit(b',', 4)
                try:
                    _, received, stamped, path, value = cells
                    # A plot has a dozen series.
                    if path not in known and len(known) < 1000:
                        place = _place(path.decode('utf-8', 'replace').strip('"'))
                        known[path] = None if place is None else series.setdefault(
                            place, (array('q'), array('q'), array('d')))
                    found = known.get(path)
                    if found is not None:
                        times = _nanoseconds(received), _nanoseconds(stamped or b'0')
                        found[2].append(float(value))
                        found[0].append(times[0])
                        found[1].append(times[1])
                except (ValueError, OverflowError):
                    malformed += bool(line.strip())
        if malformed:
            self.remark('malformed_messages', what='line', count=malformed)
        return series


def _place(path: str) -> tuple[str, int] | None:
    """Split a message path into topic and number of the axis; None where it is no axis."""
    meaning = meaning_of(path)
    if meaning not in AXES or '.' not in path:
        return None
    return path.split('.')[0], list(AXES).index(meaning)


def _nanoseconds(text: bytes) -> int:
    """Read seconds with nine decimals exactly: a double has not enough digits."""
    seconds, _, fraction = text.strip(b'"').partition(b'.')
    number = int(seconds)
    # Up to the year 2242 the nanoseconds of a stamp fit into 63 bits.
    if not 0 <= number < 1 << 33:
        raise ValueError('no time')
    return number * 10**9 + int(fraction[:9].ljust(9, b'0'))


def is_foxglove(head: bytes) -> bool:
    """Whether a file begins like one."""
    first = head.partition(b'\n')[0].strip().replace(b'"', b'')
    return first.endswith(HEADER)
