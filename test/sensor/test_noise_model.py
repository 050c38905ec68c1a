# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Datasheets and noise models: their units, their text, and a simulated IMU."""

import contextlib
from pathlib import Path

from hypothesis import given, strategies as st
from imu_allan.errors import ImuAllanError
from imu_allan.result import GaussMarkov
from imu_allan.sensor import units
from imu_allan.sensor.noise_model import load_model, parse_model
from imu_allan.sensor.simulated_imu import simulated_blocks, SimulatedImu
from imu_allan.sensor.units import parse, STANDARD_GRAVITY
import numpy as np
import pytest
from whole_lines import refused, Varying

DEG, DEG_H, DEG_H2, DEG_ROOT_H = (
    0.017453292519943295, 4.848136811e-6, 1.346704670e-9, 2.908882087e-4)
UG = 9.80665e-6
GYRO_N = 'rad/s/sqrt(Hz)'
ACCEL_N = 'm/s^2/sqrt(Hz)'
COMMA = 'has a decimal comma where a point belongs'
NO_NUMBER = 'does not begin with a number'
NO_RATE = 'is not in a unit that can be turned into rad/s'
RIGHT = "write a number with its unit, such as '1 deg/h' or '1 rad/s'"
CONSUMER = parse_model(
    'gyro: {noise_density: 0.005 deg/s/sqrt(Hz), bias_instability: 10 deg/h, mean: 0.1 deg/s}\n'
    'accel: {noise_density: 100 ug/sqrt(Hz), gauss_markov: {sigma: 50 ug, '
    'correlation_time: 30 s}}')


@pytest.mark.parametrize(('text', 'unit', 'expected'), [
    ('1 deg/h', 'rad/s', DEG_H), ('1 deg/sqrt(h)', GYRO_N, DEG_ROOT_H),
    ('1 deg/h/sqrt(h)', 'rad/s^2/sqrt(Hz)', 8.080228018e-8),
    ('1 deg/h^2', 'rad/s^2', DEG_H2), ('1 ug', 'm/s^2', UG),
    ('60 m/s/sqrt(h)', ACCEL_N, 1.0), ('100 ug/sqrt(Hz)', ACCEL_N, 100 * UG),
    ('2 min', 's', 120.0), *((text, GYRO_N, 5.235987756e-4) for text in (
        '0.03deg/s/sqrt(Hz)', '0.03 °/s/√Hz', '0.03 º/s/√Hz', '0.03 ˚/s/√Hz', '0.03 deg/s/rtHz',
        '30 mdps/sqrt(Hz)', '3e-2 deg/s/Hz^0.5', '0.03 deg/(s*sqrt( Hz ))',
        '.03 degrees sec^-1/sqrt(Hz)', '108 dph/root Hz', '0.03 deg/s/Hz½', '1.8 deg/rt-hr'))])
def test_units_of_datasheets_in_any_spelling_have_their_textbook_value(text, unit, expected):
    assert parse(text, unit) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(('text', 'complaint'), [
    ('0,005 deg/h', COMMA), ('0.03', 'has no unit'), ('deg/h', NO_NUMBER),
    ('nan deg/h', NO_NUMBER), ('1e999 deg/h', 'is too large'), ('1e308 rad/us', 'is too large'),
    *((text, NO_RATE) for text in (
        '3 deg', '3 1/s', '3 kg', '3 deg/h^99', '3 deg//h', '3 (((h^9)^9)^9)^9',
        '3 __import__("os")', '3 deg/h 5', '1 rad/s)', '1 (rad/s', '1 rad/', '1 rad/s^'))])
def test_what_is_not_an_angular_rate_is_refused_with_an_example(text, complaint):
    with refused(f'{text!r} {complaint}; {RIGHT}'):
        parse(text, 'rad/s')


def test_a_long_text_is_shown_in_part():
    text = '1 ' + 'rad/' * 200 + 's'
    with refused(f"'{text[:80]}...' {NO_RATE}; {RIGHT}"):
        parse(text, 'rad/s')


@given(st.text(max_size=60)
       | st.text(alphabet='degsqrthHzmuradg/^*()0123456789. -√°', max_size=40).map('1 '.__add__))
def test_any_text_gives_a_number_or_the_known_error(text):
    for unit in ('rad/s', ACCEL_N):
        with contextlib.suppress(ImuAllanError):
            assert isinstance(parse(text, unit), float)


@given(st.sampled_from(sorted(units.ENGINEERING_UNITS)),
       st.floats(1e-12, 1e6, allow_nan=False, allow_infinity=False))
def test_engineering_units_convert_back_to_the_same_value(unit, value):
    shown, name = units.engineering(value, unit)
    assert parse(f'{shown!r} {name}', unit) == pytest.approx(value, rel=1e-12)


def test_the_unit_of_a_value_is_what_follows_the_number_and_is_typeset():
    unit = 'rad/s^2/sqrt(Hz)'
    assert units.typeset(unit) == 'rad/s²/√Hz'
    assert units.unit_of(f'0.03 {unit}') == unit
    with refused(f'{unit!r} does not begin with a number'):
        units.unit_of(unit)


CONFIG = Path(__file__).parents[2] / 'config'
KEYS = ('quantization_noise, noise_density, bias_instability, rate_random_walk, rate_ramp, '
        'gauss_markov, mean, zero_bias, temperature_drift, turn_on_bias, x, y, z')
NEITHER = ("names neither 'gyro' nor 'accel'; write for instance "
           'gyro: {noise_density: 0.03 deg/s/sqrt(Hz)}')
OF_DENSITY = "write a number with its unit, such as '1 deg/sqrt(h)' or '1 rad/s/sqrt(Hz)'"
N, B = 'noise_density', 'bias_instability'


@pytest.mark.parametrize(('text', 'axes'), [
    ('gyro: {noise_density: 1 deg/sqrt(h)}',
     {axis: {N: DEG_ROOT_H} for axis in ('gyro_x', 'gyro_y', 'gyro_z')}),
    # An axis goes before its sensor.
    ('accel: {noise_density: 100 ug/sqrt(Hz), bias_instability: 40 ug, '
     'z: {noise_density: 200 ug/sqrt(Hz)}}',
     {f'accel_{letter}': {N: density * UG, B: 40 * UG}
      for letter, density in (('x', 100), ('y', 100), ('z', 200))}),
    ('accel: {x: {noise_density: 100 ug/sqrt(Hz)}}', {'accel_x': {N: 100 * UG}}),
    ('gyro: {z: {rate_ramp: -5 deg/h^2}}', {'gyro_z': {'rate_ramp': -5 * DEG_H2}})])
def test_what_stands_under_a_sensor_holds_for_its_axes_and_others_are_missing(text, axes):
    model = parse_model(f'name: Mine\n{text}')
    assert model.name == 'Mine'
    assert model.axes == {axis: pytest.approx(values) for axis, values in axes.items()}


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
                        'accel: {zero_bias: 20 mg, z: {turn_on_bias: 2 mg}}')
    assert model.limits['gyro_x'] == {'zero_bias': pytest.approx(0.5 * DEG),
                                      'temperature_drift': pytest.approx(36 * DEG_H)}
    assert model.limits['accel_z'] == pytest.approx({
        'zero_bias': 20e3 * UG, 'turn_on_bias': 2e3 * UG})
    assert set(model.limits['accel_x']) == {'zero_bias'}
    assert model.as_written['accel_z'] == {'zero_bias': '20 mg', 'turn_on_bias': '2 mg'}
    assert model.axes['accel_x'] == {}


def test_a_model_may_have_a_mean_and_a_gauss_markov_process():
    model = parse_model('gyro: {z: {mean: -1 deg/s, '
                        'gauss_markov: {sigma: 1 rad/s, correlation_time: 2 min}}}')
    assert model.gauss_markov == {'gyro_z': GaussMarkov(1.0, 120.0)}
    assert model.mean['gyro_z'] == pytest.approx(-DEG)


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
    ('gyro: {noise_density: 0.03}', f"gyro.noise_density: '0.03' has no unit; {OF_DENSITY}"),
    ('gyro: {noise_density: }',
     f"gyro.noise_density: '' does not begin with a number; {OF_DENSITY}"),
    ('accel: {x: {bias_instability: 18 deg/h}}', "accel.x.bias_instability: '18 deg/h' is not "
     "in a unit that can be turned into m/s^2; write a number with its unit, such as '1 ug' or "
     "'1 m/s^2'"),
    ('gyro: {noise: 1 deg/sqrt(h)}', f"gyro: unknown key 'noise'; known are {KEYS}"),
    ('gyro: {noise_densty: 1 deg/sqrt(h)}', "gyro: unknown key 'noise_densty', did you mean "
     f'noise_density? known are {KEYS}'),
    ('gyro: {}\nacel: {}', "unknown key 'acel', did you mean accel? known are name, gyro, accel"),
    ('gyro: {noise_density: [1]}', 'gyro.noise_density: expected a value with its unit, such as '
     "'1 rad/s/sqrt(Hz)'"),
    ('gyro: {noise_density: -1 deg/sqrt(h)}', "gyro.noise_density: '-1 deg/sqrt(h)' is negative; "
     'a noise coefficient is zero or greater'),
    ('name: [1]\ngyro: {}', 'name: expected a text, such as My IMU'),
    ('gyro: {' + 100 * 'k' + ': 1}',
     f"gyro: unknown key '{28 * 'k'}…{28 * 'k'}'; known are {KEYS}"),
    ('accel: {velocity_random_walk: 0.1 m/s/sqrt(h), noise_density: 1 ug/sqrt(Hz)}',
     'accel: velocity_random_walk and noise_density are the same; keep one'),
    ('name: My IMU\ngyro: {noise_density: 1 deg/sqrt(h)}\ngyro: {bias_instability: 1 deg/h}',
     "line 3 is not YAML ('gyro' is given twice; keep one)"),
    ('gyro:\n  noise_density: 1 deg/sqrt(h)\n  noise_density: 2 deg/sqrt(h)',
     "line 3 is not YAML ('noise_density' is given twice; keep one)"),
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


def test_every_shipped_model_is_read_and_table_2_has_the_values_of_the_paper():
    shipped = {path.stem: load_model(path) for path in CONFIG.glob('*.yaml')
               if 'ros__parameters' not in path.read_text()}
    assert len(shipped) >= 5
    assert all(model.name and model.axes for model in shipped.values())
    assert shipped['allan_variance_table2'].axes['gyro_x'] == pytest.approx({
        'quantization_noise': 2e-4 * DEG, N: 8e-3 * DEG_ROOT_H, B: 0.1 * DEG_H,
        'rate_random_walk': 8.080228018e-8, 'rate_ramp': 5 * DEG_H2})


def test_every_axis_has_noise_of_its_own_and_another_seed_gives_other_noise():
    samples = SimulatedImu(CONSUMER, 100.0, seed=1).draw(20_000)
    other = SimulatedImu(CONSUMER, 100.0, seed=2).draw(20_000)
    correlation = np.corrcoef(np.diff(np.concatenate((samples, other), axis=1), axis=0).T)
    np.testing.assert_array_less(np.abs(correlation - np.eye(12)), 0.05)


def test_accelerometer_at_rest_measures_gravity_unless_the_model_names_a_mean():
    lying = parse_model('accel: {noise_density: 100 ug/sqrt(Hz), x: {mean: 1 g}}')
    for model, up in ((CONSUMER, [0, 0, 1]), (lying, [1, 0, 0])):
        accel = SimulatedImu(model, 100.0).draw(5000)[:, 3:].mean(axis=0)
        np.testing.assert_allclose(accel, np.multiply(up, STANDARD_GRAVITY), atol=0.02)


def test_blocks_cover_the_samples_with_even_stamps_and_a_sensor_left_out_is_absent():
    blocks = list(simulated_blocks(CONSUMER, 300.0, 25_000, start_ns=10**18, frame_id='f',
                                   block_samples=700))
    stamps = np.concatenate([block.header_ns for block in blocks])
    assert len(stamps) == 25_000
    assert all(block.frame_id == 'f' for block in blocks)
    np.testing.assert_allclose(stamps - 10**18, np.arange(25_000) * (1e9 / 300), atol=0.6)
    np.testing.assert_array_equal(np.concatenate([block.samples for block in blocks]),
                                  SimulatedImu(CONSUMER, 300.0).draw(25_000))
    gyro_only = parse_model('gyro: {noise_density: 0.005 deg/s/sqrt(Hz)}')
    block = next(iter(simulated_blocks(gyro_only, 100.0, 10)))
    np.testing.assert_array_equal(block.absent, np.tile([False, True], (10, 1)))
