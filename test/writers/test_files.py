# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What is written to folders and files, read back, and replaced by its own kind alone."""

import csv
from dataclasses import replace
import json
import os
from pathlib import Path

from imu_allan.result import Result, Timeline
from imu_allan.sensor.noise_model import parse_model
from imu_allan.writers import atomic, folder as folders
from imu_allan.writers.atomic import kind_of, write_atomically, write_in
from imu_allan.writers.datasheet import certificate_html, check, to_json, to_junit
from imu_allan.writers.filters import CONSUMERS, export, stale_files_note
from imu_allan.writers.fleet import Fleet, save_fleet
from imu_allan.writers.folder import IncompleteSave, save_folder
from imu_allan.writers.result_file import is_result, load_result, save_result
from imu_allan.writers.tuning_table import tuning_document
from imu_allan.writers.words import with_words
import numpy as np
import pytest
from whole_lines import refused, unwritable

MADE_BY = 'written by: imu_allan analyze RECORDING --json FILE'
NO_RESULT = ('not an imu_allan result file (no "schema": "imu_allan.result/1"); write one with: '
             'imu_allan analyze RECORDING --json FILE')
DENSITY = 'axes.gyro_x.coefficients.noise_density'


def test_a_result_reads_back_as_it_was_written_without_nan_and_its_schema_first(result, tmp_path):
    save_result(result, tmp_path / 'r.json')
    assert load_result(tmp_path / 'r.json') == result

    document = json.loads((tmp_path / 'r.json').read_text(), parse_constant=pytest.fail)
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
    *parents, last = (int(key) if key.isdigit() else key for key in path.split('.'))
    place = document = with_words(result).to_dict()
    for key in parents:
        place = place[key]
    place[last] = value
    (tmp_path / 'r.json').write_text(json.dumps(document))
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


@pytest.mark.thorough
def test_a_folder_holds_the_result_its_configurations_picture_and_report(result, tmp_path):
    folder = tmp_path / 'new' / 'folder'
    paths = save_folder(result, folder, ('vins_fusion', 'px4'))
    assert [path.name for path in paths if path.stat().st_size] == [
        'result.json', 'curve.csv', 'vins_fusion_imu.yaml', 'px4_imu.params', 'report.html',
        'allan_deviation.png']
    assert load_result(paths[0]) == result
    old = export(result, 'vins_fusion').text
    assert paths[2].read_text() == old
    # Of a result that gives no configuration all else is written, and the old one is left alone.
    rateless = replace(result, timeline=Timeline(None, 10, 1.0))
    why = ('the configuration for vins_fusion needs the sample rate, which this result does not '
           'have; give it with --rate HZ')
    with refused(f'{why}; {paths[2]} stands there from before and was not replaced; the other '
                 f'files are in {folder}', IncompleteSave):
        save_folder(rateless, folder, ('vins_fusion', 'px4'))
    assert load_result(paths[0]) == rateless
    assert paths[2].read_text() == old
    with refused(f'{why}; the other files are in {tmp_path / "bare"}', IncompleteSave):
        save_folder(rateless, tmp_path / 'bare', ('vins_fusion', 'px4'))
    assert {path.name for path in (tmp_path / 'bare').iterdir()} == {
        'result.json', 'curve.csv', 'px4_imu.params', 'report.html', 'allan_deviation.png'}


def test_configurations_of_an_earlier_result_are_named_beside_a_new_one(result, tmp_path):
    save_folder(result, tmp_path, ('px4', 'basalt', 'kalibr'), report=False)
    (tmp_path / CONSUMERS['gazebo'].file).write_text('<imu>of somebody else</imu>')
    assert stale_files_note(tmp_path, ('px4', 'basalt', 'kalibr')) == ''
    assert stale_files_note(tmp_path, ('basalt',)) == (
        f'{tmp_path}: imu.yaml and px4_imu.params are of an earlier result and were not replaced; '
        '--for kalibr --for px4 writes them anew')
    assert stale_files_note(tmp_path, ('px4', 'kalibr')) == (
        f'{tmp_path}: basalt_imu.json is of an earlier result and was not replaced; '
        '--for basalt writes it anew')


def test_every_document_and_page_is_known_by_its_beginning(result: Result) -> None:
    specification = parse_model('gyro: {noise_density: 1 deg/s/sqrt(Hz)}')
    verdicts = check(result, specification)
    for kind, text in (
            (atomic.RESULT, result.to_json()),
            (atomic.VERDICTS, to_json(verdicts, result, specification)),
            (atomic.JUNIT, to_junit(verdicts, result, specification)),
            (atomic.CERTIFICATE, certificate_html(verdicts, result, specification)),
            (atomic.TUNING, json.dumps(tuning_document(result, 0.1, 60.0, 'random_walk'),
                                       indent=2))):
        assert kind_of(text.encode()) == kind


@pytest.mark.thorough
def test_every_file_in_a_folder_is_replaced_by_its_own_kind_alone(tmp_path: Path, result: Result
                                                                  ) -> None:
    # One axis is drawn in a sixth of the time.
    result = replace(result, axes={'gyro_x': result.axes['gyro_x']}, warnings=())
    other = replace(result, source=replace(result.source, path='other'))
    for path in {*save_folder(result, tmp_path, ['kalibr']),
                 *folders.save_report(result, tmp_path), *folders.save_latex(result, tmp_path),
                 *folders.save_comparison({'a': result, 'b': other}, tmp_path),
                 *save_fleet(Fleet({'a': result, 'b': other}), tmp_path)}:
        before = path.read_bytes()
        path.write_text('of the user')
        with refused(f'{path}: exists and is no {kind_of(before[:1 << 14])}, so it is not '
                     'replaced; name another file, or remove this one'):
            write_in(tmp_path, path.name, before)
        assert path.read_text() == 'of the user'
        path.write_bytes(before)
        write_in(tmp_path, path.name, before)


def test_a_failure_leaves_the_old_content_and_no_debris(tmp_path, monkeypatch):
    write_atomically(tmp_path / 'file', b'old')

    def full_disk(_handle):
        raise OSError(28, 'No space left on device')

    monkeypatch.setattr(os, 'fsync', full_disk)
    with refused(unwritable(tmp_path / 'file', 'No space left on device')):
        write_atomically(tmp_path / 'file', b'new')
    assert [path.name for path in tmp_path.iterdir()] == ['file']
    assert (tmp_path / 'file').read_bytes() == b'old'


def test_permissions_are_those_of_the_file_before_or_of_the_umask(tmp_path):
    old = os.umask(0o027)
    try:
        write_atomically(tmp_path / 'new', b'')
    finally:
        os.umask(old)
    modes = [(tmp_path / 'new').stat().st_mode & 0o777]
    (tmp_path / 'new').chmod(0o600)
    write_atomically(tmp_path / 'new', b'again')
    assert [*modes, (tmp_path / 'new').stat().st_mode & 0o777] == [0o640, 0o600]
