# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
import csv
import json

from imu_allan.writers.folder import save_folder
from imu_allan.writers.result_file import is_result, load_result, save_result
from imu_allan.writers.words import with_words
import numpy as np
import pytest
from whole_lines import refused

MADE_BY = 'written by: imu_allan analyze RECORDING --json FILE'
NO_RESULT = ('not an imu_allan result file (no "schema": "imu_allan.result/1"); write one with: '
             'imu_allan analyze RECORDING --json FILE')
DENSITY = 'axes.gyro_x.coefficients.noise_density'


def test_a_result_reads_back_as_it_was_written_without_nan_and_its_schema_first(result, tmp_path):
    save_result(result, tmp_path / 'r.json')
    assert load_result(tmp_path / 'r.json') == result

    def no_constant(name):
        raise AssertionError(name)

    document = json.loads((tmp_path / 'r.json').read_text(), parse_constant=no_constant)
    assert next(iter(document.items())) == ('schema', 'imu_allan.result/1')
    walk = document['axes']['gyro_z']['coefficients']['rate_random_walk']
    assert [walk[key] for key in ('observable', 'value', 'ci95')] == [False, None, None]
    assert walk['upper95'] > 0


@pytest.mark.parametrize(('content', 'complaint'), [
    *((content, f': not JSON; give a result file, {MADE_BY}')
      for content in (b'\xff', b'[' * 100_000, b'{"schema": NaN}')),
    (b'{}', f': {NO_RESULT}'),
    (b'{"schema": "imu_allan.result/1"}', ': missing imu_allan_version, source, timeline, axes'),
    (None, ': cannot be read (No such file or directory); give the path of a result file, '
     f'{MADE_BY}')])
def test_a_file_that_is_no_result_is_refused(tmp_path, content, complaint):
    path = tmp_path / 'r.json'
    if content is not None:
        path.write_bytes(content)
    with refused(f'{path}{complaint}'):
        load_result(path)


def changed(document, path, value):
    *parents, last = path
    place = document
    for key in parents:
        place = place[key]
    place[last] = value
    return document


@pytest.mark.parametrize(('path', 'value', 'complaint'), [
    ('axes.gyro_x.unit', 'deg/s',
     'axes.gyro_x: expected quantity angular_velocity in rad/s'),
    (f'{DENSITY}.value', None, f'{DENSITY}: observable, but without value or ci95'),
    (f'{DENSITY}.observable', False, f'{DENSITY}: not observable, but with a value'),
    (f'{DENSITY}.value', '1', f'{DENSITY}.value: expected float, found str'),
    (f'{DENSITY}.value', 1e300, f'{DENSITY}.value: 1e+300 is beyond 1e+60'),
    ('axes.gyro_x.curve.adev', [1.0], 'axes.gyro_x.curve.adev: not as long as tau_s'),
    ('axes.gyro_x.curve.tau_s.0', -1.0, 'axes.gyro_x.curve.tau_s[0]: expected above zero'),
    ('axes.gyro_x.curve', dict.fromkeys(('tau_s', 'adev', 'edf', 'ci68', 'ci95', 'model_adev'),
                                        ()), 'axes.gyro_x.drift_model: there is no curve of it'),
    ('axes.gyro_x.power_law', {'exponent': 3.0, 'exponent_ci95': [2.9, 3.1], 'psd_1hz': 1e-9},
     'axes.gyro_x.power_law.exponent: expected 0 to 2'),
    ('axes.wheel', {}, 'axes.wheel: missing quantity, unit, mean, band_limit_s, tones, '
     'coefficients, goodness_of_fit, curve'),
    ('source.kind', 'dream', "source.kind: 'dream' is not one of recording, topic, datasheet"),
    (DENSITY, {'symbol': 'N', 'unit': 'rad/s/sqrt(Hz)', 'observable': False, 'value': None,
               'ci95': None, 'upper95': 1.0},
     'sensors.gyro: good, but an axis has no noise density'),
    ('timeline.duration_s', -1.0, 'timeline.duration_s: expected zero or above')])
def test_a_result_that_contradicts_itself_is_refused(result, tmp_path, path, value, complaint):
    keys = [int(key) if key.isdigit() else key for key in path.split('.')]
    judged = with_words(result).to_dict()
    (tmp_path / 'r.json').write_text(json.dumps(changed(judged, keys, value)))
    with refused(f'{tmp_path / "r.json"}.{complaint}'):
        load_result(tmp_path / 'r.json')


def test_the_curve_table_reads_back_exactly(result, tmp_path):
    save_folder(result, tmp_path)
    with (tmp_path / 'curve.csv').open(newline='') as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == sum(len(axis.curve.tau_s) for axis in result.axes.values())
    curve = result.axes['accel_y'].curve
    mine = [row for row in rows if row['axis'] == 'accel_y']
    assert {row['unit'] for row in mine} == {'m/s^2'}
    for names, values in (
            (['tau_s'], curve.tau_s), (['adev'], curve.adev), (['edf'], curve.edf),
            (['ci68_low', 'ci68_high'], curve.ci68), (['ci95_low', 'ci95_high'], curve.ci95),
            (['model_adev'], curve.model_adev)):
        read = np.array([[float(row[name]) for name in names] for row in mine])
        assert read.tolist() == np.reshape(values, read.shape).tolist()


@pytest.mark.parametrize('name', ['rec_0.mcap', 'rec_0.db3', 'metadata.yaml', 'rec.bag'])
def test_a_folder_with_a_recording_is_one_whatever_result_lies_beside_it(tmp_path, name):
    (tmp_path / 'result.json').write_text('{}')
    assert is_result(tmp_path)
    (tmp_path / name).write_bytes(b'')
    assert not is_result(tmp_path)
    assert is_result(tmp_path / 'result.json')
    assert not is_result(tmp_path / 'nothing')
