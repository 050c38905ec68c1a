# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace

from imu_allan.result import Timeline
from imu_allan.writers.filters import CONSUMERS, export, stale_files_note
from imu_allan.writers.folder import IncompleteSave, save_folder
from imu_allan.writers.result_file import load_result
from whole_lines import refused


def test_a_folder_holds_the_result_its_configurations_picture_and_report(result, tmp_path):
    folder = tmp_path / 'new' / 'folder'
    paths = save_folder(result, folder, ('vins_fusion', 'px4'))
    assert [path.name for path in paths] == [
        'result.json', 'curve.csv', 'vins_fusion_imu.yaml', 'px4_imu.params', 'report.html',
        'allan_deviation.png']
    assert all(path.stat().st_size for path in paths)
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
