# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
ArduPilot dataflash logs (.bin), read with the pymavlink library.

The library locates all messages and parses their formats; IMU messages are then gathered as
arrays.

References
----------
ArduPilot, libraries/AP_InertialSensor/LogStructure.h and BatchSampler.cpp: ACC, GYR and IMU are in
SI units, stamped in microseconds since start; an ISBH message announces a batch of raw samples.
The ISBD messages after it hold 32 samples each, as integers that are `mul` times the value.

"""

from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import replace
import os
from pathlib import Path
import sys
from typing import Any

from imu_allan.arrays import Ints
from imu_allan.errors import ImuAllanError, printable
from imu_allan.recordings.formats.table import (
    fastest,
    lacking,
    Records,
    TableLog,
    times_of,
)
from imu_allan.recordings.imu_topic import ImuTopic
from imu_allan.recordings.messages.decoder import ImuMessages
from imu_allan.recordings.messages.imu_fields import ImuFields, Stamp, Vector
from imu_allan.recordings.options import RecordingOptions
import numpy as np
from numpy.typing import NDArray

_HEAD = 3    # bytes before each message: marker and type
_GYRO, _ACCEL = (Vector((f'{name}X', f'{name}Y', f'{name}Z')) for name in ('Gyr', 'Acc'))
_BATCH = Vector(('x', 'y', 'z'), scale='scale')
_SAMPLED = (Stamp('SampleUS', 1000), Stamp('TimeUS', 1000))
_FIELDS = {
    'IMU': ImuFields(_GYRO, _ACCEL, (Stamp('TimeUS', 1000),), what='as logged'),
    'GYR': ImuFields(_GYRO, None, _SAMPLED, what='as logged'),
    'ACC': ImuFields(None, _ACCEL, _SAMPLED, what='as logged'),
    'ISBD_GYR': ImuFields(_BATCH, None, (Stamp('time_ns', 1),), what='batches, unrolled'),
    'ISBD_ACC': ImuFields(None, _BATCH, (Stamp('time_ns', 1),), what='batches, unrolled')}
_BATCH_SENSORS = ('ISBD_ACC', 'ISBD_GYR')
"""Batch topics, indexed by the sensor type in the batch header."""

_Kind = tuple[Ints, np.dtype[Any]]
"""Offsets of the complete messages of one type, and their layout after the head."""


class ArduPilotRecording(TableLog):
    """An ArduPilot log; raises ImuAllanError if pymavlink is missing or cannot read it."""

    def __init__(self, path: Path, stored: Path, options: RecordingOptions) -> None:
        super().__init__(path, stored, options)
        times: dict[str, list[Ints]] = {}
        kinds = self._kinds()
        for base in _FIELDS:
            for name, records, _ in self._tables(kinds, base):
                times.setdefault(name, []).append(times_of(records, _FIELDS[base]))
        thermometer = replace(_FIELDS['IMU'], temperature='T').thermometer()
        rates = {name: _rate_hz(np.concatenate(parts)) for name, parts in times.items()}
        for name, rate in rates.items():
            base, dot, number = name.partition('.')
            self.add_imu(rate, ImuTopic(name, sum(map(len, times[name])), ImuMessages(
                f'ArduPilot {base}', fields=_FIELDS[base], factors=options.factors)),
                'set LOG_BITMASK (IMU_RAW) or INS_RAW_LOG_OPT in the autopilot for raw samples at '
                'the full rate')
            # Only IMU messages hold a temperature, and even their lowest rate is high enough for
            # it.
            source = f'IMU{dot}{number}'
            if source in rates:
                self.thermometers.append(ImuTopic(f'{name}:T', None, ImuMessages(
                    'ArduPilot IMU', fields=thermometer), source))
        unbroken = {topic.name: rates[topic.name] for topic in self.topics
                    if not topic.name.startswith('ISBD')}
        partner = {'GYR': 'ACC', 'ISBD_GYR': 'ISBD_ACC'}
        self.preferred = fastest(unbroken, partner) or fastest(
            {topic.name: rates[topic.name] for topic in self.topics}, partner)

    def tables_of(self, topic: str) -> Iterator[tuple[str, Records, int]]:
        """Gather the messages of a topic and of topics of the same message type."""
        base = topic.partition('.')[0]
        yield from self._tables(self._kinds(), base)
        if base == 'IMU':
            self.remark('filtered', by='autopilot')
        elif base.startswith('ISBD'):
            self.remark('batches', topic=printable(topic))

    def _kinds(self) -> dict[str, _Kind]:
        """Locate the IMU messages in the file."""
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
                    if name not in ('IMU', 'GYR', 'ACC', 'ISBH', 'ISBD'):
                        continue
                    layout = np.dtype([
                        (column, ('<i2', 32) if letter == 'a' else _code(FORMAT_TO_STRUCT[letter]))
                        for column, letter in zip(form.columns, form.format, strict=False)])
                    starts = np.asarray(log.offsets[number], np.int64)
                    starts = starts[starts + form.len <= self.size_bytes]
                    if not len(starts):
                        continue
                    if (lack := _lacking(name, layout)) is not None:
                        reason = f'its format (FMT) has no usable field {lack}'
                    elif layout.itemsize != form.len - _HEAD:
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

    def _tables(self, kinds: dict[str, _Kind], base: str) -> Iterator[tuple[str, Records, int]]:
        """Gather messages; yield topic name, records and bytes consumed."""
        if base in _BATCH_SENSORS:
            yield from self._batches(kinds, _BATCH_SENSORS.index(base))
            return
        for kind in kinds:
            if kind.rstrip('0123456789') != base:
                continue
            # Before version 4.1 the second IMU had a separate message type, IMU2.
            suffix = int(kind[len(base):] or 1) - 1
            for rows, position in self._rows(kinds[kind]):
                numbers = rows['I'] if 'I' in (rows.dtype.names or ()) else np.full(
                    len(rows), suffix)
                for number in np.unique(numbers).tolist():
                    yield _named(base, number), rows[numbers == number], position

    def _batches(self, kinds: dict[str, _Kind], sensor: int) -> Iterator[tuple[str, Records, int]]:
        """Expand the batches of one sensor type into samples with individual times."""
        if not {'ISBH', 'ISBD'} <= kinds.keys():
            return
        heads = np.concatenate([rows for rows, _ in self._rows(kinds['ISBH'])])
        first = 0
        sample = np.dtype([('time_ns', np.int64), ('scale', np.float64),
                           *((axis, np.int16) for axis in 'xyz')])
        for rows, position in self._rows(kinds['ISBD']):
            starts = kinds['ISBD'][0][first:first + len(rows)]
            first += len(rows)
            before = np.searchsorted(kinds['ISBH'][0], starts) - 1
            head = heads[np.maximum(before, 0)]
            sound = (before >= 0) & (head['N'] == rows['N']) & (head['type'] == sensor) & (
                head['mul'] > 0) & (head['smp_rate'] > 0) & np.isfinite(head['smp_rate'])
            for number in np.unique(head['instance'][sound]).tolist():
                chosen = sound & (head['instance'] == number)
                own, samples = head[chosen], rows[chosen]
                place = samples['seqno'][:, np.newaxis] * 32. + np.arange(32)
                step_ns = 1e9 / own['smp_rate'].astype(np.float64)[:, np.newaxis]
                times = own['SampleUS'].astype(np.int64)[:, np.newaxis] * 1000 + np.rint(
                    np.minimum(place * step_ns, 2.0**62)).astype(np.int64)
                records = np.empty(times.size, sample)
                records['time_ns'] = times.reshape(-1)
                records['scale'] = np.repeat(1 / own['mul'].astype(np.float64), 32)
                for axis in 'xyz':
                    records[axis] = samples[axis].reshape(-1)
                yield _named(_BATCH_SENSORS[sensor], number), records, position

    def _rows(self, kind: _Kind) -> Iterator[tuple[NDArray[Any], int]]:
        """Gather messages, some thousand at a time; yield them with the bytes consumed."""
        data = np.memmap(self._stored, np.uint8, 'r')
        places, layout = kind
        at_a_time = 1 << 14
        for start in range(0, len(places), at_a_time):
            starts = places[start:start + at_a_time]
            body = data[starts[:, np.newaxis] + np.arange(_HEAD, _HEAD + layout.itemsize)]
            yield body.view(layout)[:, 0], int(starts[-1])


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


def _lacking(name: str, layout: np.dtype[Any]) -> str | None:
    """Return the first required field of an IMU message that is missing or not numeric."""
    if name in _FIELDS:
        return lacking(layout, _FIELDS[name])
    for field in (('N', 'type', 'instance', 'mul', 'SampleUS', 'smp_rate') if name == 'ISBH'
                  else ('N', 'seqno', 'x', 'y', 'z')):
        shape = (32,) if field in ('x', 'y', 'z') else ()
        if field not in (layout.names or ()) or layout[field].shape != shape or (
                layout[field].base.kind in 'SV'):
            return field
    return None


def _code(translation: tuple[str, object, object]) -> str:
    """Return the numpy type code of a number or text."""
    letters = translation[0]
    return f'S{letters[:-1]}' if letters.endswith('s') else f'<{letters}'


def _named(base: str, number: int) -> str:
    return f'{base}.{number}' if number else base


def _rate_hz(times: Ints) -> float:
    """Return the sample rate from the median interval, which ignores pauses."""
    steps = np.diff(times)
    middle = float(np.median(steps)) if len(steps) else 0.0
    return 1e9 / middle if middle > 0 else 0.0
