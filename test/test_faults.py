# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Disks that are full or read-only and kills in the middle of writing; the table of faults."""

import contextlib
import os
from pathlib import Path
from random import Random
import re
import signal
import subprocess
import sys
import time

from imu_allan import analyze
from imu_allan.writers.result_file import load_result, save_result
import pytest
from repeated import slow
from whole_lines import unwritable, Varying

ROOT = Path(__file__).parents[1]
MODEL = 'gyro: {noise_density: 0.3 deg/sqrt(h)}\n'


@pytest.fixture(scope='module')
def result(short_recording, tmp_path_factory):
    path = tmp_path_factory.mktemp('results') / 'r.json'
    save_result(analyze(short_recording), path)
    return path


@contextlib.contextmanager
def mounted(folder, options):
    """Mount a file system in memory; skip where that is not allowed."""
    if not sys.platform.startswith('linux') or os.geteuid() != 0:
        pytest.skip('mounting a small file system needs root on Linux')
    folder.mkdir()
    done = subprocess.run(['mount', '-t', 'tmpfs', '-o', options, 'tmpfs', str(folder)],
                          capture_output=True, check=False)
    if done.returncode:
        pytest.skip('mounting is not allowed here')
    try:
        yield folder
    finally:
        subprocess.run(['umount', '-l', str(folder)], check=True)


def assert_one_line(done, line):
    assert done.returncode == 1, done.stderr
    assert done.stderr == Varying(f'imu_allan: {line}\n')


def files_in(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob('*') if path.is_file())


def test_a_disk_that_fills_up_during_analyze_is_one_line_and_leaves_no_half_file(
        tmp_path, short_recording, fails_with):
    with mounted(tmp_path / 'small', 'size=160k') as disk:
        fails_with(unwritable(disk / 'out' / '<words>', 'No space left on device'),
                   'analyze', short_recording, '--output', disk / 'out')
        # What was complete before the disk was full is there and whole.
        assert set(files_in(disk / 'out')) <= {'result.json', 'curve.csv', 'allan_deviation.png'}
        assert load_result(disk / 'out' / 'result.json').axes


@pytest.mark.parametrize('verb', ['analyze', 'simulate', 'report', 'export', 'check'])
def test_a_read_only_disk_is_one_line_for_every_verb(
        tmp_path, short_recording, result, verb, fails_with):
    model = tmp_path / 'm.yaml'
    model.write_text(MODEL)
    with mounted(tmp_path / 'disk', 'size=1m,ro') as disk:
        reason = 'Read-only file system'
        fails_with({
            'analyze': f'{disk}/out: cannot be written ({disk} lies on a {reason}); choose a '
                       'folder that may be written to',
            'simulate': f'{disk}/rec: cannot be created ({reason}: {disk}/.rec.unfinished); '
                        'choose a folder that may be written to',
            'report': unwritable(disk / 'out' / 'report.html', reason),
            'export': unwritable(disk / 'x.yaml', reason),
            'check': unwritable(disk / 'x.json', reason)}[verb], *{
            'analyze': ['analyze', short_recording, '--output', disk / 'out'],
            'simulate': ['simulate', model, '--duration', '1s', '--output', disk / 'rec'],
            'report': ['report', result, '--output', disk / 'out'],
            'export': ['export', result, '--for', 'kalibr', '--output', disk / 'x.yaml'],
            'check': ['check', result, '--spec', model, '--json', disk / 'x.json']}[verb])


def test_a_terminal_that_takes_no_more_is_no_traceback(short_recording):
    if not Path('/dev/full').exists():
        pytest.skip('needs /dev/full')
    with Path('/dev/full').open('w') as full:
        done = subprocess.run([sys.executable, '-m', 'imu_allan', 'info', str(short_recording)],
                              stdout=full, stderr=subprocess.PIPE, text=True, timeout=60,
                              check=False)
    assert_one_line(done, 'standard output: No space left on device')


WRITER = """
import sys
from pathlib import Path
from imu_allan.writers.atomic import write_atomically
number = 0
while True:
    number += 1
    print(number, flush=True)
    write_atomically(sys.argv[1], (b'%09d' % number) * 200_000)
"""


@pytest.mark.parametrize(('kills', 'fewest'), [(10, 0), slow(200, 100)])
def test_a_kill_at_any_moment_of_writing_leaves_a_whole_file(tmp_path, kills, fewest):
    target, choice, written = tmp_path / 'file', Random(kills), 0
    for _ in range(kills):
        with subprocess.Popen([sys.executable, '-c', WRITER, str(target)],
                              stdout=subprocess.PIPE) as process:
            # So many times it has begun to write: the clock of a busy machine says nothing.
            for _ in range(choice.randrange(1, 20)):
                process.stdout.readline()
            time.sleep(choice.uniform(0, .003))
            process.send_signal(signal.SIGKILL)
        if target.exists():
            content = target.read_bytes()
            assert len(content) == 1_800_000
            assert content == content[:9] * 200_000
            written += 1
    assert written > fewest


def test_every_fault_of_the_page_names_a_test_that_exists():
    page = (ROOT / 'docs' / 'reliability.md').read_text().partition('## Threat model')[0]
    faults = [line for line in page.splitlines() if line.startswith('- ')]
    assert len(faults) > 20
    for fault in faults:
        names = re.findall(r'`(test/[\w/]+\.py)::(test_\w+)`', fault)
        assert names, fault
        for path, name in names:
            assert re.search(rf'^ *def {name}\(', (ROOT / path).read_text(), re.M), (path, name)
