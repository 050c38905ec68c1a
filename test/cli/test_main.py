# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0

import os
from pathlib import Path
import re
import resource
import signal
import subprocess
import sys
import time

from imu_allan.cli.main import command_parser, main
from imu_allan.cli.recording_options import recording_options
from imu_allan.recordings import RecordingOptions
from imu_allan.writers.consumers import FAMILIES
import pytest
from whole_lines import Varying
import zstandard

COMMAND = [sys.executable, '-m', 'imu_allan']
NO_MODEL = ('no such file, and no model of that name is shipped; give the path of a noise model '
            'YAML file')
NO_RESULT = ('cannot be read (No such file or directory); give the path of a result file, written '
             'by: imu_allan analyze RECORDING --json FILE')
NO_TIME = ('is not a length of time: write seconds (90), or a number with ms, s, m or min, h or d '
           '(10min)')
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


def test_building_the_parser_loads_nothing_heavy() -> None:
    heavy = {'numpy', 'scipy', 'matplotlib', 'rich', 'rosbags', 'mcap', 'pint', 'jinja2', 'yaml',
             'rclpy', 'distributed'}
    code = ('import sys; from imu_allan.cli.main import command_parser; command_parser(); '
            f'print({heavy!r} & set(sys.modules))')
    shown = subprocess.run([sys.executable, '-c', code], check=True, capture_output=True)
    assert shown.stdout == b'set()\n'


def test_version_is_the_one_of_the_package(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(['--version'])
    assert stop.value.code == 0
    package = (Path(__file__).parents[2] / 'package.xml').read_text()
    assert f'<version>{capsys.readouterr().out.split()[1]}</version>' in package


@pytest.mark.parametrize(('arguments', 'line'), [
    ([], ': error: the following arguments are required: VERB'),
    (['characterize'],
     ": error: argument VERB: invalid choice: 'characterize' (choose from <words>)"),
    (['analyze'], ' analyze: error: the following arguments are required: RECORDING'),
    (['analyze', 'bag', '--rate', '0'], ' analyze: error: argument --rate: 0 is not above zero'),
    (['analyze', 'bag', '--rate', 'fast'],
     " analyze: error: argument --rate: 'fast' is no rate: write Hz (100), or a number with Hz or "
     'kHz (2kHz)'),
    (['analyze', 'bag', '--rate', 'nan'],
     " analyze: error: argument --rate: 'nan' is no rate: write Hz (100), or a number with Hz or "
     'kHz (2kHz)'),
    (['analyze', 'bag', '--clock', 'none'], ' analyze: error: --clock none needs --rate'),
    (['check', 'bag', '--spec', 'x', '--meta', 'colour=red'],
     " check: error: argument --meta: 'colour=red' is not of the form KEY=VALUE with a KEY of "
     'serial, operator, station'),
    (['export', '--for', 'kalibr'],
     ' export: error: takes a RESULT, or a datasheet by --spec FILE'),
    (['analyze', 'bag', '--start', '-1'], ' analyze: error: argument --start: -1 is below zero'),
    (['analyze', 'bag', '--duration', '3 weeks'],
     f" analyze: error: argument --duration: '3 weeks' {NO_TIME}"),
    (['analyze', 'bag', '--jobs', '0'], ' analyze: error: argument --jobs: 0 is below one'),
    (['analyze', 'bag', '--clock', 'wall'],
     " analyze: error: argument --clock: invalid choice: 'wall' (choose from <words>)"),
    (['analyze', 'bag', '--force-rate'], ' analyze: error: --force-rate needs --rate'),
    (['analyze', 'bag', '--topic', '/imu', '--all-topics'],
     ' analyze: error: argument --all-topics: not allowed with argument --topic'),
    (['analyze', 'bag', '--jobs', '2', '--dask', 'tcp://localhost:8786'],
     ' analyze: error: argument --dask: not allowed with argument --jobs'),
    (['analyze', 'one', 'two', '--json', 'result.json'],
     ' analyze: error: --json takes one recording; use --output DIR for several'),
    (['simulate', 'model', '--storage', 'csv'],
     " simulate: error: argument --storage: invalid choice: 'csv' (choose from <words>)"),
    (['simulate', 'model', '--seed', '1.5'],
     " simulate: error: argument --seed: '1.5' is not a whole number"),
    (['export', 'result.json', '--for', 'toaster'],
     " export: error: argument --for: no consumer is called 'toaster'; imu_allan export --list "
     'names all'),
    (['check', 'result.json'], ' check: error: the following arguments are required: --spec'),
])
def test_wrong_usage_exits_2_with_the_usage_on_stderr(
        arguments: list[str], line: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 2
    shown = capsys.readouterr()
    assert shown.out == ''
    assert shown.err.startswith('usage: imu_allan')
    assert shown.err.splitlines()[-1] == Varying(f'imu_allan{line}')


@pytest.mark.parametrize(('arguments', 'line'), [
    (['analyze', 'no/such/bag'], 'no such file or directory'),
    (['info', 'no/such/bag'], 'no such file or directory'),
    (['simulate', 'no/such/model'], NO_MODEL),
    (['check', 'result', '--spec', 'no/such/spec'], NO_MODEL),
    (['export', 'no/such/result', '--for', 'kalibr'], NO_RESULT),
    (['report', 'no/such/result'], NO_RESULT),
])
def test_missing_file_is_one_line_that_names_it_and_exit_1(
        arguments: list[str], line: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == 1
    shown = capsys.readouterr()
    assert shown.out == ''
    [missing] = [word for word in arguments if word.startswith('no/such/')]
    assert shown.err == f'imu_allan: {missing}: {line}\n'


SHORT = ('--topic', '--all-topics', '--output', '--together', '--for', '--rate', '--start',
         '--duration', '--columns', '--jobs', '--units', '--verbose')


def test_help_shows_what_most_need_and_help_all_the_rest(
        capsys: pytest.CaptureFixture[str]) -> None:
    shown = {}
    for word in ('--help', '--help-all'):
        with pytest.raises(SystemExit) as stop:
            main(['analyze', word])
        assert stop.value.code == 0
        shown[word] = capsys.readouterr().out
    options = {word: re.findall(r'^  (?:-h, )?(--[\w-]+)', text, re.MULTILINE)
               for word, text in shown.items()}
    assert sorted(options['--help']) == sorted([*SHORT, '--help', '--help-all'])
    assert set(options['--help-all']) > {*options['--help'], '--resume', '--meta', '--gyro'}
    # What other options say now is taken all the same.
    assert not set(options['--help-all']) & {'--serial', '--gyro-unit', '--force-rate'}
    for text in shown.values():
        assert len(re.findall('^  imu_allan analyze ', text, re.MULTILINE)) == 3


def test_wrong_usage_is_told_in_two_lines(capsys: pytest.CaptureFixture[str]) -> None:
    for words in (['analyze', 'bag', '--rate', '0'], ['check', 'x'],
                  ['export', 'r', '--for', '?']):
        with pytest.raises(SystemExit):
            main(words)
        usage, error = capsys.readouterr().err.splitlines()
        assert usage.startswith(f'usage: imu_allan {words[0]} ')
        assert error.startswith(f'imu_allan {words[0]}: error: ')


def test_the_consumers_are_listed_by_family(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(['export', '--list'])
    assert stop.value.code == 0
    families = capsys.readouterr().out.split('\n\n')
    assert [family.partition(':')[0] for family in families] == list(FAMILIES)
    assert [line.split()[0] for family in families for line in family.splitlines()[1:]] == [
        name for names in FAMILIES.values() for name in names]


@pytest.mark.parametrize(('words', 'key', 'expected'), [
    (['--rate', '100'], 'rate', 100.0), (['--rate', '100Hz'], 'rate', 100.0),
    (['--rate', '2kHz'], 'rate', 2000.0), (['--rate', '0.5 khz'], 'rate', 500.0),
    (['--duration', '5m'], 'duration', 300.0), (['--duration', '5min'], 'duration', 300.0),
    (['--start', '90s'], 'start', 90.0), (['--accel-rate', '200Hz'], 'accel_rate', 200.0),
    (['--for', 'VINS'], 'consumers', ['vins_fusion']),
    (['--meta', 'serial=A=7', '--meta', 'station= 3 '], 'meta',
     [('serial', 'A=7'), ('station', '3')])])
def test_times_rates_and_names_are_read_as_people_write_them(
        words: list[str], key: str, expected: object) -> None:
    assert getattr(command_parser().parse_args(['analyze', 'bag', *words]), key) == expected


@pytest.mark.parametrize(('words', 'said'), [
    (['--gyro', 'imu.gyro[0:3]:deg/s'], {'gyro': 'imu.gyro[0:3] deg/s'}),
    (['--gyro', 'imu.gyro[0:3] deg/s'], {'gyro': 'imu.gyro[0:3] deg/s'}),
    (['--gyro', 'imu.gyro[0:3]'], {'gyro': 'imu.gyro[0:3]'}),
    (['--gyro', ':deg/s'], {'gyro_unit': 'deg/s'}),
    (['--gyro-unit', 'deg/s'], {'gyro_unit': 'deg/s'}),
    (['--accel', 'imu.acc:g'], {'accel': 'imu.acc g'}), (['--accel', ':g'], {'accel_unit': 'g'})])
def test_a_unit_stands_behind_the_field_or_alone(words: list[str], said: dict[str, str]) -> None:
    args = command_parser().parse_args(['info', 'bag', *words])
    assert recording_options(args) == RecordingOptions(**said)


def test_names_that_would_steer_the_terminal_are_escaped_in_errors(
        capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['analyze', 'bag\x1b[2J\nimu_allan: all is well']) == 1
    assert capsys.readouterr().err == (
        'imu_allan: bag\\x1b[2J\\nimu_allan: all is well: no such file or directory\n')
    assert main(['analyze', '\udcff.mcap']) == 1
    assert capsys.readouterr().err == (
        'imu_allan: \\udcff.mcap: no such file or directory\n')


def test_a_reader_that_goes_away_ends_the_command_quietly(recording: Path) -> None:
    with subprocess.Popen([*COMMAND, 'info', str(recording)], stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == b''
    assert process.returncode == 141


def test_ctrl_c_exits_130_without_a_word_and_leaves_nothing_behind(tmp_path: Path) -> None:
    pytest.importorskip('mcap', reason='needs mcap, which rosdep does not install: pip install '
                                       'mcap')
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
    (['analyse', 'bag'], ": error: argument VERB: invalid choice: 'analyse' (choose from "
                         '<words>); did you mean analyze?'),
    (['analyze', 'bag', '--al-topics'],
     ' analyze: error: unrecognized arguments: --al-topics; did you mean --all-topics?'),
    (['export', 'r.json', '--for', 'kalbr'],
     " export: error: argument --for: no consumer is called 'kalbr'; did you mean kalibr? "
     'imu_allan export --list names all'),
    (['analyze', 'bag', '--duration', '5x'],
     f" analyze: error: argument --duration: '5x' {NO_TIME}"),
])
def test_a_misspelt_word_is_told_with_the_right_one(words, meant, capsys):
    with pytest.raises(SystemExit) as stop:
        main(words)
    assert stop.value.code == 2
    complaint = capsys.readouterr().err
    assert complaint.splitlines()[-1] == Varying(f'imu_allan{meant}')
    assert words[0] == 'analyse' or complaint.startswith(f'usage: imu_allan {words[0]} ')


INTERRUPTED = """
import os, signal, sys


class Interrupt:
    def find_spec(self, name, *_):
        if name == interrupted:
            os.kill(os.getpid(), signal.SIGINT)


interrupted = sys.argv.pop(1)
sys.meta_path.insert(0, Interrupt())
from imu_allan.__main__ import main
raise SystemExit(main())
"""


@pytest.mark.parametrize('module', ['imu_allan.cli.main', 'imu_allan.cli.tune', 'argparse',
                                    'imu_allan.recordings', 'numpy', 'scipy', 'rich'])
@pytest.mark.usefixtures('children_unmeasured')
def test_ctrl_c_during_the_imports_exits_130_without_a_word(module: str, recording: Path) -> None:
    done = subprocess.run(
        [sys.executable, '-c', INTERRUPTED, module, 'analyze', str(recording), '--no-progress'],
        check=False, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (130, '')


def test_a_closed_standard_output_is_one_line(recording: Path) -> None:
    done = subprocess.run(['/bin/sh', '-c', '"$@" >&-', 'sh', *COMMAND, 'info', str(recording)],
                          check=False, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (
        1, 'imu_allan: standard output: is closed; lead it to a file, or to /dev/null\n')


def test_a_closed_standard_error_mixes_nothing_into_the_output(tmp_path: Path) -> None:
    done = subprocess.run(['/bin/sh', '-c', '"$@" 2>&-', 'sh', *COMMAND, 'info',
                           str(tmp_path / 'none')], check=False, capture_output=True, timeout=60)
    assert (done.returncode, done.stdout) == (1, b'')


def test_a_limit_to_files_is_not_blamed_on_the_recording(recording: Path, tmp_path: Path) -> None:
    [mcap] = recording.glob('*.mcap')
    path = tmp_path / 'a.mcap.zst'
    path.write_bytes(zstandard.ZstdCompressor(1).compress(mcap.read_bytes()))
    done = subprocess.run(['/bin/sh', '-c', 'ulimit -f 20; exec "$@"', 'sh', *COMMAND, 'info',
                           str(path)], check=False, capture_output=True, text=True, timeout=60,
                          env={**os.environ, 'TMPDIR': str(tmp_path),
                               'PYTHONDONTWRITEBYTECODE': '1'})
    assert (done.returncode, done.stderr) == (
        1, f'imu_allan: {path}: cannot be unpacked or copied to {tmp_path} (File too large); name '
        'a larger folder with TMPDIR, or raise the limit (ulimit -f)\n')
