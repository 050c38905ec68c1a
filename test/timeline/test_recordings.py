# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The timeline of real recordings; IMU_ALLAN_DATA names the folder that holds them."""

import os
from pathlib import Path

from imu_allan.recordings import open_recording, read_blocks
from imu_allan.timeline import TimelineSummary
from imu_messages import codes, run
import pytest

DATA = os.environ.get('IMU_ALLAN_DATA')
pytestmark = pytest.mark.skipif(not DATA, reason='IMU_ALLAN_DATA names no folder of recordings')


def summary_of(name: str, topic: str, **options: object) -> TimelineSummary:
    with open_recording(Path(str(DATA)) / name) as recording:
        return run(read_blocks(recording, topic), **options)[0]


def test_repeated_and_backward_header_stamps_of_a_real_driver_are_counted():
    summary = summary_of('robot_localization_test1_2imu_xsens', '/my_odometry2imu/imu_data')
    assert summary.messages == 13_333
    assert (summary.header_repeats, summary.header_backward) == (347, 31)
    assert (summary.timeline.duplicates, summary.timeline.out_of_order) == (347, 31)
    assert summary.timeline.sample_rate_hz == pytest.approx(100.0, rel=1e-4)
    assert not summary.mostly_motion
    assert 'gravity' in codes(summary)


def test_a_real_sensor_at_rest_loses_nothing_but_one_knock_that_is_there():
    summary = summary_of('adis16405_imu2', '/imu/data_raw')
    assert summary.timeline.sample_rate_hz == 100.0
    assert summary.timeline.samples == 1_000_000
    assert summary.timeline.missing == summary.timeline.rejected == 0
    assert summary.timeline.gaps == ()
    # Between 99.3 and 100.2 s all three accelerometers ring with eight times their usual power.
    (knock,) = summary.timeline.motion
    assert knock.start_s < 99.3
    assert knock.start_s + knock.duration_s > 100.2
    assert knock.duration_s <= 3.0
    assert not summary.mostly_motion
