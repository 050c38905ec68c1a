# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Plot data exported from Foxglove (and Lichtblick, webviz): a CSV file with one number per line.

A line is ``elapsed time,receive time,header.stamp,topic,value``, where the topic is a message path
such as ``/imu.angular_velocity.x``. All lines of one path come together, so messages are complete
only after the whole file has been read.
"""

from array import array
from collections import defaultdict
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any

from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError, printable
from imu_allan.noise.terms import AXES
from imu_allan.recordings.formats.csv_header import meaning_of
from imu_allan.recordings.imu_topic import ImuTopic
from imu_allan.recordings.options import RecordingOptions
from imu_allan.recordings.recording import FileRecording
import numpy as np


class FoxgloveCsv(FileRecording):
    """Plot data; raises ImuAllanError if no path is an axis of an IMU."""

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
        """Join the axes of a topic by time; yield blocks, each with its share of the bytes."""
        series = {axis: [np.array(values) for values in found]
                  for (name, axis), found in self._series().items() if name == topic}
        # Messages that arrive together share a receive time, but not a header stamp.
        moments, rows = np.unique(
            np.concatenate([np.stack(found[:2], axis=1) for found in series.values()]),
            axis=0, return_inverse=True)
        receive, header = np.ascontiguousarray(moments.T)
        rows = rows.reshape(-1)     # numpy 2.0 alone returns a column
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
        # 1 MB: 16 s at 1 kHz
        at_a_time = 1 << 14
        for start in range(0, len(receive), at_a_time):
            part = slice(start, start + at_a_time)
            yield (ImuBlock(header[part], receive[part], samples[part], absent[part], ''),
                   self.size_bytes * start // len(receive))

    def _series(self) -> 'dict[tuple[str, int], list[array[Any]]]':
        """Read receive times, header stamps and values, keyed by topic and axis index."""
        series: dict[tuple[str, int], list[array[Any]]] = defaultdict(
            lambda: [array('q'), array('q'), array('d')])
        malformed = 0
        # Enough for a value, two stamps and a message path. The rest of a longer line is read as
        # another line.
        longest = 4096
        with self._stored.open('rb') as file:
            file.readline(longest)
            while line := file.readline(longest):
                try:
                    _, received, stamped, path, value = line.strip().rsplit(b',', 4)
                    if (place := _place(path)) is not None:
                        numbers = (_nanoseconds(received), _nanoseconds(stamped or b'0'),
                                   float(value))
                        for column, number in zip(series[place], numbers, strict=True):
                            column.append(number)
                except (ValueError, OverflowError):
                    malformed += bool(line.strip())
        if malformed:
            self.remark('malformed_messages', what='line', count=malformed)
        return series


@lru_cache(maxsize=1000)
def _place(path: bytes) -> tuple[str, int] | None:
    """Split a message path into topic and axis index; return None if it is not an axis."""
    text = path.decode('utf-8', 'replace').strip('"')
    meaning = meaning_of(text)
    if meaning not in AXES or '.' not in text:
        return None
    return text.split('.')[0], list(AXES).index(meaning)


def _nanoseconds(text: bytes) -> int:
    """Parse seconds with nine decimals exactly, since a double has too few digits."""
    seconds, _, fraction = text.strip(b'"').partition(b'.')
    number = int(seconds)
    # Nanoseconds up to the year 2242 fit into 63 bits.
    if not 0 <= number < 1 << 33:
        raise ValueError('no time')
    return number * 10**9 + int(fraction[:9].ljust(9, b'0'))


def is_foxglove(head: bytes) -> bool:
    """Return whether a file begins like plot data."""
    # The name of the first column depends on the x axis of the plot.
    return head.partition(b'\n')[0].strip().replace(b'"', b'').endswith(
        b'receive time,header.stamp,topic,value')
