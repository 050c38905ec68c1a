# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
PX4 logs (.ulg), read by the pyulog library.

The library holds what it reads in memory; the topics of IMUs alone are asked for. Their fields are
those of px4_msgs, so `imu_allan.recordings.messages.known_types` says how they are read.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError, printable
from imu_allan.recordings.messages.decoder import ImuMessages
from imu_allan.recordings.messages.imu_fields import Burst, ImuFields, Vector
from imu_allan.recordings.messages.known_types import KNOWN
from imu_allan.recordings.options import RecordingOptions
from imu_allan.recordings.recording import ImuTopic, Recording
import numpy as np
from numpy.typing import NDArray

MAGIC = b'ULog\x01\x12\x35'

_TYPES = {
    'sensor_combined': 'SensorCombined', 'vehicle_imu': 'VehicleImu',
    'sensor_gyro': 'SensorGyro', 'sensor_accel': 'SensorAccel',
    'sensor_gyro_fifo': 'SensorGyroFifo', 'sensor_accel_fifo': 'SensorAccelFifo'}
_PARTNER = {'sensor_gyro': 'sensor_accel', 'sensor_gyro_fifo': 'sensor_accel_fifo'}
_THIN_HZ = 20.0
"""PX4 logs sensor_gyro with 1 Hz and vehicle_imu with 2 Hz by default; no IMU is as slow."""
_BLOCK = 1 << 14

Table = Mapping[str, NDArray[Any]]


class UlogRecording(Recording):
    """
    A PX4 log.

    Parameters
    ----------
    path, stored : Path
        The recording as the user knows it, and where its bytes are.
    options : RecordingOptions
        What the user says about it.

    Raises
    ------
    ImuAllanError
        If pyulog is missing, the file is damaged, or its topics are too thin.

    """

    def __init__(self, path: Path, stored: Path, options: RecordingOptions) -> None:
        super().__init__(path, options)
        self._stored = stored
        self.size_bytes = stored.stat().st_size
        rates: dict[str, float] = {}
        for name, kind, table in self._tables(list(_TYPES)):
            times = _times(table, KNOWN[kind])
            span = (int(times[-1]) - int(times[0])) / 1e9 if len(times) > 1 else 0.0
            rates[name] = (len(times) - 1) / span if span > 0 else 0.0
            self.topics.append(ImuTopic(name, len(table['timestamp']), ImuMessages(
                kind, fields=replace(KNOWN[kind], what='as logged'), factors=options.factors)))
        thin = [name for name, rate in rates.items() if rate < _THIN_HZ]
        for name in thin:
            self.reasons[name] = (
                f'{rates[name]:.3g} Hz are too thin; set SDLOG_PROFILE in the autopilot (bit 4: '
                'high rate; bits 8 and 9: FIFOs of gyroscope and accelerometer) and record again')
            self.other_topics[name] = self.imu(name).messages.type_name
        self.topics = [topic for topic in self.topics if topic.name not in thin]
        self.preferred = _fastest({topic.name: rates[topic.name] for topic in self.topics})

    def close(self) -> None:
        """Release nothing: each reading opens and closes the file itself."""

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read blocks, each with its share of the bytes."""
        name = topic.partition('.')[0]
        fields = self.imu(topic).messages.fields
        assert fields is not None
        factors = np.repeat(self.options.factors, 3)
        for found, _, table in self._tables([name]):
            if found == topic:
                block = _block(table, fields, factors)
                for start in range(0, len(block), _BLOCK):
                    part = slice(start, start + _BLOCK)
                    yield ImuBlock(
                        block.header_ns[part], block.receive_ns[part], block.samples[part],
                        block.absent[part], ''), self.size_bytes * start // len(block)

    def _tables(self, names: list[str]) -> Iterator[tuple[str, str, Table]]:
        """Load topics: name, type and columns of each that has messages."""
        try:
            from pyulog import ULog
        except ImportError:
            raise ImuAllanError(
                f'{printable(self.path)}: PX4 logs need the package pyulog; '
                "pip install 'imu_allan[px4]'") from None
        try:
            log = ULog(str(self._stored), names)
        # The library raises what it meets in a damaged file.
        except Exception as error:
            raise ImuAllanError(f'{printable(self.path)}: not a readable ULog file '
                                f'({printable(error)[:80]})') from error
        for data in log.data_list:
            if data.name in _TYPES and len(data.data['timestamp']):
                name = data.name if data.multi_id == 0 else f'{data.name}.{data.multi_id}'
                yield name, f'px4_msgs/msg/{_TYPES[data.name]}', data.data


def _fastest(rates: Mapping[str, float]) -> tuple[str, ...]:
    """Choose the topic, or the pair of gyroscope and accelerometer, with the highest rate."""
    choices: dict[tuple[str, ...], float] = {}
    for name, rate in rates.items():
        base, dot, number = name.partition('.')
        if base in ('sensor_combined', 'vehicle_imu'):
            choices[(name,)] = rate
        elif base in _PARTNER:
            partner = f'{_PARTNER[base]}{dot}{number}'
            if partner in rates:
                choices[name, partner] = rate
    return max(choices, key=lambda names: choices[names], default=())


def _times(table: Table, fields: ImuFields) -> NDArray[np.int64]:
    """Return the times of all samples in nanoseconds."""
    stamp = next(stamp.path for stamp in fields.stamps if stamp.path in table)
    times = table[stamp].astype(np.int64) * 1000
    if fields.burst is None:
        return times
    before, kept = _within_burst(table, fields.burst, _width(table, fields))
    return (times[:, np.newaxis] - before)[kept]


def _width(table: Table, fields: ImuFields) -> int:
    [(_, vector)] = fields.vectors()
    return sum(name.startswith(f'{vector.paths[0]}[') for name in table)


def _within_burst(table: Table, burst: Burst, width: int,
                  ) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return how long before the stamp each sample of a burst is, and which are filled."""
    filled = table[burst.samples].astype(np.int64)[:, np.newaxis]
    number = np.arange(width)
    step_ns = np.nan_to_num(table[burst.step_us].astype(np.float64))[:, np.newaxis] * 1e3
    return np.rint((filled - 1 - number) * step_ns).astype(np.int64), number < filled


def _block(table: Table, fields: ImuFields, factors: NDArray[np.float64]) -> ImuBlock:
    times = _times(table, fields)
    samples = np.zeros((len(times), 6))
    absent = np.ones((len(times), 2), np.bool_)
    for first, vector in fields.vectors():
        samples[:, first:first + 3] = _vector(table, fields, vector)
        absent[:, first // 3] = False
    return ImuBlock(times, times, samples * factors, absent, '')


def _vector(table: Table, fields: ImuFields, vector: Vector) -> NDArray[np.float64]:
    if fields.burst is not None:
        width = _width(table, fields)
        _, kept = _within_burst(table, fields.burst, width)
        columns = [np.stack([table[f'{path}[{number}]'] for number in range(width)], axis=1)[kept]
                   for path in vector.paths]
        scale = (np.ones(kept.shape) if vector.scale is None else
                 np.broadcast_to(table[vector.scale].astype(np.float64)[:, None], kept.shape))
        return np.stack(columns, axis=1) * scale[kept][:, np.newaxis]
    values = np.stack([table[path] for path in vector.paths], axis=1).astype(np.float64)
    if vector.per:
        seconds = table[vector.per].astype(np.float64) * 1e-6
        seconds[seconds == 0] = np.nan
        values /= seconds[:, np.newaxis]
    return values
