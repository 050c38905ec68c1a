# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace

from imu_allan.result import Timeline
from imu_allan.writers.filters import CONSUMERS, export, left_from_earlier
from imu_allan.writers.folder import IncompleteSave, save_folder
from imu_allan.writers.result_file import load_result
import pytest


def test_a_folder_holds_the_result_its_configurations_picture_and_report(result, tmp_path):
    paths = save_folder(result, tmp_path / 'new' / 'folder', ('kalibr', 'px4'))
    assert [path.name for path in paths] == [
        'result.json', 'curve.csv', 'imu.yaml', 'px4_imu.params', 'report.html',
        'allan_deviation.png']
    assert all(path.stat().st_size for path in paths)
    assert load_result(paths[0]) == result
    assert paths[2].read_text() == export(result, 'kalibr').text


def test_the_configurations_of_all_consumers_go_into_one_folder(result, tmp_path):
    paths = save_folder(result, tmp_path, tuple(CONSUMERS))
    assert len(set(paths)) == len(paths) == len(CONSUMERS) + 4


def test_where_a_configuration_cannot_be_all_else_is_written(result, tmp_path):
    rateless = replace(result, timeline=Timeline(None, 10, 1.0))
    with pytest.raises(IncompleteSave) as caught:
        save_folder(rateless, tmp_path, ('vins_fusion', 'px4'))
    assert str(caught.value) == (
        'the configuration for vins_fusion needs the sample rate, which this result does not '
        f'have; give it with --rate HZ; the other files are in {tmp_path}')
    assert {path.name for path in tmp_path.iterdir()} == {
        'result.json', 'curve.csv', 'px4_imu.params', 'report.html', 'allan_deviation.png'}
    assert load_result(tmp_path / 'result.json') == rateless


def test_a_configuration_of_an_earlier_result_is_named_and_left_alone(result, tmp_path):
    save_folder(result, tmp_path, ('vins_fusion', 'px4'))
    old = (tmp_path / 'vins_fusion_imu.yaml').read_bytes()
    rateless = replace(result, timeline=Timeline(None, 10, 1.0))
    with pytest.raises(IncompleteSave) as caught:
        save_folder(rateless, tmp_path, ('vins_fusion', 'px4'))
    assert str(caught.value) == (
        'the configuration for vins_fusion needs the sample rate, which this result does not '
        f"have; give it with --rate HZ; {tmp_path / 'vins_fusion_imu.yaml'} stands there from "
        f'before and was not replaced; the other files are in {tmp_path}')
    assert (tmp_path / 'vins_fusion_imu.yaml').read_bytes() == old


def test_configurations_of_an_earlier_result_are_named_beside_a_new_one(result, tmp_path):
    save_folder(result, tmp_path, ('px4', 'basalt', 'kalibr'), report=False)
    (tmp_path / CONSUMERS['gazebo'].file).write_text('<imu>of somebody else</imu>')
    assert left_from_earlier(tmp_path, ('px4', 'basalt', 'kalibr')) == ''
    assert left_from_earlier(tmp_path, ('basalt',)) == (
        f'{tmp_path}: imu.yaml and px4_imu.params are of an earlier result and were not replaced; '
        '--for kalibr --for px4 writes them anew')
    assert left_from_earlier(tmp_path, ('px4', 'kalibr')) == (
        f'{tmp_path}: basalt_imu.json is of an earlier result and was not replaced; '
        '--for basalt writes it anew')


def test_every_configuration_says_whose_it_is(result, tmp_path):
    save_folder(result, tmp_path, tuple(CONSUMERS), report=False)
    said = left_from_earlier(tmp_path)
    assert all(consumer.file in said for consumer in CONSUMERS.values())


def test_a_node_writes_all_but_the_page(result, tmp_path):
    paths = save_folder(result, tmp_path, report=False)
    assert [path.name for path in paths] == ['result.json', 'curve.csv', 'allan_deviation.png']
    assert all(path.stat().st_size for path in paths)
