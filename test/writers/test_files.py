# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What is written to folders and files, read back, and replaced by its own kind alone."""

import csv
from dataclasses import replace
import json
import os

from imu_allan.finding_messages import with_words
from imu_allan.result import Timeline
from imu_allan.writers import result_files
from imu_allan.writers.atomic import kind_of, PICTURES, write_atomically, write_files
from imu_allan.writers.filters import export
from imu_allan.writers.fleet import Fleet, save_fleet
from imu_allan.writers.result_files import (
    curves_csv,
    IncompleteSave,
    is_result,
    load_result,
    save_folder,
)
import numpy as np
import pytest
from whole_lines import refused

MADE_BY = 'written by: imu_allan analyze RECORDING --json FILE'
NO_RESULT = ('not an imu_allan result file (no "schema": "imu_allan.result/1"); write one with: '
             'imu_allan analyze RECORDING --json FILE')
CONTRADICTS = ('axes.gyro_x: names, units, numbers or lengths do not fit together; analyze the '
               'recording again')
DENSITY = 'axes.gyro_x.coefficients.noise_density'


@pytest.mark.parametrize(('content', 'complaint'), [
    *((content, f': not JSON; give a result file, {MADE_BY}')
      for content in (b'\xff', b'[' * 100_000)),
    *((content, f': {NO_RESULT}') for content in (
        b'{}', b'[]', b'{"schema": NaN}', b'{"schema": "imu_allan.fleet/2"}',
        b'{"schema": "imu_allan.result/x"}')),
    (b'{"schema": "imu_allan.result/2", "axes": 1}',
     ': written by a newer imu_allan (schema imu_allan.result/2, this one reads '
     'imu_allan.result/1); update imu_allan'),
    (b'{"schema": "imu_allan.result/1"}', ': missing imu_allan_version, source, timeline, axes'),
    (None, ': cannot be read (No such file or directory); give the path of a result file, '
     f'{MADE_BY}')])
def test_a_file_that_is_no_result_is_refused(tmp_path, content, complaint):
    path = tmp_path / 'r.json'
    if content is not None:
        path.write_bytes(content)
    with refused(f'{path}{complaint}'):
        load_result(path)


@pytest.mark.parametrize(('path', 'value', 'complaint'), [
    ('axes.gyro_x.unit', 'deg/s', CONTRADICTS), (f'{DENSITY}.value', None, CONTRADICTS),
    (f'{DENSITY}.observable', False, CONTRADICTS), (f'{DENSITY}.value', -1e-3, CONTRADICTS),
    (f'{DENSITY}.upper95', -1e-3, f'{DENSITY}.upper95: expected zero or above'),
    (f'{DENSITY}.value', '1', f'{DENSITY}.value: expected float, found str'),
    (f'{DENSITY}.value', 1e300, f'{DENSITY}.value: 1e+300 is not below 1e+60'),
    (f'{DENSITY}.value', float('nan'), f'{DENSITY}.value: nan is not below 1e+60'),
    ('axes.gyro_x.mean', float('-inf'), 'axes.gyro_x.mean: -inf is not below 1e+60'),
    ('axes.gyro_x.curve.adev', [1.0], CONTRADICTS), ('axes.gyro_x.curve.edf', [], CONTRADICTS),
    ('axes.gyro_x.curve.tau_s.0', -1.0, 'axes.gyro_x.curve.tau_s[0]: expected above zero'),
    ('axes.gyro_x.curve', dict.fromkeys(('tau_s', 'adev', 'edf', 'ci68', 'ci95', 'model_adev'),
                                        ()), CONTRADICTS),
    ('axes.gyro_x.power_law', {'exponent': 3.0, 'exponent_ci95': [2.9, 3.1], 'psd_1hz': 1e-9},
     CONTRADICTS),
    ('axes.wheel', {}, 'axes.wheel: missing quantity, unit, mean, band_limit_s, tones, '
     'coefficients, goodness_of_fit, curve'),
    ('source.kind', 'dream', "source.kind: 'dream' is not one of recording, topic, datasheet"),
    ('timeline.duration_s', -1.0, 'timeline.duration_s: expected zero or above')])
def test_a_result_that_contradicts_itself_is_refused(result, tmp_path, path, value, complaint):
    *parents, last = (int(key) if key.isdigit() else key for key in path.split('.'))
    place = document = with_words(result).to_dict()
    for key in parents:
        place = place[key]
    place[last] = value
    (tmp_path / 'r.json').write_text(json.dumps(document))
    with refused(f'{tmp_path / "r.json"}.{complaint}'):
        load_result(tmp_path / 'r.json')


def test_the_curve_table_reads_back_exactly(result):
    curve = result.axes['accel_y'].curve
    rows = [list(row.values()) for row in csv.DictReader(curves_csv(result).splitlines())
            if row.pop('axis') == 'accel_y' and row.pop('unit') == 'm/s^2']
    np.testing.assert_array_equal(np.array(rows, float), np.column_stack([
        curve.tau_s, curve.adev, curve.ci68, curve.ci95, curve.edf, curve.model_adev]))


@pytest.mark.parametrize('name', ['rec_0.mcap', 'rec_0.db3', 'metadata.yaml', 'rec.bag'])
def test_a_folder_with_a_recording_is_one_whatever_result_lies_beside_it(tmp_path, name):
    (tmp_path / 'result.json').write_text('{}')
    assert is_result(tmp_path)
    (tmp_path / name).write_bytes(b'')
    assert not is_result(tmp_path)


def test_where_a_result_gives_no_configuration_all_else_is_written(result, tmp_path):
    paths = save_folder(result, tmp_path, ('vins_fusion',), report=False, picture=False)
    rateless = replace(result, timeline=Timeline(None, 10, 1.0))
    with refused('the configuration for vins_fusion needs the sample rate, which this result does '
                 f'not have; give it with --rate HZ; the other files are in {tmp_path}',
                 IncompleteSave):
        save_folder(rateless, tmp_path, ('vins_fusion', 'px4'))
    assert load_result(paths[0]) == rateless
    assert paths[2].read_text() == export(result, 'vins_fusion')
    assert {path.name for path in tmp_path.iterdir()} == {
        'result.json', 'curve.csv', 'vins_fusion_imu.yaml', 'px4_imu.params', 'report.html',
        'allan_deviation.png'}


def test_what_is_missing_behind_a_file_that_cannot_be_written_is_named(result, tmp_path):
    (tmp_path / 'curve.csv').mkdir()
    with refused(f'{tmp_path}/curve.csv: cannot be written (is a directory); choose a folder that '
                 'exists on a disk with room and may be written to; not written either: '
                 'px4_imu.params, report.html, allan_deviation.png'):
        save_folder(result, tmp_path, ('px4',))
    assert load_result(tmp_path / 'result.json') == result


@pytest.mark.thorough
def test_every_file_in_a_folder_is_replaced_by_its_own_kind_alone(tmp_path, result):
    # One axis is drawn in a sixth of the time.
    result = replace(result, axes={'gyro_x': result.axes['gyro_x']}, warnings=())
    other = replace(result, source=replace(result.source, path='other'))
    for path in {*save_folder(result, tmp_path, ['kalibr']),
                 *write_files(tmp_path, result_files.report_files(result, PICTURES)
                              | result_files.comparison_files({'a': result, 'b': other},
                                                              PICTURES)),
                 *save_fleet(Fleet({'a': result, 'b': other}), tmp_path)}:
        before = path.read_bytes()
        path.write_text('of the user')
        with refused(f'{path}: exists and is no {kind_of(before[:1 << 14])}, so it is not '
                     'replaced; name another file, or remove this one'):
            write_files(tmp_path, {path.name: lambda data=before: data})
        assert path.read_text() == 'of the user'
        path.write_bytes(before)
        write_files(tmp_path, {path.name: lambda data=before: data})


def test_permissions_are_those_of_the_file_before_or_of_the_umask(tmp_path):
    path, old = tmp_path / 'new', os.umask(0o027)
    try:
        write_atomically(path, b'')
    finally:
        os.umask(old)
    assert path.stat().st_mode & 0o777 == 0o640
    path.chmod(0o600)
    write_atomically(path, b'again')
    assert path.stat().st_mode & 0o777 == 0o600
