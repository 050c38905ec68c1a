# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

from hypothesis import given, settings, strategies as st
from imu_allan.errors import ImuAllanError
from imu_allan.noise.terms import AXES
from imu_allan.result import GaussMarkov
from imu_allan.sensor.noise_model import load_model, parse_model
import pytest
from whole_lines import refused, Varying

CONFIG = Path(__file__).parents[2] / 'config'
KEYS = ('quantization_noise, noise_density, bias_instability, rate_random_walk, rate_ramp, '
        'gauss_markov, mean, zero_bias, band_limit, lines, temperature_drift, turn_on_bias, '
        'x, y, z')
NEITHER = ("names neither 'gyro' nor 'accel'; write for instance "
           'gyro: {noise_density: 0.03 deg/s/sqrt(Hz)}')
RIGHT = "write a number with its unit, such as '1 deg/sqrt(h)' or '1 rad/s/sqrt(Hz)'"


def test_what_stands_under_a_sensor_holds_for_its_three_axes():
    model = parse_model('gyro: {noise_density: 1 deg/sqrt(h)}')
    assert list(model.axes) == ['gyro_x', 'gyro_y', 'gyro_z']
    for axis in model.axes.values():
        assert axis == {'noise_density': pytest.approx(2.908882087e-4)}


@pytest.mark.parametrize(('name', 'key', 'value'), [
    ('angle_random_walk', 'noise_density', '0.3 deg/sqrt(h)'),
    ('N', 'noise_density', '0.3 deg/sqrt(h)'), ('B', 'bias_instability', '3 deg/h'),
    ('rate-random-walk', 'rate_random_walk', '1 deg/h/sqrt(h)'),
    ('drift rate ramp', 'rate_ramp', '1 deg/h^2')])
def test_a_term_may_be_called_by_the_symbol_or_name_that_the_table_prints(name, key, value):
    model = parse_model(f'gyro: {{{name}: {value}}}')
    assert list(model.axes['gyro_y']) == [key]
    assert model.as_written['gyro_y'] == {key: value}


def test_a_datasheet_may_limit_what_is_no_noise():
    model = parse_model('gyro: {zero_bias: 0.5 deg/s, temperature_drift: 36 deg/h/°C}\n'
                        'accel: {gravity_error: 20 mg, band_limit: 10 ms, lines: 1 mg,\n'
                        '        z: {turn_on_bias: 2 mg}}')
    assert model.limits['gyro_x'] == {'zero_bias': pytest.approx(0.5 * 0.017453292519943295),
                                      'temperature_drift': pytest.approx(36 * 4.848136811e-6)}
    assert set(model.limits['accel_x']) == {'gravity_error', 'band_limit', 'lines'}
    assert model.limits['accel_z']['turn_on_bias'] == pytest.approx(2e-3 * 9.80665)
    assert model.limits['accel_z']['band_limit'] == pytest.approx(0.01)
    assert model.as_written['accel_y']['gravity_error'] == '20 mg'
    assert model.axes['accel_x'] == {}


def test_an_axis_goes_before_its_sensor_and_one_that_is_not_named_is_missing():
    model = parse_model('accel:\n  noise_density: 100 ug/sqrt(Hz)\n  bias_instability: 40 ug\n'
                        '  z: {noise_density: 200 ug/sqrt(Hz)}\n')
    assert model.axes['accel_y']['noise_density'] == pytest.approx(9.80665e-4)
    assert model.axes['accel_z'] == pytest.approx({
        'noise_density': 2 * 9.80665e-4, 'bias_instability': 40 * 9.80665e-6})
    model = parse_model('name: One axis\naccel: {x: {noise_density: 100 ug/sqrt(Hz)}}')
    assert (model.name, list(model.axes)) == ('One axis', ['accel_x'])
    assert model.as_written['accel_x']['noise_density'] == '100 ug/sqrt(Hz)'


def test_a_model_may_have_a_mean_and_a_gauss_markov_process():
    model = parse_model(
        'gyro:\n  z:\n    mean: -1 deg/s\n    rate_ramp: -5 deg/h^2\n'
        '    gauss_markov: {sigma: 1 rad/s, correlation_time: 2 min}')
    assert model.gauss_markov == {'gyro_z': GaussMarkov(1.0, 120.0)}
    assert model.mean['gyro_z'] == pytest.approx(-0.017453292519943295)
    assert model.axes['gyro_z']['rate_ramp'] == pytest.approx(-5 * 1.346704670e-9)


@pytest.mark.parametrize(('text', 'message'), [
    ('gyro: {z: 3}', 'gyro.z: expected keys with values, such as '
     '{noise_density: 0.03 deg/s/sqrt(Hz)}'),
    ('accel: {gauss_markov: {sigma: 1 ug}}', 'accel.gauss_markov: expected sigma and '
     'correlation_time, such as {sigma: 50 ug, correlation_time: 100 s}'),
    ('gyro: {gauss_markov: {sigma: 1 deg/h, correlation_time: 3 m}}',
     "gyro.gauss_markov.correlation_time: '3 m' is not in a unit that can be turned into s; "
     "write a number with its unit, such as '1 s'"),
    ('gyro: {gauss_markov: {sigma: 1 deg/h, correlation_time: 0 s}}',
     'gyro.gauss_markov.correlation_time: must be greater than zero'),
    ('gyro: {}\nbaro: {}', "unknown key 'baro'; known are name, gyro, accel"),
    ('gyr: {noise_density: 1 deg/sqrt(h)}', NEITHER),
    ('gyro: [', 'line 1 is not YAML (<words>)'),
    ('{' * 5000, 'cannot be read as YAML; give a noise model or datasheet YAML file'),
    ('gyro: {noise_density: 0.03}', f"gyro.noise_density: '0.03' has no unit; {RIGHT}"),
    ('gyro: {noise_density: }',
     f"gyro.noise_density: '' does not begin with a number; {RIGHT}"),
    ('accel: {x: {bias_instability: 18 deg/h}}', "accel.x.bias_instability: '18 deg/h' is not "
     "in a unit that can be turned into m/s^2; write a number with its unit, such as '1 ug' or "
     "'1 m/s^2'"),
    ('gyro: {noise: 1 deg/sqrt(h)}', f"gyro: unknown key 'noise'; known are {KEYS}"),
    ('gyro: {noise_density: [1]}', 'gyro.noise_density: expected a value with its unit, such as '
     "'1 rad/s/sqrt(Hz)'"),
    ('gyro: {noise_density: -1 deg/sqrt(h)}', "gyro.noise_density: '-1 deg/sqrt(h)' is negative; "
     'a noise coefficient is zero or greater'),
    ('name: [1]\ngyro: {}', 'name: expected a text, such as My IMU'),
    ('gyro: {' + 100 * 'k' + ': 1}', "gyro: unknown key '" + 59 * 'k' + f'...; known are {KEYS}'),
    ('accel: {z: {gravity_error: 20 mg}}', 'accel.z.gravity_error: is of the three axes together; '
     'write it under accel itself'),
    ('accel: {velocity_random_walk: 0.1 m/s/sqrt(h), noise_density: 1 ug/sqrt(Hz)}',
     'accel: velocity_random_walk and noise_density are the same; keep one'),
])
def test_a_message_says_where_what_and_what_to_write_instead(text, message):
    with refused(Varying(f'spec.yaml: {message}')):
        parse_model(text, 'spec.yaml')


@pytest.mark.parametrize(('content', 'complaint'), [
    (b'\xff\xfe\x00', 'not a text file; give a noise model or datasheet YAML file'),
    (b'#' * 1_000_001, 'too large; give a noise model or datasheet YAML file'),
    (None, 'cannot be read (No such file or directory); give a noise model or datasheet YAML '
     'file')], ids=('no text', 'large', 'missing'))
def test_a_file_that_is_no_model_is_named_with_what_it_may_hold(tmp_path, content, complaint):
    path = tmp_path / 'model.yaml'
    if content is not None:
        path.write_bytes(content)
    with refused(f'{path}: {complaint}'):
        load_model(path)


@settings(max_examples=200)
@given(st.text(alphabet='gyroacel: {}[]xyz\n-&*!|>0123456789.#?"\'', max_size=80))
def test_any_text_gives_a_model_or_the_known_error(text):
    try:
        model = parse_model(text)
    except ImuAllanError as error:
        assert '\n' not in str(error)
    else:
        assert set(model.axes) <= set(AXES)


def test_every_shipped_model_is_read():
    shipped = sorted(path for path in CONFIG.glob('*.yaml')
                     if 'ros__parameters' not in path.read_text())
    assert len(shipped) >= 5
    for path in shipped:
        model = load_model(path)
        assert model.name
        assert model.axes


def test_the_shipped_table_2_has_the_values_of_the_paper():
    axis = load_model(CONFIG / 'allan_variance_table2.yaml').axes['gyro_x']
    assert axis == {
        'quantization_noise': pytest.approx(2e-4 * 0.017453292519943295),
        'noise_density': pytest.approx(8e-3 * 2.908882087e-4),
        'bias_instability': pytest.approx(0.1 * 4.848136811e-6),
        'rate_random_walk': pytest.approx(8.080228018e-8),
        'rate_ramp': pytest.approx(5 * 1.346704670e-9)}
