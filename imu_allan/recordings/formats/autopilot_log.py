# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Logs of autopilots: records of numbers, decoded with the code for messages.

PX4 logs (.ulg) are read one megabyte at a time. Their IMU topics have the fields of px4_msgs, so
they are read as `imu_allan.recordings.messages.imu_fields.KNOWN` specifies. In ArduPilot dataflash
logs (.bin) the pymavlink library locates all messages and parses their formats; IMU messages are
then gathered as arrays.

References
----------
PX4 Guide, ULog File Format: a header of 16 bytes, then messages with size, type and body. Formats
(F) define the fields of a topic, subscriptions (A) assign its number, and data (D) begin with that
number. Reading resumes after damage at synchronization messages (S), which occur now and then.

ArduPilot, libraries/AP_InertialSensor/LogStructure.h: ACC, GYR and IMU are in SI units, stamped in
microseconds since start.

"""

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import replace
import os
from pathlib import Path
import re
from struct import Struct
import sys
from typing import Any

from imu_allan.arrays import Ints
from imu_allan.block import ImuBlock
from imu_allan.cdr import record_of
from imu_allan.errors import ImuAllanError, printable
from imu_allan.recordings.messages.decoder import extract, ImuMessages, time_of
from imu_allan.recordings.messages.imu_fields import ImuFields, KNOWN, Stamp, Vector
from imu_allan.recordings.options import RecordingOptions
from imu_allan.recordings.recording import FileRecording, ImuTopic, MalformedMessages
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
                    columns = extract(fields, (), records, _times_of(records, fields), malformed)
                    samples = columns['samples'] * np.repeat(imu.messages.factors, 3)
                times = columns['receive_ns']
                yield ImuBlock(times, times, samples, columns['absent'], ''), position
        malformed.report(imu, self.remark)


def _lacking(layout: np.dtype[Any], fields: ImuFields, *others: str) -> str | None:
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


def _has_temperature(layout: np.dtype[Any], fields: ImuFields) -> bool:
    """Return whether records hold the temperature, as a number."""
    thermometer = fields.thermometer()
    return thermometer is not None and _lacking(layout, thermometer) is None


def _stamp(layout: np.dtype[Any], fields: ImuFields) -> Stamp | None:
    return next((stamp for stamp in fields.stamps if stamp.path in (layout.names or ())), None)


def _times_of(records: Records, fields: ImuFields) -> Ints:
    """Return the stamps of records in nanoseconds."""
    stamp = _stamp(records.dtype, fields)
    assert stamp is not None
    return time_of(records, stamp)


def _records(content: NDArray[np.uint8], starts: Ints, layout: np.dtype[Any]) -> Records:
    """Copy the records that begin at some places of a file."""
    rows = content[starts[:, np.newaxis] + np.arange(layout.itemsize)]
    records: Records = rows.view(layout)[:, 0]
    return records


# --------------------------------------------------------------------------------------------- PX4

_TYPES = {
    'sensor_combined': 'SensorCombined', 'vehicle_imu': 'VehicleImu',
    'sensor_gyro': 'SensorGyro', 'sensor_accel': 'SensorAccel',
    'sensor_gyro_fifo': 'SensorGyroFifo', 'sensor_accel_fifo': 'SensorAccelFifo'}
_FILE_HEAD = 16
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
            times = _times_of(records, fields)
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
                    temperature=fields.temperature if _has_temperature(layout, fields) else None)))
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
            at, rest = file.seek(_FILE_HEAD), b''
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
                yield name, _records(content, starts, layout)

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
        if (lack := _lacking(layout, KNOWN[_type_of(name)], 'timestamp')) is not None:
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


# --------------------------------------------------------------------------------------- ArduPilot

_MESSAGE_HEAD = 3    # bytes before each message: marker and type
_GYRO, _ACCEL = (Vector((f'{name}X', f'{name}Y', f'{name}Z')) for name in ('Gyr', 'Acc'))
_SAMPLED = (Stamp('SampleUS', 1000), Stamp('TimeUS', 1000))
_FIELDS = {
    'IMU': ImuFields(_GYRO, _ACCEL, (Stamp('TimeUS', 1000),), what='as logged', temperature='T'),
    'GYR': ImuFields(_GYRO, None, _SAMPLED, what='as logged'),
    'ACC': ImuFields(None, _ACCEL, _SAMPLED, what='as logged')}


class ArduPilotRecording(TableLog):
    """An ArduPilot log; raises ImuAllanError if pymavlink is missing or cannot read it."""

    def __init__(self, path: Path, stored: Path, options: RecordingOptions) -> None:
        super().__init__(path, stored, options)
        times: dict[str, list[Ints]] = {}
        warm: set[str] = set()
        self._kinds = self._located()
        for base in _FIELDS:
            for name, records, _ in self._tables(base):
                times.setdefault(name, []).append(_times_of(records, _FIELDS[base]))
                if _has_temperature(records.dtype, _FIELDS[base]):
                    warm.add(name)
        thermometer = _FIELDS['IMU'].thermometer()
        imus = []
        for name, parts in times.items():
            base, dot, number = name.partition('.')
            imus.append((ImuTopic(name, sum(map(len, parts)), ImuMessages(
                f'ArduPilot {base}', fields=_FIELDS[base], factors=options.factors)),
                _rate_hz(np.concatenate(parts))))
            # Only IMU messages hold a temperature, and even their lowest rate is high enough for
            # it.
            source = f'IMU{dot}{number}'
            if source in warm:
                self.thermometers.append(ImuTopic(f'{name}:T', None, ImuMessages(
                    'ArduPilot IMU', fields=thermometer), source))
        self.list_imus(imus, {'GYR': 'ACC'}, 'set LOG_BITMASK (IMU_RAW) or INS_RAW_LOG_OPT in the '
                       'autopilot for raw samples at the full rate')

    def tables_of(self, topic: str) -> Iterator[tuple[str, Records, int]]:
        """Gather the messages of a topic and of topics of the same message type."""
        base = topic.partition('.')[0]
        yield from self._tables(base)
        if base == 'IMU':
            self.remark('filtered')

    def _located(self) -> dict[str, tuple[Ints, np.dtype[Any]]]:
        """Locate the complete IMU messages, by type; return their offsets and layout."""
        try:
            from pymavlink.DFReader import DFReader_binary, FORMAT_TO_STRUCT
        except ImportError:
            raise ImuAllanError(
                f'{printable(self.path)}: ArduPilot logs need the package pymavlink; '
                "pip install 'imu_allan[ardupilot]'") from None

        class Index(DFReader_binary):  # type: ignore[misc]
            def init_clock(self) -> None:
                """Skip the search for the time of day, which may read all messages."""

        kinds = {}
        try:
            with _silenced(), Index(str(self._stored)) as log:
                for number, form in log.formats.items():
                    name = form.name.rstrip('0123456789')
                    if name not in _FIELDS:
                        continue
                    layout = np.dtype([
                        (column, _code(FORMAT_TO_STRUCT[letter]))
                        for column, letter in zip(form.columns, form.format, strict=False)])
                    starts = np.asarray(log.offsets[number], np.int64)
                    starts = starts[starts + form.len <= self.size_bytes]
                    if not len(starts):
                        continue
                    if (lack := _lacking(layout, _FIELDS[name])) is not None:
                        reason = f'its format (FMT) has no usable field {lack}'
                    elif layout.itemsize != form.len - _MESSAGE_HEAD:
                        reason = 'the fields of its format (FMT) do not add up to its length'
                    else:
                        kinds[form.name] = starts, layout
                        continue
                    self.reasons[form.name] = reason
                    self.other_topics[form.name] = f'ArduPilot {name}'
        # The library raises exceptions of many types on damaged files.
        except Exception as error:
            raise ImuAllanError(f'{printable(self.path)}: not a readable dataflash log '
                                f'({printable(error)[:80]})') from error
        return kinds

    def _tables(self, base: str) -> Iterator[tuple[str, Records, int]]:
        """Gather messages, some thousand at a time; yield topic, records and bytes consumed."""
        data = np.memmap(self._stored, np.uint8, 'r')
        at_a_time = 1 << 14
        for kind, (places, layout) in self._kinds.items():
            if kind.rstrip('0123456789') != base:
                continue
            # Before version 4.1 the second IMU had a separate message type, IMU2.
            suffix = int(kind[len(base):] or 1) - 1
            for start in range(0, len(places), at_a_time):
                starts = places[start:start + at_a_time]
                rows = _records(data, starts + _MESSAGE_HEAD, layout)
                numbers = rows['I'] if 'I' in (layout.names or ()) else np.full(len(rows), suffix)
                for number in np.unique(numbers).tolist():
                    name = f'{base}.{number}' if number else base
                    yield name, rows[numbers == number], int(starts[-1])


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


def _code(translation: tuple[str, object, object]) -> str:
    """Return the numpy type code of a number or text."""
    letters = translation[0]
    return f'S{letters[:-1]}' if letters.endswith('s') else f'<{letters}'


def _rate_hz(times: Ints) -> float:
    """Return the sample rate from the median interval, which ignores pauses."""
    steps = np.diff(times)
    middle = float(np.median(steps)) if len(steps) else 0.0
    return 1e9 / middle if middle > 0 else 0.0
