# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The verbs that start from a result: export, check, report."""

from dataclasses import replace
import functools
from html import escape
import json
from pathlib import Path
import re
import xml.etree.ElementTree as ElementTree

import imu_allan
from imu_allan.characterization import stream
from imu_allan.cli.main import main
from imu_allan.noise.terms import AXES
from imu_allan.sensor.units import typeset
from imu_allan.writers.datasheet import live
from imu_allan.writers.filters import CONSUMERS
from imu_allan.writers.result_file import save_result
import pytest
from whole_lines import Varying
import yaml


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


def test_export_names_the_older_file_that_it_does_not_replace(result_file, tmp_path, capsys):
    dead = imu_allan.load_result(result_file)
    dead = replace(dead, axes={name: replace(axis, drift_model=None, coefficients={
        key: replace(one, observable=False, value=None, ci95=None)
        for key, one in axis.coefficients.items()}) for name, axis in dead.axes.items()})
    save_result(dead, tmp_path / 'dead.json')
    reason = ('no configuration for kalibr: no axis of this result has a noise density (constant '
              'or too short); look at the driver, or record longer')
    for where, path in ((tmp_path, tmp_path / 'imu.yaml'),
                        (tmp_path / 'mine.yaml', tmp_path / 'mine.yaml')):
        export = ['--for', 'kalibr', '--output', str(where)]
        assert main(['export', str(tmp_path / 'dead.json'), *export]) == 1
        assert capsys.readouterr().err == f'imu_allan: {reason}\n'
        assert main(['export', str(result_file), *export]) == 0
        old = path.read_bytes()
        capsys.readouterr()
        assert main(['export', str(tmp_path / 'dead.json'), *export]) == 1
        assert capsys.readouterr().err == (
            f'imu_allan: {reason}; {path} stands there from before and was not replaced\n')
        assert path.read_bytes() == old


def test_export_says_no_more_of_the_older_file_than_is_known(result_file, tmp_path, capsys):
    result = imu_allan.load_result(result_file)
    save_result(replace(result, timeline=replace(result.timeline, sample_rate_hz=None)),
                tmp_path / 'rateless.json')
    path = tmp_path / 'vins_fusion_imu.yaml'
    export = ['export', str(tmp_path / 'rateless.json'), '--for', 'vins_fusion', '--output',
              str(tmp_path)]
    assert main([*export, '--rate', '100']) == 0
    capsys.readouterr()
    assert main(export) == 1
    assert capsys.readouterr().err == (
        'imu_allan: the configuration for vins_fusion needs the sample rate, which this result '
        f'does not have; give it with --rate HZ; {path} stands there from before and was not '
        'replaced\n')


@pytest.mark.parametrize(('wishes', 'message'), [
    (['kalibr', '--coast', '0.01'], '--coast 0.01 s is shorter than --aiding 0.05 s: a filter '
                                    'is unaided for at least one interval'),
    (['kalibr', '--aiding', '1min', '--coast', '1s'],
     '--coast 1 s is shorter than --aiding 60 s: a filter is unaided for at least one interval'),
    (['vins_fusion', '--rate', '1e31'], '--rate must be between 1e-30 and 1e+30, not 1e+31'),
    (['state_space', '--aiding', '1ms'],
     'gyro_x: --aiding 0.001 s is below 0.1 s, the band edge: this recording does not know how '
     'the sensor drifts faster; choose a longer step')])
def test_what_export_refuses_has_the_name_that_was_typed(wishes, message, result_file, capsys):
    assert main(['export', str(result_file), '--for', *wishes]) == 1
    assert capsys.readouterr().err == f'imu_allan: {message}\n'


def test_export_takes_another_rate(result_file, capsys):
    assert main(['export', str(result_file), '--for', 'vins_fusion', '--rate', '25']) == 0
    assert ('# Per sample at f = 25 Hz: N sqrt(f) and K sqrt(f).'
            in capsys.readouterr().out.splitlines())


def test_every_consumer_is_a_choice_of_the_command(result_file, capsys):
    for consumer in CONSUMERS:
        assert main(['export', str(result_file), '--for', consumer]) == 0
        assert capsys.readouterr().out


def test_an_unknown_consumer_is_wrong_usage(result_file, capsys):
    with pytest.raises(SystemExit) as stop:
        main(['export', str(result_file), '--for', 'madgwick'])
    assert stop.value.code == 2
    assert capsys.readouterr().err.splitlines()[-1] == (
        "imu_allan export: error: argument --for: no consumer is called 'madgwick'; imu_allan "
        'export --list names all')


def test_a_datasheet_in_place_of_a_result_is_marked_so(tmp_path, capsys):
    (tmp_path / 'sheet.yaml').write_text(
        'gyro: {noise_density: 0.03 deg/s/sqrt(Hz), rate_random_walk: 3e-6 rad/s^2/sqrt(Hz)}\n'
        'accel: {noise_density: 100 ug/sqrt(Hz)}\n')
    for name in CONSUMERS:
        status = main(['export', '--spec', str(tmp_path / 'sheet.yaml'), '--for', name,
                       '--rate', '200Hz'])
        out, err = capsys.readouterr()
        if name.startswith('state_space'):
            # A drift model is not in a datasheet.
            assert (status, out) == (1, '')
            continue
        assert (status, err) == (0, '')
        assert f'the DATASHEET {tmp_path}/sheet.yaml: nothing of it was measured' in out
    assert main(['export', '--spec', str(tmp_path / 'sheet.yaml'), '--for', 'Kalibr', '--rate',
                 '200']) == 0
    document = yaml.safe_load(capsys.readouterr().out)
    assert document['gyroscope_noise_density'] == pytest.approx(0.03 * 0.0174533, rel=1e-5)
    assert document['gyroscope_random_walk'] == 3e-6
    assert 'accelerometer_random_walk' not in document or document[
        'accelerometer_random_walk'] is None


@pytest.mark.parametrize('verb', [['export', '--for', 'kalibr'], ['report']])
def test_a_missing_result_is_one_line_and_status_1(verb, tmp_path, capsys):
    assert main([*verb[:1], str(tmp_path / 'no.json'), *verb[1:]]) == 1
    assert capsys.readouterr() == (
        '', f'imu_allan: {tmp_path}/no.json: cannot be read (No such file or directory); give the '
        'path of a result file, written by: imu_allan analyze RECORDING --json FILE\n')


@pytest.mark.parametrize(('limit', 'status', 'word'), [
    ('0.006 deg/s/sqrt(Hz)', 0, 'pass'), ('0.2 deg/sqrt(h)', 3, 'fail')])
def test_check_tells_by_its_status_whether_the_datasheet_is_kept(
        result_file, tmp_path, capsys, limit, status, word):
    (tmp_path / 'spec.yaml').write_text(f'gyro: {{noise_density: {limit}}}')
    assert main(['check', str(result_file), '--spec', str(tmp_path / 'spec.yaml'),
                 '--json', str(tmp_path / 'c.json'), '--junit', str(tmp_path / 'c.xml')]) == status
    assert (f'{word}: {result_file} against {tmp_path}/spec.yaml'
            in capsys.readouterr().out.splitlines())
    assert json.loads((tmp_path / 'c.json').read_text())['verdict'] == word
    suite = ElementTree.parse(tmp_path / 'c.xml').find('testsuite')
    assert suite.get('failures') == ('3' if status else '0')


def test_check_takes_a_recording_as_well(imu_recording, result_file, tmp_path, capsys):
    (tmp_path / 'spec.yaml').write_text('gyro: {noise_density: 0.2 deg/sqrt(h)}')
    verdicts = []
    for source in (imu_recording, result_file):
        assert main(['check', str(source), '--spec', str(tmp_path / 'spec.yaml'),
                     '--json', str(tmp_path / 'c.json')]) == 3
        verdicts.append(json.loads((tmp_path / 'c.json').read_text())['checks'])
    assert verdicts[0] == verdicts[1]
    shown = capsys.readouterr().out.splitlines()
    for source in (imu_recording, result_file):
        assert f'fail: {source} against {tmp_path}/spec.yaml' in shown


def test_check_goes_through_a_folder_of_recordings(recording, tmp_path, capsys):
    units = tmp_path / 'units'
    units.mkdir()
    for name in ('unit_2', 'unit_10'):
        (units / name).symlink_to(recording)
    specification = tmp_path / 'spec.yaml'
    command = ['check', str(units), '--spec', str(specification)]
    specification.write_text('gyro: {noise_density: 0.5 deg/sqrt(h)}')
    assert main(command) == 0
    out, err = capsys.readouterr()
    said = [line for line in out.splitlines() if line.startswith('pass: ')]
    assert [line.split(' against ')[0] for line in said] == [
        f'pass: {units / name}' for name in ('unit_2', 'unit_10')]
    assert err == ''
    (units / 'unit_3.bag').write_bytes(b'#ROSBAG V2.0')
    assert main(command) == 1
    broken = f'imu_allan: {units}/unit_3.bag: cut short within its first line; copy it again\n'
    assert capsys.readouterr().err == broken
    specification.write_text('gyro: {noise_density: 0.2 deg/sqrt(h)}')
    assert main(command) == 3
    out, err = capsys.readouterr()
    assert out.count('fail: ') == 2
    assert err == broken
    with pytest.raises(SystemExit) as stop:
        main([*command, '--json', str(tmp_path / 'c.json')])
    assert stop.value.code == 2


def test_a_doubt_is_explained_and_is_no_failure(result_file, tmp_path, capsys):
    (tmp_path / 'spec.yaml').write_text('gyro: {x: {rate_random_walk: 1 deg/h/sqrt(h)}}')
    arguments = ['check', str(result_file), '--spec', str(tmp_path / 'spec.yaml')]
    assert main(arguments) == 4
    assert capsys.readouterr().out.splitlines()[-2:] == [
        f'cannot tell: {result_file} against {tmp_path}/spec.yaml',
        '  (1) gyro_x K: not observable in this recording; record for longer']
    assert main([*arguments, '--allow-undecided']) == 0


def test_every_row_without_a_pass_has_its_reason_wherever_it_stands(
        result_file, tmp_path, capsys):
    (tmp_path / 'spec.yaml').write_text(
        'gyro: {x: {noise_density: 1e-9 deg/s/sqrt(Hz)}}\naccel: {bias_instability: 1e-6 ug}')
    files = {name: tmp_path / f'c.{name}' for name in ('json', 'html')}
    assert main(['check', str(result_file), '--spec', str(tmp_path / 'spec.yaml'),
                 '--json', str(files['json']), '--certificate', str(files['html'])]) == 3
    out = capsys.readouterr().out
    checks = json.loads(files['json'].read_text())['checks']
    assert [(one['axis'], one['verdict']) for one in checks] == [
        ('gyro_x', 'fail'), *((f'accel_{axis}', 'cannot tell') for axis in 'xyz')]
    page = files['html'].read_text()
    for one in checks:
        reason = one['reason'].partition(': ')[2]
        assert any(reason in line for line in out.splitlines() if line.startswith('  ('))
        assert escape(typeset(reason)) in page
    assert 'cannot tell (2)' in out
    assert '<sup>2</sup>' in page


def test_a_doubt_has_a_status_of_its_own(result_file, tmp_path, capsys):
    (tmp_path / 'spec.yaml').write_text('gyro: {x: {rate_random_walk: 9000 deg/h/sqrt(h)}}')
    assert main(['check', str(result_file), '--spec', str(tmp_path / 'spec.yaml'),
                 '--strict']) == 0
    capsys.readouterr()
    assert main(['check', str(result_file), '--spec', str(tmp_path / 'spec.yaml'),
                 '--strict', '--min-duration', '1h']) == 4
    assert capsys.readouterr().out.splitlines()[-1] == \
        '  (1) gyro_x K: 5 min of data, and no less than 60 min may pass'


def test_a_constant_sensor_fails_its_check(tmp_path, capsys):
    rows = '\n'.join(f'{i / 100},0.5,0.25,{(i * i) % 7}' for i in range(1000))
    (tmp_path / 'dead.csv').write_text(f'time_s,gyro_x,gyro_y,gyro_z\n{rows}\n')
    (tmp_path / 'spec.yaml').write_text('gyro: {x: {noise_density: 9 deg/sqrt(h)}}')
    assert main(['check', str(tmp_path / 'dead.csv'), '--spec', str(tmp_path / 'spec.yaml')]) == 3
    assert capsys.readouterr().out.splitlines()[-1] == \
        '  (1) gyro_x N: the axis is constant: every sample is 0.5 rad/s'


def test_unit_operator_and_station_go_into_every_paper(result_file, tmp_path, capsys):
    (tmp_path / 'spec.yaml').write_text('gyro: {noise_density: 0.5 deg/sqrt(h)}')
    assert main(['check', str(result_file), '--spec', str(tmp_path / 'spec.yaml'),
                 '--serial', 'A-17', '--operator', 'mk', '--station', 'bench 3',
                 '--json', str(tmp_path / 'c.json'), '--junit', str(tmp_path / 'c.xml'),
                 '--certificate', str(tmp_path / 'c.html')]) == 0
    capsys.readouterr()
    said = {'serial': 'A-17', 'operator': 'mk', 'station': 'bench 3'}
    assert json.loads((tmp_path / 'c.json').read_text())['inspection'] == said
    properties = ElementTree.parse(tmp_path / 'c.xml').find('testsuite').find('properties')
    assert {p.get('name'): p.get('value') for p in properties} == said
    page = (tmp_path / 'c.html').read_text()
    assert all(f'<dd>{word}</dd>' in page for word in said.values())


@pytest.mark.parametrize(('limit', 'status', 'word', 'last'), [
    ('0.01 deg/s/sqrt(Hz)', 0, 'pass', 'pass: {} against {}'),
    ('0.004 deg/s/sqrt(Hz)', 3, 'fail',
     '  (3) gyro_z N: above 0.004 deg/s/sqrt(Hz), certain after <number> s (measured <number>, '
     '<number> .. <number>)'),
    ('0.005 deg/s/sqrt(Hz)', 4, 'cannot tell',
     '  (3) gyro_z N: within 10 % of 0.005 deg/s/sqrt(Hz) after <number> s (measured <number>, '
     '<number> .. <number>)')])
def test_a_live_check_ends_as_soon_as_the_verdict_is_certain(
        recording, tmp_path, capsys, monkeypatch, limit, status, word, last):
    # Fewer looks.
    monkeypatch.setattr(live, 'GROWTH', 1.5)
    (tmp_path / 'spec.yaml').write_text(f'gyro: {{noise_density: {limit}}}')
    assert main(['check', str(recording), '--spec', str(tmp_path / 'spec.yaml'), '--live',
                 '--json', str(tmp_path / 'c.json')]) == status
    said = capsys.readouterr().out
    seconds = float(re.match(r'certain after ([\d.]+) s', said)[1])
    # Of the five minutes of the recording.
    assert seconds < 60
    document = json.loads((tmp_path / 'c.json').read_text())
    assert document['verdict'] == word
    expected = Varying(last.format(recording, tmp_path / 'spec.yaml'))
    assert any(line == expected for line in said.splitlines()), said


def test_check_takes_the_part_and_the_clock_that_analyze_takes(recording, tmp_path, capsys):
    (tmp_path / 'spec.yaml').write_text('gyro: {noise_density: 0.01 deg/s/sqrt(Hz)}')
    command = ['check', str(recording), '--spec', str(tmp_path / 'spec.yaml'),
               '--min-duration', '40s', '--json', str(tmp_path / 'c.json')]
    for options, word in (
            (['--start', '250s', '--motion', 'keep', '--clock', 'receive'], 'pass'),
            (['--start', '270s'], 'cannot tell'), (['--duration', '30s'], 'cannot tell'),
            (['--duration', '12s', '--live'], 'cannot tell')):
        assert main([*command, *options]) == (0 if word == 'pass' else 4)
        assert json.loads((tmp_path / 'c.json').read_text())['verdict'] == word
    assert 'not certain after 12 s' in capsys.readouterr().out.splitlines()
    for options, reason in (
            (['--force-rate'], '--force-rate needs --rate'),
            (['--start', 'auto', '--live'],
             '--start auto looks at the whole recording; with --live name a time')):
        with pytest.raises(SystemExit) as stop:
            main([*command, *options])
        assert stop.value.code == 2
        assert capsys.readouterr().err.splitlines()[-1] == f'imu_allan check: error: {reason}'


def test_a_live_check_of_a_constant_sensor_fails_at_once(tmp_path, capsys):
    rows = '\n'.join(f'{i / 100},0.5' for i in range(5000))
    (tmp_path / 'dead.csv').write_text(f'time_s,gyro_x\n{rows}\n')
    (tmp_path / 'spec.yaml').write_text('gyro: {x: {noise_density: 9 deg/sqrt(h)}}')
    assert main(['check', str(tmp_path / 'dead.csv'), '--spec', str(tmp_path / 'spec.yaml'),
                 '--live']) == 3
    assert capsys.readouterr().out.splitlines()[-1] == \
        '  (1) gyro_x N: the axis is constant: every sample is 0.5 rad/s'


def test_a_live_check_fits_once_a_look(recording, tmp_path, monkeypatch):
    (tmp_path / 'spec.yaml').write_text('gyro: {noise_density: 0.01 deg/s/sqrt(Hz)}')
    fits, looks = [], []
    for module, called, calls in ((stream, 'fit_axes', fits), (live, 'fit_axes', fits),
                                  (live, 'check', looks)):
        monkeypatch.setattr(module, called, functools.partial(
            lambda calls, real, *args, **options: calls.append(1) or real(*args, **options),
            calls, getattr(module, called)))
    assert main(['check', str(recording), '--spec', str(tmp_path / 'spec.yaml'), '--live']) == 0
    assert len(fits) == len(looks) > 0


def test_a_live_check_of_a_result_is_one_line(result_file, tmp_path, capsys):
    (tmp_path / 'spec.yaml').write_text('gyro: {noise_density: 9 deg/sqrt(h)}')
    assert main(['check', str(result_file), '--spec', str(tmp_path / 'spec.yaml'), '--live']) == 1
    assert capsys.readouterr().err == \
        f'imu_allan: {result_file}: --live needs a recording, not a result\n'


def test_a_spec_without_a_unit_is_one_line_and_status_1(result_file, tmp_path, capsys):
    (tmp_path / 'spec.yaml').write_text('gyro: {noise_density: 0.03}')
    assert main(['check', str(result_file), '--spec', str(tmp_path / 'spec.yaml')]) == 1
    assert capsys.readouterr().err == (
        f"imu_allan: {tmp_path}/spec.yaml: gyro.noise_density: '0.03' has no unit; write a number "
        "with its unit, such as '1 deg/sqrt(h)' or '1 rad/s/sqrt(Hz)'\n")


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


def test_more_results_than_colours_are_compared_as_a_population(result_file, tmp_path, capsys):
    paths = []
    for number in range(1, 9):
        paths.append(tmp_path / f'unit{number}.json')
        paths[-1].write_bytes(result_file.read_bytes())
    assert main(['report', *map(str, paths), '--output', str(tmp_path), '--format', 'png']) == 0
    out = capsys.readouterr().out
    assert '8 units' in out
    assert '8 of 8' in out
    page = (tmp_path / 'comparison.html').read_text()
    assert '8 results compared' in page
    assert 'unit8' in page
    assert (tmp_path / 'comparison.png').exists()


def test_an_unknown_format_is_wrong_usage(result_file, capsys):
    with pytest.raises(SystemExit) as stop:
        main(['report', str(result_file), '--format', 'bmp'])
    assert stop.value.code == 2
    assert capsys.readouterr().err.splitlines()[-1] == (
        "imu_allan report: error: argument --format: 'bmp' is not one of png, svg, pdf, latex")


@pytest.fixture
def folder(result_file, tmp_path):
    """Make what analyze --output leaves, as far as it matters."""
    (tmp_path / 'out').mkdir()
    (tmp_path / 'out' / 'result.json').write_bytes(result_file.read_bytes())
    return tmp_path / 'out'


@pytest.mark.parametrize('verb', [['export', '--for', 'kalibr'], ['tune'], ['report']])
def test_a_folder_of_a_result_is_taken_for_the_result(verb, folder, tmp_path, capsys):
    more = ['--output', str(tmp_path / 'pages'), '--format', 'png'] if verb == ['report'] else []
    assert main([*verb, str(folder), *more]) == 0
    (tmp_path / 'several' / 'one').mkdir(parents=True)
    (folder / 'result.json').rename(tmp_path / 'several' / 'one' / 'result.json')
    several = tmp_path / 'several'
    for given, told in (
            (folder, 'a folder without result.json; of a recording make one with: imu_allan '
                     f'analyze {folder} --output DIR'),
            (several, f'holds several results; name one of {several}/one')):
        capsys.readouterr()
        assert main([*verb, str(given)]) == 1
        assert capsys.readouterr().err == f'imu_allan: {given}: {told}\n'


@pytest.mark.parametrize('verb', ['analyze', 'info'])
def test_a_result_is_no_recording_and_what_to_do_with_it_is_told(verb, folder, capsys):
    for given in (folder, folder / 'result.json'):
        assert main([verb, str(given)]) == 1
        assert capsys.readouterr().err == (
            f'imu_allan: {given}: a result of imu_allan analyze, not a recording; go on with '
            f'imu_allan report, tune, export or check {folder / "result.json"}\n')


def test_a_specification_may_be_one_that_is_shipped(result_file, capsys):
    assert main(['check', str(result_file), '--spec', 'consumer_mems']) in (0, 3)
    assert 'gyro_x' in capsys.readouterr().out


def test_a_printed_result_is_the_table(imu_recording, result_file):
    lines = str(imu_allan.load_result(result_file)).splitlines()
    assert lines[0].startswith('Gyroscope: N is good')
    assert f'{imu_recording} /imu/data_raw frame imu_link' in ' '.join(' '.join(lines).split())
    assert max(map(len, lines)) <= 80
