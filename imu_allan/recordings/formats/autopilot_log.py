# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Logs of autopilots: records of numbers, packed like the messages of ROS 1 and decoded as such.

PX4 logs (.ulg) are read one megabyte at a time. Their IMU topics have the fields of px4_msgs. In
ArduPilot dataflash logs (.bin) the pymavlink library locates all messages and parses their
formats. Which fields hold samples is in `imu_allan.recordings.messages.imu_fields.KNOWN`.

References
----------
PX4 Guide, ULog File Format: a header of 16 bytes, then messages with size, type and body. Formats
(F) define the fields of a topic, subscriptions (A) assign its number, and data (D) begin with that
number. Reading resumes after damage at synchronization messages (S), which occur now and then.

"""

from abc import abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field, replace
from itertools import takewhile
import os
from pathlib import Path
import re
from struct import Struct
import sys
from typing import ClassVar

from imu_allan.arrays import Ints
from imu_allan.block import ImuBlock
from imu_allan.cdr import collect, MessageBatch
from imu_allan.errors import error_about, printable
from imu_allan.recordings.messages.definitions import Field, fields_in
from imu_allan.recordings.options import RecordingOptions
from imu_allan.recordings.recording import FileRecording, ImuTopic, TopicDecoder
import numpy as np
from numpy.typing import NDArray

Rows = NDArray[np.uint8]
"""Records of one topic and format, shape (n, size)."""


class _Pace:
    """Rate of the samples of an IMU, found while its log is opened."""

    def __init__(self, imu: ImuTopic) -> None:
        self.decode = TopicDecoder(imu)
        self.messages = self._steps = self._time_ns = 0
        self._last_ns: int | None = None

    def see(self, rows: Rows) -> None:
        """Count the samples of some records, and the time between them."""
        self.messages += len(rows)
        for block in self.decode([_batch(rows)]):
            stamps = block.header_ns
            steps = np.diff(stamps, prepend=stamps[0] if self._last_ns is None else self._last_ns)
            # Between two flights, ArduPilot pauses.
            steps = steps[(steps > 0) & (steps < 10_000_000_000)]
            self._steps, self._time_ns = self._steps + len(steps), self._time_ns + int(steps.sum())
            self._last_ns = int(stamps[-1])

    @property
    def hz(self) -> float:
        """Return the samples per second, without pauses."""
        return self._steps * 1e9 / self._time_ns if self._time_ns else 0.0


def _size(fields: Iterable[Field]) -> int:
    """Return the bytes of some numbers and arrays."""
    return sum(int(one.kind[1:]) * (one.count or 1) for one in fields)


def _batch(rows: Rows) -> MessageBatch:
    return MessageBatch(rows, np.zeros(len(rows), np.int64))


class AutopilotLog(FileRecording):
    """The log of an autopilot, whose topics are numbered from the second of a kind on: GYR.1."""

    _kinds: ClassVar[Mapping[str, str]]
    """Type of the messages, by topic without number."""

    @abstractmethod
    def _tables(self, kinds: Iterable[str]) -> Iterator[tuple[str, tuple[Field, ...], Rows, int]]:
        """Gather records of some kinds; yield topic, fields, records and bytes consumed."""

    def _list_imus(self, partner: Mapping[str, str], advice: str) -> None:
        """
        List IMUs, or note why one is not read and what to do.

        Preferred is the fastest one, or the fastest gyroscope with its `partner`.
        """
        paces: dict[str, _Pace] = {}
        for name, fields, rows, _ in self._tables(self._kinds):
            if name not in paces and name not in self.other_topics:
                kind = self._kinds[name.partition('.')[0]]
                if self.list_topic(name, kind, 'ros1', None, {kind: fields}):
                    paces[name] = _Pace(self.imu(name))
            if name in paces:
                paces[name].see(rows)
        listed_imus, self.topics = self.topics, []
        for imu in listed_imus:
            pace = paces[imu.name]
            # No IMU is this slow; such messages are only for monitoring.
            if pace.hz < 20.0:
                self.reasons[imu.name] = pace.decode.reason or (
                    f'{pace.hz:.3g} Hz are too thin; {advice}' if imu.messages.fields.stamps
                    else 'its messages have no time')
                self.other_topics[imu.name] = imu.messages.type_name
            else:
                self.topics.append(replace(imu, count=pace.messages))
        rates = {imu.name: paces[imu.name].hz for imu in self.topics}
        choices: list[tuple[str, ...]] = []
        for name in rates:
            base, dot, number = name.partition('.')
            other = f'{partner.get(base)}{dot}{number}'
            if other in rates:
                choices.append((name, other))
            elif base not in {*partner, *partner.values()}:
                choices.append((name,))
        self.preferred = max(choices, key=lambda names: rates[names[0]], default=())

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read blocks with the bytes consumed so far; the stamps serve as receive times."""
        decode = TopicDecoder(self.imu(topic))
        recorded = decode.imu.topic
        for name, _, rows, position in self._tables([recorded.partition('.')[0]]):
            if name == recorded:
                for block in decode([_batch(rows)]):
                    yield replace(block, receive_ns=block.header_ns), position
        decode.report(self.remark)


# --------------------------------------------------------------------------------------------- PX4

_FILE_HEAD = 16
"""Bytes of the file header: magic, version, time."""


class UlogRecording(AutopilotLog):
    """A PX4 log."""

    _kinds: ClassVar = {topic: f'px4_msgs/msg/{name}' for topic, name in (
        ('sensor_combined', 'SensorCombined'), ('vehicle_imu', 'VehicleImu'),
        ('sensor_gyro', 'SensorGyro'), ('sensor_accel', 'SensorAccel'),
        ('sensor_gyro_fifo', 'SensorGyroFifo'), ('sensor_accel_fifo', 'SensorAccelFifo'))}

    def __init__(self, path: Path, stored: Path, options: RecordingOptions) -> None:
        super().__init__(path, stored, options)
        self._damaged = self._left = 0
        # By default PX4 logs sensor_gyro at 1 Hz and vehicle_imu at 2 Hz.
        self._list_imus(
            {'sensor_gyro': 'sensor_accel', 'sensor_gyro_fifo': 'sensor_accel_fifo'},
            'set SDLOG_PROFILE in the autopilot (bit 4: high rate; bits 8 and 9: FIFOs of '
            'gyroscope and accelerometer) and record again')
        if self._damaged:
            self.remark('damaged_recording', fault='bytes', bytes=self._damaged,
                        lost_share=self._damaged / self.size_bytes)
        if self._left:
            self.remark('truncated_recording', fault='log', bytes=self._left,
                        lost_share=self._left / self.size_bytes)

    def _tables(self, kinds: Iterable[str]) -> Iterator[tuple[str, tuple[Field, ...], Rows, int]]:
        reader = _LogReader({*kinds})
        with self._stored.open('rb') as file:
            at, rest = file.seek(_FILE_HEAD), b''
            # A megabyte holds some 10,000 messages, and is larger than any single one.
            while more := file.read(1 << 20):
                at += len(more)
                data = rest + more
                rest = data[reader.through(data):]
                for found in reader.extract(data):
                    yield (*found, at)
        self._damaged, self._left = reader.damaged, len(rest)


@dataclass
class _Subscription:
    """A topic, the fields of its records, their size, and where the latest ones begin."""

    topic: str
    fields: tuple[Field, ...]
    size: int
    starts: list[int] = field(default_factory=list)


class _LogReader:
    """Locates the records of some topics while a log is read."""

    def __init__(self, names: set[str]) -> None:
        self.damaged = 0
        self._names = names
        self._formats: dict[str, str] = {}
        self._numbered: dict[int, _Subscription] = {}
        # With those whose number another has taken over.
        self._latest: list[_Subscription] = []

    def through(self, data: bytes) -> int:
        """Step through messages; return the offset of the first incomplete one."""
        at, size = 0, len(data)
        # Size, type, and the first two bytes of the body, which in data are the number of the
        # topic.
        unpack = Struct('<HBH').unpack_from
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
                if (found := self._numbered.get(number)) is not None:
                    if length >= 2 + found.size:
                        found.starts.append(at + 5)
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

    def extract(self, data: bytes) -> Iterator[tuple[str, tuple[Field, ...], Rows]]:
        """Yield the records found so far, by topic, with their fields."""
        for found in self._latest:
            if found.starts:
                starts = np.array(found.starts, np.int64)
                yield found.topic, found.fields, collect(data, starts, found.size)
                found.starts.clear()
        self._latest = [*self._numbered.values()]

    def _subscribe(self, body: bytes) -> None:
        """Start collecting the data of a topic if it is wanted."""
        name = body[3:].decode(errors='replace')
        number = int.from_bytes(body[1:3], 'little')
        if name not in self._formats:
            self.damaged += len(body) + 3
            return
        self._numbered.pop(number, None)
        if name in self._names:
            fields = _fields(self._formats[name])
            found = _Subscription(f'{name}.{body[0]}' if body[0] else name, fields, _size(fields))
            self._numbered[number] = found
            self._latest.append(found)


def _fields(text: str) -> tuple[Field, ...]:
    """Return the fields of a format up to the first that is not a number; IMUs have none."""
    # Types have the names of C, such as uint8_t.
    fields = [*takewhile(lambda one: not one.is_message and one.kind != 'string',
                         fields_in(re.sub(r'_t(?=[ [])', '', text)))]
    # Trailing padding is not logged.
    while fields and fields[-1].name.startswith('_padding'):
        del fields[-1]
    return tuple(fields)


# --------------------------------------------------------------------------------------- ArduPilot

_MESSAGE_HEAD = 3    # bytes before each message: marker and type


class ArduPilotRecording(AutopilotLog):
    """An ArduPilot log; raises ImuAllanError if pymavlink is missing or cannot read it."""

    _kinds: ClassVar = {kind: f'ArduPilot {kind}' for kind in ('IMU', 'GYR', 'ACC')}

    def __init__(self, path: Path, stored: Path, options: RecordingOptions) -> None:
        super().__init__(path, stored, options)
        self._located = self._locate()
        self._list_imus({'GYR': 'ACC'}, 'set LOG_BITMASK (IMU_RAW) or INS_RAW_LOG_OPT in the '
                        'autopilot for raw samples at the full rate')
        # Only IMU messages hold a temperature, and even their lowest rate is high enough for it.
        warm = {thermometer.topic[3:]: thermometer for thermometer in self.thermometers}
        self.thermometers += [
            replace(warm[imu.name[3:]], name=f'{imu.name}:T') for imu in self.topics
            if imu.name[3:] in warm and not imu.name.startswith('IMU')]

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read blocks, each with the number of bytes consumed so far."""
        yield from super().decoded(topic)
        if topic.startswith('IMU'):
            self.remark('filtered')

    def _locate(self) -> dict[str, tuple[Ints, int, tuple[Field, ...]]]:
        """Locate the complete IMU messages, by type; return offsets, size and fields."""
        try:
            from pymavlink.DFReader import DFReader_binary, FORMAT_TO_STRUCT
        except ImportError:
            raise error_about(self.path, 'ArduPilot logs need the package pymavlink; pip install '
                              "'imu_allan[ardupilot]'") from None

        class Index(DFReader_binary):  # type: ignore[misc]
            def init_clock(self) -> None:
                """Skip the search for the time of day, which may read all messages."""

        located = {}
        try:
            with _silenced(), Index(str(self._stored)) as log:
                for number, form in log.formats.items():
                    kind = form.name.rstrip('0123456789')
                    starts = np.asarray(log.offsets[number], np.int64)
                    starts = starts[starts + form.len <= self.size_bytes]
                    size = form.len - _MESSAGE_HEAD
                    if kind in self._kinds and len(starts) and size > 0:
                        located[form.name] = starts + _MESSAGE_HEAD, size, tuple(
                            _field(column, FORMAT_TO_STRUCT[letter][0])
                            for column, letter in zip(form.columns, form.format, strict=False))
        # The library raises exceptions of many types on damaged files.
        except Exception as error:
            raise error_about(self.path, 'not a readable dataflash log '
                              f'({printable(error)[:80]})') from error
        return located

    def _tables(self, kinds: Iterable[str]) -> Iterator[tuple[str, tuple[Field, ...], Rows, int]]:
        data = np.memmap(self._stored, np.uint8, 'r')
        at_a_time = 1 << 14
        for kind, (places, size, fields) in self._located.items():
            base = kind.rstrip('0123456789')
            if base not in kinds:
                continue
            # Before version 4.1 the second IMU had a separate message type, IMU2.
            suffix = int(kind[len(base):] or 1) - 1
            names = [one.name for one in fields]
            instance = _size(fields[:names.index('I')]) if 'I' in names else size
            for start in range(0, len(places), at_a_time):
                starts = places[start:start + at_a_time]
                rows = collect(data, starts, size)
                numbers = rows[:, instance] if instance < size else np.full(len(rows), suffix)
                for number in np.unique(numbers).tolist():
                    name = f'{base}.{number}' if number else base
                    yield name, fields, rows[numbers == number], int(starts[-1])


@contextmanager
def _silenced() -> Iterator[None]:
    """Hide what the library prints about damage, one line per byte, partly from C code."""
    sys.stderr.flush()
    kept = os.dup(2)
    try:
        with Path(os.devnull).open('w') as nowhere, redirect_stdout(nowhere), \
                redirect_stderr(nowhere):
            os.dup2(nowhere.fileno(), 2)
            yield
    finally:
        sys.stderr.flush()
        os.dup2(kept, 2)
        os.close(kept)


def _field(name: str, letters: str) -> Field:
    """Return a field with a number or a text, given by the letters of the module `struct`."""
    if letters.endswith('s'):
        return Field(name, 'u1', False, int(letters[:-1]))
    return Field(name, np.dtype(letters).str[1:], False, None)
