# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Sensors in halves: two topics, one IMU; united by copying or interpolating."""

from dataclasses import replace

from bags import mcap_written, serialized
from characterized import messages, said, streamed
from imu_allan import analyze, TimelineOptions
from imu_allan.block import joined
from imu_allan.datasheet import check, zero_bias
from imu_allan.recordings import RecordingOptions
from imu_allan.sensor.noise_model import parse_model
from imu_allan.writers.key_figures import verdict_lines
import numpy as np
import pytest
from whole_lines import refused

NOISE = np.random.default_rng(5)


def block(rate_hz, count, gyro, accel):
    """Return white noise of the halves that are there; the other is exactly zero."""
    there = np.repeat([gyro, accel], 3)
    return messages(there * (NOISE.normal(size=(count, 6)) * np.repeat([0.01, 0.1], 3)
                             + [0, 0, 0, 0, 0, 9.8]), rate_hz)


def write(path, topics):
    with mcap_written(path) as message:
        for topic, given in topics.items():
            for stamp, row in serialized(given):
                message(topic, stamp, row)
    return path


def assert_characterized(result, gyro_hz, accel_hz, within=1e-4):
    assert list(result.axes) == ['gyro_x', 'gyro_y', 'gyro_z', 'accel_x', 'accel_y', 'accel_z']
    for name, axis in result.axes.items():
        rate, sigma = (gyro_hz, 0.01) if name.startswith('gyro') else (accel_hz, 0.1)
        assert axis.sample_rate_hz == pytest.approx(rate, rel=within)
        assert axis.coefficients['noise_density'].value == pytest.approx(
            sigma / rate**0.5, rel=0.1)


def repeated(result):
    return [found.values for found in said(result, 'repeated_half')]


def read(path, topic=None, **options):
    """Give what is read, and what is reported of how the recording was made."""
    result = analyze(path, topic, reading=RecordingOptions(**options))
    return result.source.topic, [found for found in result.warnings if found.code in (
        'interpolated', 'repeated_half')]


def test_two_topics_of_one_half_each_are_one_imu_with_a_rate_for_each_sensor(tmp_path, output_of):
    path = write(tmp_path / 'a.mcap', {
        '/accel': block(250, 5000, False, True), '/gyro': block(400, 8000, True, False)})
    result = analyze(path)
    assert_characterized(result, 400, 250)
    assert result.source.topic == '/gyro, /accel'
    [remark] = said(result, 'two_rates')
    assert remark.values == {'sensors': ['gyro', 'accel'], 'topics': ['/gyro', '/accel'],
                             'rates_hz': pytest.approx([400, 250], rel=1e-3)}
    shown = output_of('info', path)
    assert ('one IMU in two halves: the gyroscope from /gyro, the accelerometer from /accel'
            ) in shown.splitlines()
    assert 'unusable' not in shown
    assert [line.split()[1] for line in shown.splitlines() if line.startswith('  rate')] == [
        '250', '400']


def test_a_sensor_that_stops_early_is_judged_by_its_own_samples(tmp_path):
    result = analyze(write(tmp_path / 'a.mcap', {
        '/accel': block(100, 1500, False, True), '/gyro': block(100, 20_000, True, False)}))
    gyro, accel = verdict_lines(result)
    assert gyro.startswith('Gyroscope: N is good')
    assert accel == 'Accelerometer: use with care: 15 s at rest.'
    limits = parse_model('gyro: {x: {noise_density: 1 rad/s/sqrt(Hz)}}\n'
                         'accel: {x: {noise_density: 1 m/s^2/sqrt(Hz), zero_bias: 1 m/s^2}}')
    assert [(one.verdict, one.reason) for one in check(result, limits, shortest_s=60.0)[1:]] == [
        ('cannot tell', f'accel_x {what}: 15 s of data, and no less than 60 s may pass')
        for what in ('N', 'zero bias')]
    lasting, early = (replace(result, axes={'accel_x': replace(
        result.axes['accel_x'], rest_s=rest_s)}) for rest_s in (None, 15.0))
    assert zero_bias(early, 'accel_x', 0.0).ci95 != zero_bias(lasting, 'accel_x', 0.0).ci95


def test_what_cannot_be_known_is_asked_for(tmp_path):
    path = write(tmp_path / 'a.mcap', {
        '/a': block(250, 200, False, True), '/b': block(400, 200, True, False),
        '/c': block(400, 200, True, True)})
    with refused(f'{path}: 3 Imu topics; choose one with --topic, or analyze each with '
                 '--all-topics: /a (200 messages), /b (200 messages), /c (200 messages)'):
        read(path)
    assert read(path, '/c')[0] == '/c'
    assert read(path, gyro_topic='/b', accel_topic='/c')[0] == '/b, /c'
    with refused('--gyro-topic needs --accel-topic, too: an IMU on two topics has both'):
        read(path, gyro_topic='/b')
    with refused('--topic names one topic, --gyro-topic and --accel-topic two; give the one or '
                 'the two'):
        read(path, '/c', gyro_topic='/b', accel_topic='/c')


@pytest.mark.parametrize('rates_hz', [(200.0, 62.5), (200.0, 200.0), (100.0, 400.0)])
@pytest.mark.parametrize('absent', ['covariance of -1', 'NaN'])
def test_sensors_that_send_in_turn_on_one_topic_are_analyzed_apart(tmp_path, rates_hz, absent):
    halves = [block(rate_hz, round(40 * rate_hz), gyro, not gyro)
              for rate_hz, gyro in zip(rates_hz, (True, False), strict=True)]
    for part, other in zip(halves, (1, 0), strict=True):
        part.header_ns[:] += 1_300_000 * other
        if absent == 'NaN':
            part.samples[:, 3 * other:3 * other + 3] = np.nan
        else:
            part.absent[:, other] = True
    both = joined(halves)
    both = replace(both, receive_ns=both.header_ns).part(np.argsort(both.header_ns))
    result = analyze(write(tmp_path / 'a.mcap', {'/imu': both}))
    assert_characterized(result, *rates_hz)
    assert {found.code for found in result.warnings} <= {
        'two_rates', 'short_recording', 'trend_or_walk'}
    assert result.timeline.samples == round(40 * rates_hz[0])
    # A node does not choose, and says what to do.
    with refused('bag, topic /imu: each message has one sensor only, gyroscope or accelerometer: '
                 'name the topic twice, as gyro_topic and as accel_topic'):
        streamed([both])


@pytest.mark.parametrize('rate_hz', [200, 250])
@pytest.mark.parametrize('step', [0.0, 0.07])
def test_a_half_that_is_copied_is_analyzed_at_its_own_rate(tmp_path, rate_hz, step):
    both = block(400, 8_000, True, False)
    slow = block(rate_hz, 8_000, False, True)
    # Coarse samples sometimes repeat by chance, too.
    if step:
        slow.samples[:] = np.round(slow.samples / step) * step
    held = np.searchsorted(slow.header_ns, both.header_ns, 'right') - 1
    both.samples[:, 3:] = slow.samples[held, 3:]
    both.header_ns[:] += np.rint(NOISE.normal(0, 30_000, len(both))).astype(np.int64)
    path = write(tmp_path / 'a.mcap', {'/imu': both})
    result = analyze(path)
    assert repeated(result) == [{'recording': str(path), 'topic': '/imu', 'half': 'accel'}]
    assert_characterized(result, 400, rate_hz, 1e-2 if step else 1e-4)
    assert not said(result, 'many_missing') + said(result, 'held_values')
    stated = analyze(path, options=TimelineOptions(rate_hz=401.0)).axes
    assert stated['gyro_x'].sample_rate_hz == 401.0
    assert stated['accel_x'].sample_rate_hz == pytest.approx(rate_hz, rel=1e-2)


def interpolated(path, rate_hz, phase=0.0):
    """Write an accelerometer that a driver interpolates from fewer samples to 400 Hz."""
    both = block(400, 16_000, True, False)
    slow = block(rate_hz, 22_000, False, True)
    slow.header_ns[:] -= round(phase * 5_000_000)
    for column in range(3, 6):
        both.samples[:, column] = np.interp(
            both.header_ns, slow.header_ns, slow.samples[:, column])
    return write(path, {'/imu': both})


@pytest.mark.parametrize('rate_hz', [63, 100, 200])
def test_a_half_that_is_interpolated_on_straight_lines_is_reported(tmp_path, rate_hz):
    path = interpolated(tmp_path / 'a.mcap', rate_hz)
    topic, [remark] = read(path)
    assert (topic, remark.code) == ('/imu', 'interpolated')
    assert remark.values == {'recording': str(path), 'topic': '/imu', 'half': 'accel'}


@pytest.mark.parametrize(('rate_hz', 'phase'), [(250, 0), (200, .05), (200, .25)])
def test_a_half_that_is_interpolated_from_two_thirds_is_band_limited(tmp_path, rate_hz, phase):
    result = analyze(interpolated(tmp_path / 'a.mcap', rate_hz, phase))
    [found] = said(result, 'band_limited')
    assert found.axes == ('accel_x', 'accel_y', 'accel_z')
    for axis in found.axes:
        assert result.axes[axis].coefficients['noise_density'].value == pytest.approx(
            0.1 / rate_hz**0.5, rel=0.06)


def test_coarse_and_vibrating_samples_are_neither_copied_nor_interpolated(tmp_path):
    coarse = block(400, 5_000, True, True)
    coarse.samples[:, :3] = np.round(coarse.samples[:, :3] / 0.02) * 0.02
    phase = np.pi / 2 * np.arange(5_000)
    coarse.samples[:, 3:] += 2 * np.sin(phase)[:, np.newaxis]
    assert read(write(tmp_path / 'a.mcap', {'/imu': coarse})) == ('/imu', [])


def test_acceleration_in_g_is_taken_as_g_with_a_warning(tmp_path):
    in_g = block(100, 3_000, True, True)
    in_g.samples[:, 3:] /= 9.80665
    path = write(tmp_path / 'a.mcap', {'/imu': in_g})
    result = analyze(path)
    assert result.axes['accel_z'].mean == pytest.approx(9.8, abs=0.01)
    assert said(result, 'unit_g')
    stated = analyze(path, reading=RecordingOptions(accel_unit='g', gyro_unit='deg/s'))
    assert not said(stated, 'unit_g')
    assert stated.axes['accel_z'].mean == pytest.approx(9.8, abs=0.01)
    assert stated.axes['gyro_x'].coefficients['noise_density'].value == pytest.approx(
        result.axes['gyro_x'].coefficients['noise_density'].value * np.pi / 180, rel=1e-6)
    plain = analyze(path, reading=RecordingOptions(accel_unit='m/s^2'))
    assert plain.axes['accel_z'].mean == pytest.approx(0.9993, abs=0.01)
    with refused('--accel unit deg/s: deg/s cannot be turned into m/s^2; write m/s^2 or g, '
         'of counts g/16384'):
        RecordingOptions(accel_unit='deg/s')


@pytest.mark.parametrize('other', [0.0, float('nan')], ids=['zero', 'none'])
@pytest.mark.parametrize('sensor', ['gyro', 'accel'])
def test_a_sensor_alone_that_is_polled_too_fast_is_no_copied_half(tmp_path, sensor, other):
    both = block(400, 8_000, sensor == 'gyro', sensor == 'accel')
    both.samples[:] = both.samples[np.arange(8_000) // 2]
    both.samples[:, slice(3, None) if sensor == 'gyro' else slice(3)] = other
    result = analyze(write(tmp_path / 'a.mcap', {'/imu': both}))
    axes = [result.axes[f'{sensor}_{axis}'] for axis in 'xyz']
    assert [axis.sample_rate_hz or result.timeline.sample_rate_hz for axis in axes] == (
        pytest.approx([200.0] * 3))
    assert [axis.coefficients['noise_density'].value for axis in axes] == pytest.approx(
        [(0.01 if sensor == 'gyro' else 0.1) / 200**0.5] * 3, rel=0.1)
    assert said(result, 'held_values')
    assert not repeated(result) + said(result, 'two_rates')
