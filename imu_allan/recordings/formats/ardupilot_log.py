# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
ArduPilot dataflash logs (.bin), read with the pymavlink library.

The library locates all messages and parses their formats; IMU messages are then gathered as
arrays.

References
----------
ArduPilot, libraries/AP_InertialSensor/LogStructure.h: ACC, GYR and IMU are in SI units, stamped in
microseconds since start.

"""

from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
import os
from pathlib import Path
import sys
from typing import Any

from imu_allan.arrays import Ints
from imu_allan.errors import ImuAllanError, printable
from imu_allan.recordings.formats.autopilot_log import (
    has_temperature,
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

_HEAD = 3    # bytes before each message: marker and type
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
                times.setdefault(name, []).append(times_of(records, _FIELDS[base]))
                if has_temperature(records.dtype, _FIELDS[base]):
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
                    if (lack := lacking(layout, _FIELDS[name])) is not None:
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
                body = data[starts[:, np.newaxis] + np.arange(_HEAD, _HEAD + layout.itemsize)]
                rows = body.view(layout)[:, 0]
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
