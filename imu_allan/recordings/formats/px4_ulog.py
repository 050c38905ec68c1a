# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
PX4 logs (.ulg), read by the pyulog library.

The library holds what it reads in memory; the topics of IMUs alone are asked for. Their fields are
those of px4_msgs, so `imu_allan.recordings.messages.known_types` says how they are read.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError, printable
from imu_allan.recordings.formats.table import fastest, Table, table_block, table_times
from imu_allan.recordings.imu_topic import ImuTopic, MalformedMessages
from imu_allan.recordings.messages.decoder import ImuMessages
from imu_allan.recordings.messages.known_types import KNOWN
from imu_allan.recordings.options import RecordingOptions
from imu_allan.recordings.recording import FileRecording
import numpy as np

_TYPES = {
    'sensor_combined': 'SensorCombined', 'vehicle_imu': 'VehicleImu',
    'sensor_gyro': 'SensorGyro', 'sensor_accel': 'SensorAccel',
    'sensor_gyro_fifo': 'SensorGyroFifo', 'sensor_accel_fifo': 'SensorAccelFifo'}
_PARTNER = {'sensor_gyro': 'sensor_accel', 'sensor_gyro_fifo': 'sensor_accel_fifo'}
_THIN_HZ = 20.0
"""PX4 logs sensor_gyro with 1 Hz and vehicle_imu with 2 Hz by default; no IMU is as slow."""
_BLOCK = 1 << 14
"""Rows at a time, 1 MB: 16 s at 1 kHz."""


class UlogRecording(FileRecording):
    """
    A PX4 log.

    As any `FileRecording`.

    Raises
    ------
    ImuAllanError
        If pyulog is missing, the file is damaged, or its topics are too thin.

    """

    def __init__(self, path: Path, stored: Path, options: RecordingOptions) -> None:
        super().__init__(path, stored, options)
        rates: dict[str, float] = {}
        for name, kind, table in self._tables(list(_TYPES)):
            times = table_times(table, KNOWN[kind])
            span = (int(times[-1]) - int(times[0])) / 1e9 if len(times) > 1 else 0.0
            rates[name] = (len(times) - 1) / span if span > 0 else 0.0
            fields = replace(KNOWN[kind], what='as logged')
            if fields.temperature not in table:
                fields = replace(fields, temperature=None)
            self.topics.append(ImuTopic(name, len(table['timestamp']), ImuMessages(
                kind, fields=fields, factors=options.factors)))
            self.list_own_thermometer(self.topics[-1])
        thin = [name for name, rate in rates.items() if rate < _THIN_HZ]
        for name in thin:
            self.reasons[name] = (
                f'{rates[name]:.3g} Hz are too thin; set SDLOG_PROFILE in the autopilot (bit 4: '
                'high rate; bits 8 and 9: FIFOs of gyroscope and accelerometer) and record again')
            self.other_topics[name] = self.imu(name).messages.type_name
        self.topics = [topic for topic in self.topics if topic.name not in thin]
        self.preferred = fastest(
            {topic.name: rates[topic.name] for topic in self.topics}, _PARTNER)

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read blocks, each with its share of the bytes."""
        imu = self.imu(topic)
        fields = imu.messages.fields
        assert fields is not None
        factors = np.repeat(imu.messages.factors, 3)
        malformed = MalformedMessages()
        for found, _, table in self._tables([imu.topic.partition('.')[0]]):
            if found == imu.topic:
                block = table_block(table, fields, factors, malformed)
                for start in range(0, len(block), _BLOCK):
                    yield (block.part(slice(start, start + _BLOCK)),
                           self.size_bytes * start // len(block))
        malformed.report(self.imu(topic), self.remark)

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
