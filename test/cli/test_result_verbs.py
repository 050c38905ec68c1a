# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The verbs that start from a result: export, check, report."""

import json
from pathlib import Path
import xml.etree.ElementTree as ElementTree

import imu_allan
from imu_allan.cli.main import main
from imu_allan.noise.terms import AXES
from imu_allan.writers.filters import CONSUMERS
from imu_allan.writers.result_file import save_result
import pytest
import yaml


@pytest.fixture(scope='module')
def result_file(recording, tmp_path_factory):
    path = tmp_path_factory.mktemp('result') / 'result.json'
    save_result(imu_allan.analyze(recording), path)
    return path


def test_export_prints_what_a_filter_reads(result_file, capsys):
    assert main(['export', str(result_file), '--for', 'kalibr']) == 0
    out, err = capsys.readouterr()
    document = yaml.safe_load(out)
    assert document['gyroscope_noise_density'] == pytest.approx(0.005 * 0.0174533, rel=0.05)
    assert document['update_rate'] == pytest.approx(100, rel=1e-6)
    assert err == ''


def test_export_writes_into_a_folder_or_a_file(result_file, tmp_path, capsys):
    assert main(['export', str(result_file), '--for', 'px4', '--output', str(tmp_path)]) == 0
    assert main(['export', str(result_file), '--for', 'px4', '--output',
                 str(tmp_path / 'mine.params')]) == 0
    assert capsys.readouterr().out.split() == [str(tmp_path / 'px4_imu.params'),
                                               str(tmp_path / 'mine.params')]
    assert (tmp_path / 'px4_imu.params').read_text() == (tmp_path / 'mine.params').read_text()


def test_export_takes_another_rate(result_file, capsys):
    assert main(['export', str(result_file), '--for', 'vins_fusion', '--rate', '25']) == 0
    assert '25 Hz' in capsys.readouterr().out


def test_every_consumer_is_a_choice_of_the_command(result_file, capsys):
    for consumer in CONSUMERS:
        assert main(['export', str(result_file), '--for', consumer]) == 0
        assert capsys.readouterr().out


def test_an_unknown_consumer_is_wrong_usage(result_file, capsys):
    with pytest.raises(SystemExit) as stop:
        main(['export', str(result_file), '--for', 'madgwick'])
    assert stop.value.code == 2
    assert 'robot_localization' in capsys.readouterr().err


@pytest.mark.parametrize('verb', [['export', '--for', 'kalibr'], ['report']])
def test_a_missing_result_is_one_line_and_status_1(verb, tmp_path, capsys):
    assert main([*verb[:1], str(tmp_path / 'no.json'), *verb[1:]]) == 1
    out, err = capsys.readouterr()
    assert out == ''
    assert err.count('\n') == 1
    assert 'no.json: cannot be read' in err


@pytest.mark.parametrize(('limit', 'status', 'word'), [
    ('0.006 deg/s/sqrt(Hz)', 0, 'pass'), ('0.2 deg/sqrt(h)', 3, 'fail')])
def test_check_tells_by_its_status_whether_the_datasheet_is_kept(
        result_file, tmp_path, capsys, limit, status, word):
    (tmp_path / 'spec.yaml').write_text(f'gyro: {{noise_density: {limit}}}')
    assert main(['check', str(result_file), '--spec', str(tmp_path / 'spec.yaml'),
                 '--json', str(tmp_path / 'c.json'), '--junit', str(tmp_path / 'c.xml')]) == status
    assert f'\n{word}: ' in capsys.readouterr().out
    assert json.loads((tmp_path / 'c.json').read_text())['verdict'] == word
    suite = ElementTree.parse(tmp_path / 'c.xml').find('testsuite')
    assert suite.get('failures') == ('3' if status else '0')


def test_check_takes_a_recording_as_well(recording, result_file, tmp_path, capsys):
    (tmp_path / 'spec.yaml').write_text('gyro: {noise_density: 0.2 deg/sqrt(h)}')
    verdicts = []
    for source in (recording, result_file):
        assert main(['check', str(source), '--spec', str(tmp_path / 'spec.yaml'),
                     '--json', str(tmp_path / 'c.json')]) == 3
        verdicts.append(json.loads((tmp_path / 'c.json').read_text())['checks'])
    assert verdicts[0] == verdicts[1]
    assert 'fail: ' in capsys.readouterr().out


def test_a_doubt_is_explained_and_is_no_failure(result_file, tmp_path, capsys):
    (tmp_path / 'spec.yaml').write_text('gyro: {x: {rate_random_walk: 1 deg/h/sqrt(h)}}')
    assert main(['check', str(result_file), '--spec', str(tmp_path / 'spec.yaml')]) == 0
    out = capsys.readouterr().out
    assert 'cannot tell: ' in out
    assert 'record for longer' in out


def test_a_spec_without_a_unit_is_one_line_and_status_1(result_file, tmp_path, capsys):
    (tmp_path / 'spec.yaml').write_text('gyro: {noise_density: 0.03}')
    assert main(['check', str(result_file), '--spec', str(tmp_path / 'spec.yaml')]) == 1
    err = capsys.readouterr().err
    assert err.count('\n') == 1
    assert "spec.yaml: gyro.noise_density: '0.03' has no unit" in err


def test_report_writes_page_and_plots_and_names_them(result_file, tmp_path, capsys):
    assert main(['report', str(result_file), '--output', str(tmp_path / 'out'),
                 '--format', 'png,svg']) == 0
    names = {Path(line).name for line in capsys.readouterr().out.split()}
    assert names == {'report.html', *(f'{sheet}.{kind}' for kind in ('png', 'svg')
                                      for sheet in ('allan_deviation', 'gyro', 'accel'))}
    assert {path.name for path in (tmp_path / 'out').iterdir()} == names


def test_report_of_two_results_compares_them(result_file, tmp_path, capsys):
    other = tmp_path / 'other.json'
    other.write_bytes(result_file.read_bytes())
    assert main(['report', str(result_file), str(other), '--output', str(tmp_path),
                 '--format', 'png']) == 0
    out = capsys.readouterr().out
    assert (tmp_path / 'comparison.html').exists()
    assert (tmp_path / 'comparison.png').exists()
    for axis in AXES:
        assert f'{axis}' in out
    assert '+0.00' in out


def test_an_unknown_format_is_wrong_usage(result_file, capsys):
    with pytest.raises(SystemExit) as stop:
        main(['report', str(result_file), '--format', 'bmp'])
    assert stop.value.code == 2
    assert 'png, svg, pdf' in capsys.readouterr().err


def test_analyze_leaves_result_curve_plot_and_report(recording, tmp_path, capsys):
    assert main(['analyze', str(recording), '--output', str(tmp_path / 'out')]) == 0
    assert {path.name for path in (tmp_path / 'out').iterdir()} == {
        'result.json', 'curve.csv', 'allan_deviation.png', 'report.html'}
    assert 'deg/sqrt(h)' in capsys.readouterr().out
