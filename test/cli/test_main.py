# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0

from pathlib import Path
import resource
import signal
import subprocess
import sys
import time

from imu_allan.cli.main import main
import pytest

COMMAND = [sys.executable, '-m', 'imu_allan']
VERBS = ('analyze', 'info', 'simulate', 'check', 'export', 'report')


def run(*arguments: str, **options: object) -> 'subprocess.CompletedProcess[str]':
    return subprocess.run([*COMMAND, *arguments], check=False, capture_output=True, text=True,
                          timeout=60, **options)


def test_help_names_every_verb_and_costs_under_a_fifth_of_a_second() -> None:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    answer = run('--help')
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert answer.returncode == 0
    assert answer.stderr == ''
    assert all(f'    {verb} ' in answer.stdout for verb in VERBS)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    assert cpu < 0.2


@pytest.mark.parametrize('verb', VERBS)
def test_help_of_a_verb_explains_each_of_its_options(
        verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main([verb, '--help'])
    assert stop.value.code == 0
    assert f'imu_allan {verb}' in capsys.readouterr().out


@pytest.mark.parametrize('heavy', ['numpy', 'scipy', 'matplotlib', 'rich', 'rosbags', 'mcap',
                                   'pint', 'jinja2', 'yaml', 'rclpy', 'distributed'])
def test_building_the_parser_loads_nothing_heavy(heavy: str) -> None:
    code = ('import sys; from imu_allan.cli.main import command_parser; command_parser(); '
            f'sys.exit({heavy!r} in sys.modules)')
    assert subprocess.run([sys.executable, '-c', code], check=False).returncode == 0


def test_version_is_the_one_of_the_package(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(['--version'])
    assert stop.value.code == 0
    package = (Path(__file__).parents[2] / 'package.xml').read_text()
    assert f'<version>{capsys.readouterr().out.split()[1]}</version>' in package


@pytest.mark.parametrize('arguments', [
    [],
    ['characterize'],
    ['analyze'],
    ['analyze', 'bag', '--rate', '0'],
    ['analyze', 'bag', '--rate', 'fast'],
    ['analyze', 'bag', '--rate', 'nan'],
    ['analyze', 'bag', '--start', '-1'],
    ['analyze', 'bag', '--duration', '3 weeks'],
    ['analyze', 'bag', '--jobs', '0'],
    ['analyze', 'bag', '--clock', 'wall'],
    ['analyze', 'bag', '--force-rate'],
    ['analyze', 'bag', '--topic', '/imu', '--all-topics'],
    ['analyze', 'bag', '--jobs', '2', '--dask', 'tcp://localhost:8786'],
    ['analyze', 'one', 'two', '--json', 'result.json'],
    ['simulate', 'model', '--storage', 'csv'],
    ['simulate', 'model', '--seed', '1.5'],
    ['export', 'result.json', '--for', 'toaster'],
    ['check', 'result.json'],
])
def test_wrong_usage_exits_2_with_the_usage_on_stderr(
        arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 2
    shown = capsys.readouterr()
    assert shown.out == ''
    assert shown.err.startswith('usage: imu_allan')


@pytest.mark.parametrize('arguments', [
    ['analyze', 'no/such/bag'],
    ['info', 'no/such/bag'],
    ['simulate', 'no/such/model'],
    ['check', 'no/such/result', '--spec', 'no/such/spec'],
    ['export', 'no/such/result', '--for', 'kalibr'],
    ['report', 'no/such/result'],
])
def test_missing_file_is_one_line_that_names_it_and_exit_1(
        arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == 1
    shown = capsys.readouterr()
    assert shown.out == ''
    assert shown.err.startswith('imu_allan: no/such/')
    assert shown.err.count('\n') == 1


def test_names_that_would_steer_the_terminal_are_escaped_in_errors(
        capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['analyze', 'bag\x1b[2J\nimu_allan: all is well']) == 1
    assert capsys.readouterr().err.count('\n') == 1
    assert main(['analyze', '\udcff.mcap']) == 1
    assert '\x1b' not in capsys.readouterr().err


def test_a_reader_that_goes_away_ends_the_command_quietly(recording: Path) -> None:
    with subprocess.Popen([*COMMAND, 'info', str(recording)], stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == b''
    assert process.returncode == 141


def test_ctrl_c_exits_130_without_a_word_and_leaves_nothing_behind(tmp_path: Path) -> None:
    model = tmp_path / 'model.yaml'
    model.write_text('gyro: {noise_density: 0.005 deg/s/sqrt(Hz)}')
    output = tmp_path / 'simulated'
    with subprocess.Popen([*COMMAND, 'simulate', str(model), '--duration', '30d',
                           '--output', str(output)], stderr=subprocess.PIPE) as process:
        deadline = time.monotonic() + 30
        while not any(tmp_path.glob('.simulated*/*')) and time.monotonic() < deadline:
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        assert process.stderr is not None
        assert process.stderr.read() == b''
    assert process.returncode == 130
    assert [path.name for path in tmp_path.iterdir()] == ['model.yaml']


@pytest.mark.parametrize(('words', 'meant'), [
    (['analyse', 'bag'], 'did you mean analyze?'),
    (['analyze', 'bag', '--al-topics'], 'did you mean --all-topics?'),
    (['export', 'r.json', '--for', 'kalbr'], 'did you mean kalibr?'),
    (['analyze', 'bag', '--duration', '5x'],
     "'5x' is not a length of time: write seconds (90), or a number with ms, s, min, h or d "
     '(10min)'),
])
def test_a_misspelt_word_is_told_with_the_right_one(words, meant, capsys):
    with pytest.raises(SystemExit) as stop:
        main(words)
    assert stop.value.code == 2
    complaint = capsys.readouterr().err
    assert complaint.endswith(f'{meant}\n')
    assert words[0] == 'analyse' or complaint.startswith(f'usage: imu_allan {words[0]} ')
