# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A folder of tables, a sensor each, as phones record them."""

from pathlib import Path

from imu_allan import analyze
from imu_allan.cli.main import main
from imu_allan.errors import ImuAllanError
from imu_allan.recordings import open_recording, RecordingOptions
from imu_allan.recordings.halves import choose_streams, Stream
import numpy as np
import pytest

RNG = np.random.default_rng(4)
START_NS = 1_700_000_000_000_000_000


def write(folder: Path, name: str, rate_hz: int, sigma: float, up: float = 0.0,
          header: str = 'time,seconds_elapsed,z,y,x') -> None:
    """Write ten seconds of a sensor as Sensor Logger does."""
    noise = RNG.normal([up, 0, 0], sigma, (10 * rate_hz, 3))
    (folder / f'{name}.csv').write_text('\n'.join([header, *(
        f'{START_NS + n * 10**9 // rate_hz},{n / rate_hz},{z!r},{y!r},{x!r}'
        for n, (z, y, x) in enumerate(noise.tolist()))]))


def phone(folder: Path) -> Path:
    write(folder, 'Gyroscope', 200, 1e-3)
    write(folder, 'GyroscopeUncalibrated', 200, 5e-3)
    write(folder, 'TotalAcceleration', 100, 1e-2, 9.81)
    write(folder, 'Accelerometer', 100, 1e-2)
    write(folder, 'Magnetometer', 50, 1e-6)
    (folder / 'Metadata.csv').write_text('version,device name\n3,phone\n')
    return folder


def test_the_files_of_both_sensors_are_one_imu(tmp_path):
    result = analyze(phone(tmp_path))
    axes = result.axes
    assert [axes[name].sample_rate_hz for name in ('gyro_x', 'accel_z')] == pytest.approx(
        [200, 100])
    for name, sigma, rate in (('gyro_x', 1e-3, 200), ('accel_y', 1e-2, 100)):
        assert axes[name].coefficients['noise_density'].value == pytest.approx(
            sigma / rate ** 0.5, rel=0.1)
    assert axes['accel_z'].mean == pytest.approx(9.81, abs=0.01)
    [told] = [remark.message for remark in result.warnings if remark.code == 'chosen_topic']
    assert told == (
        f'{tmp_path}: of 4 IMU topics Gyroscope and TotalAcceleration are read, by the names of '
        'the files; --topic, or --gyro-topic and --accel-topic, choose among Accelerometer, '
        'GyroscopeUncalibrated')


def test_other_files_of_the_folder_can_be_chosen(tmp_path):
    options = RecordingOptions(gyro_topic='GyroscopeUncalibrated', accel_topic='Accelerometer')
    with open_recording(phone(tmp_path), options=options) as recording:
        assert choose_streams(recording) == [
            Stream('GyroscopeUncalibrated', 'gyro'), Stream('Accelerometer', 'accel')]
        blocks = [block for block, _ in recording.decoded('GyroscopeUncalibrated')]
    assert sum(map(len, blocks)) == 2000
    assert np.concatenate([block.samples for block in blocks])[:, 0].std() == pytest.approx(
        5e-3, rel=0.1)


def test_info_lists_the_files_of_the_folder(tmp_path, capsys):
    assert main(['info', str(phone(tmp_path))]) == 0
    shown = capsys.readouterr().out
    assert all(f'\n{name}\n' in shown for name in ('Gyroscope', 'TotalAcceleration'))


@pytest.mark.parametrize('names', [['Gyroscope'], ['Gyroscope', 'Magnetometer'], []])
def test_a_folder_without_both_sensors_is_no_imu(tmp_path, names):
    for name in names:
        write(tmp_path, name, 100, 1e-3)
    with pytest.raises(ImuAllanError, match='not a rosbag2 directory'):
        open_recording(tmp_path)


def test_of_many_tables_the_user_chooses(tmp_path):
    for name in ('gyro_1', 'gyro_2', 'acc_1'):
        write(tmp_path, name, 100, 1e-3)
    with pytest.raises(ImuAllanError, match='3 Imu topics; choose one with --topic: acc_1, gyro'):
        analyze(tmp_path)
