# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A folder of tables, a sensor each, as phones record them."""

from bags import no_axes, NO_TIME
from characterized import AXES
from imu_allan import analyze, TimelineOptions
from imu_allan.cli.main import main
from imu_allan.recordings import open_recording, RecordingOptions
import numpy as np
import pytest
from whole_lines import refused

RNG = np.random.default_rng(4)
START_NS = 1_700_000_000_000_000_000
WITHOUT_AXES = 'time,seconds_elapsed,z,y,x\n1,2,3,4,5\n'


def write(folder, name, rate_hz, sigma, up=0.0, header='time,seconds_elapsed,z,y,x'):
    """Write ten seconds of a sensor as Sensor Logger does."""
    noise = RNG.normal([up, 0, 0], sigma, (10 * rate_hz, 3))
    (folder / f'{name}.csv').write_text('\n'.join([header, *(
        f'{START_NS + n * 10**9 // rate_hz},{n / rate_hz},{z!r},{y!r},{x!r}'
        for n, (z, y, x) in enumerate(noise.tolist()))]))


def test_the_files_of_both_sensors_are_one_imu_and_others_can_be_chosen(tmp_path):
    for sensor in (('Gyroscope', 200, 1e-3), ('GyroscopeUncalibrated', 200, 5e-3),
                   ('TotalAcceleration', 100, 1e-2, 9.81), ('Accelerometer', 100, 1e-2),
                   ('Magnetometer', 50, 1e-6)):
        write(tmp_path, *sensor)
    (tmp_path / 'Metadata.csv').write_text('version,device name\n3,phone\n')
    result = analyze(tmp_path)
    axes = result.axes
    assert [axes[name].sample_rate_hz for name in ('gyro_x', 'accel_z')] == pytest.approx(
        [200, 100])
    for name, sigma, rate in (('gyro_x', 1e-3, 200), ('accel_y', 1e-2, 100)):
        assert axes[name].coefficients['noise_density'].value == pytest.approx(
            sigma / rate ** 0.5, rel=0.1)
    assert axes['accel_z'].mean == pytest.approx(9.81, abs=0.01)
    [chosen] = [remark.values for remark in result.warnings if remark.code == 'chosen_topic']
    assert (chosen['topics'], chosen['chosen'], chosen['others']) == (
        4, ['Gyroscope.csv', 'TotalAcceleration.csv'],
        ['Accelerometer.csv', 'GyroscopeUncalibrated.csv'])
    options = RecordingOptions(gyro_topic='GyroscopeUncalibrated.csv',
                               accel_topic='Accelerometer.csv')
    others = analyze(tmp_path, reading=options)
    assert others.source.topic == 'GyroscopeUncalibrated.csv, Accelerometer.csv'
    assert others.timeline.samples == 2000
    assert others.axes['gyro_x'].coefficients['noise_density'].value == pytest.approx(
        5e-3 / 200 ** 0.5, rel=0.1)


@pytest.mark.parametrize(('names', 'headers', 'columns'), [
    (('gyr', 'acc'), ('Timestamp,n,Z,Y,X', 'Timestamp,n,Z,Y,X'), ''),
    (('gyr', 'acc'), ('when,n,z,y,x', 'when,n,z,y,x'), 'time=when'),
    (('Gyroskop', 'Beschleunigung'),
     ('Zeit,n,Rate z,Rate y,Rate x', 'Zeit,n,Kraft z,Kraft y,Kraft x'),
     'time=Zeit,gyro_x=Rate x,gyro_y=Rate y,gyro_z=Rate z,'
     'accel_x=kraft x,accel_y=kraft y,accel_z=kraft z')])
def test_columns_that_the_user_gives_are_those_of_both_files(tmp_path, names, headers, columns):
    write(tmp_path, names[0], 100, 1e-3, header=headers[0])
    write(tmp_path, names[1], 100, 1e-2, 9.81, headers[1])
    pairs = tuple((axis, name) for axis, _, name in (
        each.partition('=') for each in columns.split(',')) if name)
    axes = analyze(tmp_path, reading=RecordingOptions(columns=pairs)).axes
    assert list(axes) == list(AXES)
    assert axes['accel_z'].mean == pytest.approx(9.81, abs=0.01)


def test_axes_that_only_the_files_name_may_be_called_x_axis_as_metawear_does(tmp_path):
    rows = {'Gyroscope': ('deg/s', 90.0, 0.1), 'Accelerometer': ('g', 1.0, 1e-3)}
    for sensor, (unit, mean, sigma) in rows.items():
        noise = RNG.normal([mean, 0, 0], sigma, (1000, 3))
        (tmp_path / f'MetaWear_F1A2B3_{sensor}_100.000Hz_1.7.3.csv').write_text('\n'.join([
            'epoc (ms),timestamp (-0700),elapsed (s),' + ','.join(
                f'{axis}-axis ({unit})' for axis in 'xyz'),
            *(f'{START_NS // 10**6 + 10 * n},2024-06-24T19.02.59.000,{n / 100},{x!r},{y!r},{z!r}'
              for n, (x, y, z) in enumerate(noise.tolist()))]))
    result = analyze(tmp_path)
    assert result.timeline.sample_rate_hz == pytest.approx(100)
    assert [result.axes[axis].mean for axis in ('gyro_x', 'accel_x')] == pytest.approx(
        [np.pi / 2, 9.80665], rel=1e-3)


@pytest.mark.parametrize(('texts', 'said'), [
    ({'Gyroscope': WITHOUT_AXES}, 'its CSV files give no accelerometer'),
    ({'Gyroscope': WITHOUT_AXES, 'Magnetometer': WITHOUT_AXES},
     'its CSV files give no accelerometer; {}/Magnetometer.csv: '
     + no_axes('time,seconds_elapsed,z,y,x')),
    ({'acc': 'accel_x,accel_y,accel_z\n0,1,2\n', 'gyro': 'gyro_x,gyro_y,gyro_z\n0,1,2\n'},
     f'its CSV files give no gyroscope and no accelerometer; {{}}/acc.csv: {NO_TIME}; '
     f'{{}}/gyro.csv: {NO_TIME}'),
], ids=['gyroscope', 'no accelerometer', 'no times'])
def test_it_is_reported_what_the_tables_of_a_folder_lack(tmp_path, texts, said):
    for name, text in texts.items():
        (tmp_path / f'{name}.csv').write_text(text)
    with refused(f'{tmp_path}: a folder of CSV files that are no IMU together: '
                 f'{said.replace("{}", str(tmp_path))}'):
        open_recording(tmp_path)


def test_a_file_whose_columns_are_unknown_is_a_recording_that_fails(tmp_path, capsys):
    (tmp_path / 'a.csv').write_text('1,2,3,4,5,6\n')
    write(tmp_path, 'b', 100, 1e-3, header='time,s,gyro_x,accel_x,accel_y')
    assert main(['info', str(tmp_path)]) == 1
    shown = capsys.readouterr()
    assert f'{tmp_path / "b.csv"}  ' in shown.out
    assert shown.err.startswith(f'imu_allan: {tmp_path / "a.csv"}: no line names the')


def test_tables_without_times_are_counted_at_the_rate(tmp_path):
    rows = '\n'.join(['0,1,2', '1,1,3'] * 200)
    for sensor in ('gyro', 'accel'):
        (tmp_path / f'{sensor}.csv').write_text(f'{sensor}_x,{sensor}_y,{sensor}_z\n{rows}\n')
    result = analyze(tmp_path, options=TimelineOptions(rate_hz=200.0))
    assert result.source.topic == 'gyro.csv, accel.csv'
    assert result.timeline.duration_s == pytest.approx(2.0)
