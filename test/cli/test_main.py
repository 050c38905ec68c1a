# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
import os
from pathlib import Path
import re
import shlex
import signal
import statistics
import subprocess
import sys

from imu_allan.cli.arguments import recording_options
from imu_allan.cli.main import command_parser
from imu_allan.finding_texts import WORDS
from imu_allan.recordings import RecordingOptions
from processes import interrupted, python, wait_until
import pytest
from whole_lines import Varying

COMMAND = [sys.executable, '-m', 'imu_allan']
NO_TIME = ('is not a length of time: write seconds (90), or a number with ms, s, m or min, h or d '
           '(10min)')
VERBS = ('analyze', 'info', 'simulate', 'check', 'tune', 'export', 'report', 'explain')
CHOICE = 'invalid choice: {} (choose from <words>)'
NO_RATE = "argument --rate: '{}' is no rate: write Hz (100), or a number with Hz or kHz (2kHz)"


@pytest.mark.parametrize(('words', 'heavy', 'most'), [
    (['--help'], 'numpy scipy matplotlib rich rosbags mcap pint jinja2 yaml rclpy distributed',
     2.5), (['explain'], 'scipy', 50), (['info', '.'], 'scipy', 50)])
def test_a_verb_waits_for_nothing_heavy_that_it_does_not_need(recording, words, heavy, most):
    code = ('import atexit, sys\n'
            'atexit.register(lambda: print({*sys.argv[1].split()} & {*sys.modules}))\n'
            'from imu_allan.cli.main import main\nmain(sys.argv[2:])')

    def cpu_s(*arguments):
        before = os.times()
        answer = python('-c', *arguments, cwd=recording, check=True)
        after = os.times()
        return sum(after[2:4]) - sum(before[2:4]), answer

    spent = []
    # Computers differ by a factor of five, in seconds but not in imports of Python's own.
    for _ in range(5):
        verb_s, answer = cpu_s(code, heavy, *words)
        spent.append((verb_s, cpu_s('import asyncio')[0]))
    assert answer.stderr == ''
    assert answer.stdout.endswith('\nset()\n')
    verb_s, imports_s = map(statistics.median, zip(*spent, strict=True))
    assert verb_s < most * imports_s


@pytest.mark.parametrize('verb', VERBS)
def test_every_verb_has_its_help_for_a_terminal(verb, output_of):
    text = output_of(verb, '--help')
    assert text.startswith(f'usage: imu_allan {verb}')
    assert f'\nexamples:\n  imu_allan {verb} ' in text
    overview = output_of('--help')
    assert f'\n    {verb} ' in overview
    assert [line for line in (text + overview).splitlines() if len(line) > 80] == []
    # What may be left out stands in the usage, too.
    assert (verb == 'explain') == text.startswith('usage: imu_allan explain [CODE] [options]\n')
    assert (verb in {'analyze', 'report'}) == ('... [options]' in text.splitlines()[0])


@pytest.mark.parametrize(('words', 'line'), [
    ('', 'the following arguments are required: VERB'),
    ('analyse bag', 'argument VERB: ' + CHOICE.format("'analyse'")),
    ('analyze bag --al-topics', 'unrecognized arguments: --al-topics; did you mean --all-topics?'),
    ('check one two three --spec spec.yaml', 'unrecognized arguments: two three; '
     'imu_allan check takes one RESULT_OR_RECORDING at a time'),
    ('analyze bag --rate 0', 'argument --rate: 0 is not above zero'),
    ('analyze bag --rate fast', NO_RATE.format('fast')),
    ('analyze bag --rate 1e9',
     'argument --rate: 1e9: no IMU has such a rate; give the rate in Hz'),
    ('analyze bag --clock none', '--clock none needs --rate'),
    ('analyze bag --start -1', 'argument --start: -1 is below zero'),
    ('analyze bag --start 1e300', 'argument --start: 1e300 is more than a hundred years'),
    ('analyze bag --duration 3weeks', f"argument --duration: '3weeks' {NO_TIME}"),
    ('analyze bag --jobs 0', 'argument --jobs: 0 is below one'),
    ('analyze bag --topic /imu --all-topics',
     'argument --all-topics: not allowed with argument --topic'),
    ('analyze one two --json result.json',
     '--json takes one recording; use --output DIR for several'),
    ('analyze one two --meta serial=A-17',
     '--meta serial is of one unit; several are named by --name-from'),
    ('analyze one two --together --all-topics',
     '--together takes several recordings of one topic'),
    ('simulate model --seed 1.5', "argument --seed: '1.5' is not a whole number"),
    ('export --for kalibr', 'takes a RESULT, or a datasheet by --spec FILE'),
    ('export r.json --for kalbr', "argument --for: no consumer is called 'kalbr'; did you "
     'mean kalibr? imu_allan export --list names all'),
    *((f'export r.json --for kalibr --inflate={bad}', f'argument --inflate: {line}')
      for bad, line in (
          *((bad, f"'{bad}' is not of the form N=2,K=5: a factor for N, for K, or for both")
            for bad in ('N', 'B=2', 'N=2,N=3')),
          ('N=0', '0 is not above zero'), ('K=nan', 'nan is not a finite number'))),
    *((f'tune r.json --aiding={bad}', f'argument --aiding: {line}') for bad, line in (
        ('nan', f"'nan' {NO_TIME}"), ('0', '0 is not above zero'),
        ('1e-30', '1e-30 is less than a microsecond'))),
    ('check r.json', 'the following arguments are required: --spec'),
    ('check bag --spec x --meta colour=red', "argument --meta: 'colour=red' is not of the form "
     'KEY=VALUE with a KEY of serial, operator, station'),
    *((f'check r.json --spec x {option}', f'{option.split()[0]} needs a recording, not a result')
      for option in ('--start 5', '--duration 5', '--topic /t', '--rate 5', '--clock receive',
                     '--gyro :deg/s', '--motion keep', '--columns gyro_x=1', '--live')),
    *((f'tune r.json {option}', f'{option.split()[0]} needs the recording that --verify names')
      for option in ('--topic /t', '--rate 5', '--accel-topic /t')),
    ('report r.json --format bmp', "argument --format: 'bmp' is not one of png, svg, pdf"),
    # A line break within a number.
    ('analyze bag --rate 1\\n2', NO_RATE.format('1\\n2')),
])
def test_wrong_usage_is_reported_in_two_lines_with_the_right_word(words, line, ran):
    status, out, err = ran(*(word.replace('\\n', '\n') for word in words.split()))
    usage, error = err.splitlines()
    assert (status, out, usage[:16]) == (2, '', 'usage: imu_allan')
    verb = next((f' {word}' for word in words.split()[:1] if word in VERBS), '')
    assert error == Varying(f'imu_allan{verb}: error: {line}')


@pytest.mark.parametrize(('verb', 'name', 'line'), [
    ('analyze', 'bag\x1b[2J\nimu_allan: all is well',
     'bag\\x1b[2J\\nimu_allan: all is well: no such file or directory'),
    ('analyze', '\udcff.mcap', '\\udcff.mcap: no such file or directory'),
    ('simulate', 'no/such/model', 'no/such/model: no such file, and no model of that name is '
     'shipped; give the path of a noise model YAML file'),
    ('tune', 'no/such/result', 'no/such/result: cannot be read (No such file or directory); give '
     'the path of a result file, written by: imu_allan analyze RECORDING --json FILE'),
    ('simulate', '~nosuchuser/x',
     '~nosuchuser/x: this user has no home folder; write the path without ~')])
def test_a_missing_file_is_one_line_and_steers_no_terminal(verb, name, line, fails_with):
    assert fails_with(line, verb, name) == ''


def test_help_shows_what_most_need_and_help_all_the_rest(output_of):
    shown = {word: output_of('analyze', word) for word in ('--help', '--help-all')}
    options = {word: re.findall(r'^  (?:-\w(?: DIR)?, )?(--[\w-]+)', text, re.MULTILINE)
               for word, text in shown.items()}
    assert {*options['--help']} == {
        '--topic', '--all-topics', '--output', '--together', '--for', '--rate', '--start',
        '--duration', '--columns', '--jobs', '--units', '--verbose', '--help', '--help-all'}
    assert set(options['--help-all']) > {*options['--help'], '--name-from', '--meta', '--gyro'}
    # What other options say now is taken all the same.
    assert '--serial' not in options['--help-all']
    for text in shown.values():
        assert len(re.findall('^  imu_allan analyze ', text, re.MULTILINE)) == 3


@pytest.mark.parametrize(('words', 'key', 'expected'), [
    ('analyze bag -o out', 'output', 'out'),
    ('analyze bag --rate 100', 'rate', 100.0), ("analyze bag --rate '0.5 khz'", 'rate', 500.0),
    ('analyze bag --duration 5m', 'duration', 300.0), ('analyze bag --start 90s', 'start', 90.0),
    ('analyze bag --accel-rate 200Hz', 'accel_rate', 200.0),
    ('analyze bag --for VINS', 'consumers', ['vins_fusion']),
    ("analyze bag --meta serial=A=7 --meta 'station= 3 '", 'meta',
     [('serial', 'A=7'), ('station', '3')]),
    ('check bag --spec x --serial A-17', 'meta', [('serial', 'A-17')])])
def test_times_rates_and_names_are_read_as_people_write_them(words, key, expected):
    assert getattr(command_parser().parse_args(shlex.split(words)), key) == expected


@pytest.mark.parametrize(('words', 'said'), [
    (['--gyro', 'imu.gyro[0:3]:deg/s'], {'gyro': 'imu.gyro[0:3] deg/s'}),
    (['--gyro', 'imu.gyro[0:3]'], {'gyro': 'imu.gyro[0:3]'}),
    (['--accel', 'imu.acc:g'], {'accel': 'imu.acc g'}), (['--accel', ':g'], {'accel_unit': 'g'})])
def test_a_unit_stands_behind_the_field_or_alone(words, said):
    args = command_parser().parse_args(['info', 'bag', *words])
    assert recording_options(args) == RecordingOptions(**said)


@pytest.mark.parametrize('words', [
    'info .', 'analyze .', 'export --spec consumer_mems --for plain --output -'])
def test_a_reader_that_goes_away_ends_the_command_quietly(recording, words):
    with subprocess.Popen([*COMMAND, *words.split()], stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, cwd=recording) as process:
        process.stdout.close()
        assert process.stderr.read() == b''
    assert process.returncode == 141


@pytest.mark.parametrize(('closed', 'silent'), [
    ('>&-', True), ('2>&-', False), ('<&- >&- 2>&-', True)])
def test_what_goes_to_a_closed_standard_stream_vanishes(recording, tmp_path, closed, silent):
    for words in (['info', '.'], ['analyze', '.', '--output', str(tmp_path / 'results')]):
        done = subprocess.run(['sh', '-c', f'"$@" {closed}', 'sh', *COMMAND, *words],
                              cwd=recording, capture_output=True, check=False)
        assert (done.returncode, done.stderr, done.stdout == b'') == (0, b'', silent)
    assert (tmp_path / 'results' / 'result.json').is_file()


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_command_without_a_word_and_leaves_nothing_behind(tmp_path, number):
    pytest.importorskip('mcap', reason='needs mcap, which rosdep does not install: pip install '
                                       'mcap')
    with subprocess.Popen([*COMMAND, 'simulate', 'consumer_mems', '--duration', '30d', '--output',
                           str(tmp_path / 'simulated')], stderr=subprocess.PIPE) as process:
        wait_until(lambda: any(tmp_path.glob('.simulated*/*')))
        process.send_signal(number)
        assert process.stderr.read() == b''
    assert process.returncode == 128 + number
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize('slow_s', [0.0, 0.05])
@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_during_a_callback_which_python_ignores_comes_again(number, slow_s):
    done = python('-c', """
import os, sys, time
from imu_allan import process
from imu_allan.process import exit_status, interruptible
class Timer(process.Timer):
    slow_s = [float(sys.argv[2])]
    def start(self):
        super().start()
        if self.slow_s:
            time.sleep(self.slow_s.pop())
process.Timer = Timer
class Callback:
    def __del__(self):
        os.kill(os.getpid(), int(sys.argv[1]))
        time.sleep(0.1)
try:
    with interruptible():
        Callback()
        time.sleep(0.1)
        print('lost')
except KeyboardInterrupt:
    sys.exit(exit_status())
""", str(int(number)), slow_s)
    assert (done.returncode, done.stdout, done.stderr) == (128 + number, '', '')


@pytest.mark.parametrize(('module', 'recordings'), [
    ('imu_allan.cli.main', 1), ('numpy', 1), ('mcap', 1), ('scipy', 1),
    ('scipy', 2)])
@pytest.mark.usefixtures('children_unmeasured')
def test_ctrl_c_during_the_imports_exits_130_without_a_word(module, recordings, recording):
    done = interrupted('imu_allan.__main__', module, 'analyze', *[str(recording)] * recordings,
                       '--no-progress')
    assert (done.returncode, done.stderr) == (130, '')


@pytest.mark.skipif(not Path('/dev/full').exists(), reason='needs /dev/full')
def test_a_full_disk_behind_standard_output_is_one_line(recording):
    with Path('/dev/full').open('w') as full:
        done = subprocess.run([*COMMAND, 'info', '.'], cwd=recording, check=False, stdout=full,
                              stderr=subprocess.PIPE, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (
        1, 'imu_allan: standard output: No space left on device\n')


@pytest.mark.parametrize(('package', 'verb'), [
    ('mcap', 'analyze'), ('zstandard', 'info'), ('rich', 'analyze')])
def test_a_package_that_is_not_installed_is_one_line(recording, package, verb):
    done = python('-c', f'import sys; sys.modules[{package!r}] = None\nfrom imu_allan.cli.main '
                  f'import main\nsys.exit(main([{verb!r}, {str(recording)!r}]))')
    assert (done.returncode, done.stderr) == (
        1, f'imu_allan: needs the Python package {package}, which is not installed: pip install '
        f'{package}\n')


def test_every_finding_is_listed_and_explained_by_its_code_or_by_its_title(output_of, fails_with):
    assert [line.split()[0] for line in output_of('explain').splitlines()] == [*WORDS]
    for code, words in WORDS.items():
        said = output_of('explain', words.title)
        assert f'{code}: {words.title} (' in said
        assert '\nWhat it means: ' in said
        assert output_of('explain', *words.title.split()) == said
    assert output_of('explain', 'NOT-STEADY') == output_of('explain', 'not_steady')
    fails_with('bias_stop: no finding has this code; did you mean bias_step? (all: imu_allan '
               'explain)', 'explain', 'bias_stop')
