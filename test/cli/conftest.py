# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings for the tests of the command, written once, and the result of one."""

import json

import imu_allan
from imu_allan.cli.main import main
from imu_allan.sensor.noise_model import parse_model
from imu_allan.sensor.simulated_imu import simulated_blocks
from imu_allan.writers.result_files import save_result
import pytest

GYRO = 'gyro: {noise_density: 0.005 deg/s/sqrt(Hz), bias_instability: 20 deg/h}\n'


@pytest.fixture(scope='session')
def model():
    return parse_model(GYRO)


def written(folder, model):
    from imu_allan.recordings.write import write_recording

    return write_recording(folder / 'at_rest', simulated_blocks(
        model, 100.0, 30_000, start_ns=1_700_000_000 * 10**9))


@pytest.fixture(scope='session')
def recording(tmp_path_factory, model):
    """Five minutes of a simulated gyroscope, topic /imu/data_raw, MCAP."""
    return written(tmp_path_factory.mktemp('recordings'), model)


@pytest.fixture(scope='session')
def imu_recording(tmp_path_factory):
    """As long, with an accelerometer: its fit takes twice the time."""
    model = parse_model(f'{GYRO}accel: {{noise_density: 150 ug/sqrt(Hz)}}')
    return written(tmp_path_factory.mktemp('recordings'), model)


@pytest.fixture(scope='session')
def result_file(imu_recording, tmp_path_factory):
    """Return the result of the recording with an accelerometer, that nobody changes."""
    path = tmp_path_factory.mktemp('result') / 'result.json'
    save_result(imu_allan.analyze(imu_recording), path)
    return path


@pytest.fixture
def analyzed(tmp_path):
    def run(*arguments):
        path = tmp_path / 'analyzed.json'
        assert main(['analyze', *map(str, arguments), '--json', str(path)]) == 0
        return json.loads(path.read_text())
    return run
