# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
PX4 logs (.ulg), read one megabyte at a time.

IMU topics have the fields of px4_msgs, so they are read as
`imu_allan.recordings.messages.known_types` specifies.

References
----------
PX4 Guide, ULog File Format: a header of 16 bytes, then messages with size, type and body. Formats
(F) define the fields of a topic, subscriptions (A) assign its number, and data (D) begin with that
number. Reading resumes after damage at synchronization messages (S), which occur now and then.

"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
import re
from struct import Struct
from typing import Any

from imu_allan.cdr import record_of
from imu_allan.recordings.formats.autopilot_log import (
    has_temperature,
    lacking,
    Records,
    TableLog,
    times_of,
)
from imu_allan.recordings.imu_topic import ImuTopic
from imu_allan.recordings.messages.decoder import ImuMessages
from imu_allan.recordings.messages.known_types import KNOWN
from imu_allan.recordings.options import RecordingOptions
import numpy as np

_TYPES = {
    'sensor_combined': 'SensorCombined', 'vehicle_imu': 'VehicleImu',
    'sensor_gyro': 'SensorGyro', 'sensor_accel': 'SensorAccel',
    'sensor_gyro_fifo': 'SensorGyroFifo', 'sensor_accel_fifo': 'SensorAccelFifo'}
_HEAD = 16
"""Bytes of the file header: magic, version, time."""


class UlogRecording(TableLog):
    """A PX4 log."""

    def __init__(self, path: Path, stored: Path, options: RecordingOptions) -> None:
        super().__init__(path, stored, options)
        # By topic: messages, samples, times of the first and the last, and layout.
        seen: dict[str, tuple[int, int, int, int, np.dtype[Any]]] = {}
        reader = _LogReader(set(_TYPES))
        for name, records, _ in self._tables(reader):
            fields = KNOWN[_type_of(name)]
            times = times_of(records, fields)
            messages, samples, first, *_ = seen.get(name, (0, 0, int(times[0])))
            samples += len(records) if fields.burst is None else int(
                records[fields.burst.samples].astype(np.int64).sum())
            seen[name] = messages + len(records), samples, first, int(times[-1]), records.dtype
        self.reasons |= reader.reasons
        self.other_topics |= {name: _type_of(name) for name in reader.reasons}
        if reader.damaged:
            self.remark('damaged_recording', fault='bytes', bytes=reader.damaged,
                        lost_share=reader.damaged / self.size_bytes)
        if reader.left:
            self.remark('truncated_recording', fault='log', bytes=reader.left,
                        lost_share=reader.left / self.size_bytes)
        imus = []
        for name, (messages, samples, first, last, layout) in seen.items():
            fields = KNOWN[_type_of(name)]
            imu = ImuTopic(name, messages, ImuMessages(
                _type_of(name), factors=options.factors, fields=replace(
                    fields, what='as logged',
                    temperature=fields.temperature if has_temperature(layout, fields) else None)))
            imus.append((imu, (samples - 1) * 1e9 / (last - first) if last > first else 0.0))
            self.list_own_thermometer(imu)
        # By default PX4 logs sensor_gyro at 1 Hz and vehicle_imu at 2 Hz.
        self.list_imus(
            imus, {'sensor_gyro': 'sensor_accel', 'sensor_gyro_fifo': 'sensor_accel_fifo'},
            'set SDLOG_PROFILE in the autopilot (bit 4: high rate; bits 8 and 9: FIFOs of '
            'gyroscope and accelerometer) and record again')

    def tables_of(self, topic: str) -> Iterator[tuple[str, Records, int]]:
        """Gather the messages of a topic and of its other instances."""
        yield from self._tables(_LogReader({topic.partition('.')[0]}))

    def _tables(self, reader: '_LogReader') -> Iterator[tuple[str, Records, int]]:
        """Gather messages; yield topic name, records and bytes consumed."""
        with self._stored.open('rb') as file:
            at, rest = file.seek(_HEAD), b''
            # A megabyte holds some 10,000 messages, and is larger than any single one.
            while more := file.read(1 << 20):
                at += len(more)
                data = rest + more
                rest = data[reader.through(data):]
                for name, table in reader.extract(data):
                    yield name, table, at
            reader.left = len(rest)


def _type_of(topic: str) -> str:
    return f'px4_msgs/msg/{_TYPES[topic.partition(".")[0]]}'


class _LogReader:
    """Locates the messages of some topics, and learns their layouts, while a log is read."""

    def __init__(self, names: set[str]) -> None:
        self.reasons: dict[str, str] = {}
        self.damaged = self.left = 0
        self._names = names
        self._sizes: dict[int, int] = {}
        self._formats: dict[str, str] = {}
        # By number: topic, layout, and the places of its data; then those of former numbers.
        self._found: dict[int, tuple[str, np.dtype[Any], list[int]]] = {}
        self._former: list[tuple[str, np.dtype[Any], list[int]]] = []

    def through(self, data: bytes) -> int:
        """Step through messages; return the offset of the first incomplete one."""
        at, size = 0, len(data)
        # Size, type, and the first two bytes of the body, which in data are the number of the
        # topic.
        unpack, sizes = Struct('<HBH').unpack_from, self._sizes
        sync = b'\x08\x00S\x2f\x73\x13\x20\x25\x0c\xbb\x12'
        while at + 5 <= size:
            length, kind, number = unpack(data, at)
            after = at + 3 + length
            # Like pyulog, treat a larger message as damage.
            if not 0 < length <= 10_000 or not 65 <= kind <= 90:
                mark = data.find(sync, at + 1)
                # Keep the end of the data, where a mark may begin.
                behind = mark if mark >= 0 else max(at + 1, size - len(sync) + 1)
                self.damaged += behind - at
                at = behind
                continue
            if after > size:
                break
            if kind == 68:  # D
                if number in sizes:
                    if length >= sizes[number]:
                        self._found[number][2].append(at + 5)
                    else:
                        self.damaged += length + 3
            elif kind == 70:  # F
                name, _, fields = data[at + 3:after].decode(errors='replace').partition(':')
                # PX4 has 300 topics.
                if name in self._names or len(self._formats) < 4096:
                    self._formats[name] = fields
            elif kind == 65:  # A
                self._subscribe(data[at + 3:after])
            at = after
        return at

    def extract(self, data: bytes) -> Iterator[tuple[str, Records]]:
        """Yield the records found so far, by topic."""
        content = np.frombuffer(data, np.uint8)
        former, self._former = self._former, []
        for name, layout, places in (*former, *self._found.values()):
            starts = np.asarray(places, np.int64)
            places.clear()
            if len(starts):
                rows = content[starts[:, np.newaxis] + np.arange(layout.itemsize)].view(
                    layout)[:, 0]
                yield name, rows

    def _subscribe(self, body: bytes) -> None:
        """Start collecting the data of a topic if it is wanted and has the required fields."""
        name = body[3:].decode(errors='replace')
        number = int.from_bytes(body[1:3], 'little')
        if name not in self._formats:
            self.damaged += len(body) + 3
            return
        if self._sizes.pop(number, None) is not None:
            # Another subscription has taken over the number.
            self._former.append(self._found.pop(number))
        if name not in self._names:
            return
        layout = _layout(self._formats[name])
        full = f'{name}.{body[0]}' if body[0] else name
        # Every PX4 topic has a timestamp.
        if (lack := lacking(layout, KNOWN[_type_of(name)], 'timestamp')) is not None:
            self.reasons[full] = f'its format has no field {lack}'
            return
        self._sizes[number] = 2 + layout.itemsize
        self._found[number] = full, layout, []


def _layout(text: str) -> np.dtype[Any]:
    """
    Return the message layout up to the first field that is not a number; IMUs have none.

    Each element of an array is one more field, such as ``name[0]`` for the first.
    """
    codes = {
        'int8_t': 'i1', 'uint8_t': 'u1', 'int16_t': '<i2', 'uint16_t': '<u2', 'int32_t': '<i4',
        'uint32_t': '<u4', 'int64_t': '<i8', 'uint64_t': '<u8', 'float': '<f4', 'double': '<f8',
        'bool': '?', 'char': 'S1'}
    fields: dict[str, tuple[Any, int]] = {}
    at = size = 0
    for written in text.split(';'):
        field = re.fullmatch(r'(\w+)(?:\[(\d{1,4})\])? (\w+)', written)
        if field is None or field[1] not in codes or field[3] in fields:
            break
        number, name = np.dtype(codes[field[1]]), field[3]
        kind = np.dtype((number, (int(field[2]),))) if field[2] else number
        # Trailing padding is not logged.
        if not name.startswith('_padding'):
            fields[name] = kind, at
            fields |= {f'{name}[{place}]': (number, at + place * number.itemsize)
                       for place in range(int(field[2] or 0))}
            size = at + kind.itemsize
        at += kind.itemsize
    return record_of(fields, size)
