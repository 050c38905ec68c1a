# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings for the tests of the command, written once."""

from pathlib import Path

from imu_allan.sensor.noise_model import NoiseModel, parse_model
from imu_allan.sensor.simulated_imu import simulated_blocks
import pytest

RATE_HZ = 100.0
SAMPLES = 30_000
START_NS = 1_700_000_000 * 10**9


@pytest.fixture(scope='session')
def model() -> NoiseModel:
    return parse_model('gyro: {noise_density: 0.005 deg/s/sqrt(Hz), bias_instability: 20 deg/h}\n'
                       'accel: {noise_density: 150 ug/sqrt(Hz)}')


@pytest.fixture(scope='session')
def recording(tmp_path_factory: pytest.TempPathFactory, model: NoiseModel) -> Path:
    """Five minutes of a simulated IMU, topic /imu/data_raw, MCAP."""
    from imu_allan.recordings.write import write_recording

    blocks = simulated_blocks(model, RATE_HZ, SAMPLES, start_ns=START_NS)
    return write_recording(tmp_path_factory.mktemp('recordings') / 'at_rest', blocks)
