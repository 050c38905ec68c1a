# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Mutated recordings: an error or a part; no exception, long wait, or sample with a bad sum."""

from random import Random

import bags
from bags import block
from mutations import assert_harmless_on_a_terminal, LONGEST_S, mutated_bytes, read_in_part
import numpy as np
from processes import run
import pytest
from repeated import slow
import zstandard

MESSAGES = block(600)
SAMPLES = {row.tobytes() for row in MESSAGES.samples}


def by(write, *arguments, **options):
    return lambda folder: write(folder / 'a', MESSAGES, *arguments, **options)


def db3_zstd(folder):
    path = bags.write_db3(folder / 'a', MESSAGES)
    path.write_bytes(zstandard.compress(path.read_bytes()))
    return path


def csv(folder):
    path = folder / 'a.csv'
    np.savetxt(path, np.column_stack([np.arange(600) / 100, MESSAGES.samples]), delimiter=',',
               comments='', header='time_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z')
    return path


def metadata(folder):
    bags.write_mcap(folder / 'a_0.mcap', MESSAGES)
    return bags.write_metadata(
        folder, ['a_0.mcap'], [('/imu', bags.IMU, 600), ('/x', 'a_msgs/msg/B', 0)])


def ulog(folder):
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


def ardupilot(folder):
    """Write a log with pymavlink: of one message for all, and of one a sensor."""
    pytest.importorskip('pymavlink')
    from test_ardupilot_log import imu, raw, write as write_log

    return write_log(folder / 'a.bin', [*imu(200), *raw('GYR', 1000, 200, 0.01)])


CHECKED = {f'mcap {name}': by(bags.write_mcap, compression=name, chunk_size=20_000,
                              others=lambda n: n % 3 == 0) for name in bags.COMPRESSIONS}
"""By the checksum of each chunk."""
SOURCES = CHECKED | {
    'mcap without chunks': by(bags.write_mcap, use_chunking=False),
    'db3': by(bags.write_db3, [('/x', 'a_msgs/msg/B')]), 'db3 zstd': db3_zstd,
    **{f'ros1 {name}': by(bags.write_bag, name, lambda n: n % 3)
       for name in bags.ROS1_COMPRESSIONS},
    'csv': csv, 'metadata': metadata, 'ulog': ulog, 'ardupilot': ardupilot}


def assert_recorded(topic, messages):
    """Require of the topic that was written that its samples are among those that were."""
    if topic == '/imu':
        assert {row.tobytes() for row in messages.samples} <= SAMPLES


@pytest.mark.parametrize('source', SOURCES)
@pytest.mark.parametrize(('count', 'seed'), [
    (40, 1), *(slow(1000, seed) for seed in range(100, 105))])
def test_mutated_recordings_are_refused_or_read_in_part(tmp_path, source, count, seed):
    if count > 40 and source in ('csv', 'metadata', 'ulog', 'ardupilot'):
        # Ten thousand of every format: other containers are fuzzed in several shapes.
        count *= 2
    path = SOURCES[source](tmp_path)
    opened = tmp_path if source == 'metadata' else path
    content, choice, read = path.read_bytes(), Random(seed), 0
    judges = [assert_recorded] if source in CHECKED else []
    whole = 200 + 200 if source == 'ardupilot' else 600
    assert read_in_part(opened, assert_recorded) == whole
    for number in range(count):
        path.write_bytes(mutated_bytes(content, choice))
        read += read_in_part(opened, *judges) > 0
        if number % 40 == 0:
            status, out, err = run('info', opened, '--no-progress', most_s=LONGEST_S)
            assert (status in (0, 1), err.count('\n')) == (True, status)
            assert_harmless_on_a_terminal(out + err)
    assert read > count / 10
