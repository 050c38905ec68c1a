# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Mutated recordings: a clear error, or what can be read with a remark on what cannot.

Never another exception, never a long wait, and never a sample that a checksum could have caught.
"""

from array import array
from collections.abc import Callable
from pathlib import Path
from random import Random
import time

from bags import block, IMU, write_bag, write_db3, write_mcap, write_metadata
from imu_allan.block import ImuBlock
from mutations import mutated_bytes, read_in_part
import numpy as np
import pytest
from repeated import slow
import zstandard

MESSAGES = block(600)
SAMPLES = {row.tobytes() for row in MESSAGES.samples}


def mcap(compression: str) -> Callable[[Path], Path]:
    return lambda folder: write_mcap(folder / 'a.mcap', MESSAGES, compression=compression,
                                     chunk_size=20_000, others=lambda n: n % 3 == 0)


def loose_mcap(folder: Path) -> Path:
    return write_mcap(folder / 'a.mcap', MESSAGES, use_chunking=False)


def db3(folder: Path) -> Path:
    return write_db3(folder / 'a.db3', MESSAGES, [('/x', 'a_msgs/msg/B')])


def compressed_db3(folder: Path) -> Path:
    path = db3(folder)
    path.write_bytes(zstandard.compress(path.read_bytes()))
    return path


def ros1(compression: str) -> Callable[[Path], Path]:
    return lambda folder: write_bag(folder / 'a.bag', MESSAGES, compression, lambda n: n % 3)


def csv(folder: Path) -> Path:
    path = folder / 'a.csv'
    np.savetxt(path, np.column_stack([np.arange(600) / 100, MESSAGES.samples]), delimiter=',',
               comments='', header='time_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z')
    return path


def metadata(folder: Path) -> Path:
    write_mcap(folder / 'a_0.mcap', MESSAGES)
    return write_metadata(folder, ['a_0.mcap'], [('/imu', IMU, 600), ('/x', 'a_msgs/msg/B', 0)])


def ulog(folder: Path) -> Path:
    """Write a log with pyulog: of samples, of bursts, and of increments."""
    pyulog = pytest.importorskip('pyulog')
    from test_px4_ulog import combined, fifo, one, write as write_ulog

    made = {'sensor_combined': combined(), 'sensor_gyro_fifo': fifo(),
            'sensor_accel': one(slice(3, 6))}
    counts = {'sensor_combined': 300, 'sensor_gyro_fifo': 50, 'sensor_accel': 100}
    path = write_ulog(folder / 'made.ulg', {
        name: (form, messages[:counts[name]]) for name, (form, messages) in made.items()})
    pyulog.ULog(str(path)).write_ulog(str(folder / 'a.ulg'))
    return folder / 'a.ulg'


def ardupilot(folder: Path) -> Path:
    """Write a log with pymavlink: of one message for all, of one a sensor, and of batches."""
    pytest.importorskip('pymavlink')
    from test_ardupilot_log import batches, imu, raw, write_with_pymavlink

    head, *parts = batches(0, 1, 0.1)
    batch = [head, *(('ISBD', (*values[:3], *(
        array('h', values[3 + 32 * axis:35 + 32 * axis]) for axis in range(3))))
        for _, values in parts)]
    return write_with_pymavlink(folder / 'a.bin', [
        *imu(200), *raw('GYR', 1000, 200, 0.01), *batch])


SOURCES = {'mcap': mcap('none'), 'mcap_lz4': mcap('lz4'), 'mcap_zstd': mcap('zstd'),
           'mcap_loose': loose_mcap, 'db3': db3, 'db3_zstd': compressed_db3, 'ros1': ros1('none'),
           'ros1_lz4': ros1('lz4'), 'ros1_bz2': ros1('bz2'), 'csv': csv, 'metadata': metadata,
           'ulog': ulog, 'ardupilot': ardupilot}

WHOLE = {'ardupilot': 200 + 200 + 1024}
"""Samples, where there are not 600."""


def assert_recorded(topic: str, messages: ImuBlock) -> None:
    """Require of the topic that was written that its samples are among those that were."""
    if topic == '/imu':
        assert {row.tobytes() for row in messages.samples} <= SAMPLES


def fuzz(folder: Path, source: str, count: int, seed: int) -> None:
    path = SOURCES[source](folder)
    opened = folder if source == 'metadata' else path
    content = path.read_bytes()
    choice = Random(seed)
    assert read_in_part(opened, assert_recorded) == WHOLE.get(source, 600)
    judges = [assert_recorded] if source in ('mcap', 'mcap_lz4', 'mcap_zstd') else []
    read = 0
    for _ in range(count):
        path.write_bytes(mutated_bytes(content, choice))
        start = time.perf_counter()
        read += read_in_part(opened, *judges) > 0
        assert time.perf_counter() - start < 10
    assert read > count / 10


@pytest.mark.parametrize('source', SOURCES)
@pytest.mark.parametrize(('count', 'seed'), [
    (40, 1), *(slow(1000, seed) for seed in range(100, 105))])
def test_mutated_recordings_are_refused_or_read_in_part(tmp_path, source, count, seed):
    if count > 40 and source in ('csv', 'metadata', 'ulog', 'ardupilot'):
        # Ten thousand of every format: other containers are fuzzed in several shapes.
        count *= 2
    fuzz(tmp_path, source, count, seed)
