# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Disks that are full, devices, kills while writing; the table of faults."""

from contextlib import contextmanager
import json
import os
from pathlib import Path
from random import Random
import re
import signal
import socket
import stat
import subprocess
import sys
import time

from imu_allan import analyze
from imu_allan.writers.atomic import write_atomically
from imu_allan.writers.result_files import load_result, save_result
import pytest
from repeated import slow
from whole_lines import unwritable

ROOT = Path(__file__).parents[1]
READ_ONLY = 'Read-only file system'


@pytest.fixture(scope='module')
def result(short_recording, tmp_path_factory):
    path = tmp_path_factory.mktemp('results') / 'r.json'
    save_result(analyze(short_recording), path)
    return path


@contextmanager
def mounted(folder, options):
    """Mount a file system in memory; skip where that is not allowed."""
    folder.mkdir()
    done = subprocess.run(['mount', '-t', 'tmpfs', '-o', options, 'tmpfs', str(folder)],
                          capture_output=True, check=False)
    if done.returncode:
        pytest.skip('mounting a small file system needs root on Linux')
    try:
        yield folder
    finally:
        subprocess.run(['umount', '-l', str(folder)], check=True)


def test_a_disk_that_fills_up_leaves_a_line_and_no_half_file(
        tmp_path, short_recording, fails_with):
    with mounted(tmp_path / 'small', 'size=160k') as disk:
        fails_with(unwritable(disk / 'out' / 'report.html', 'No space left on device')
                   + '; not written either: allan_deviation.png',
                   'analyze', short_recording, '--output', disk / 'out')
        # What was complete before the disk was full is there and whole.
        assert {path.name for path in (disk / 'out').iterdir()} <= {
            'result.json', 'curve.csv', 'allan_deviation.png'}
        assert load_result(disk / 'out' / 'result.json').axes


@pytest.mark.parametrize(('command', 'line'), [
    ('analyze {recording} --output {disk}/out', f'{{disk}}/out: cannot be written ({READ_ONLY}); '
     'choose a folder that may be written to'),
    ('simulate {model} --duration 1s --output {disk}/rec', '{disk}/rec: cannot be created '
     f'({READ_ONLY}: {{disk}}/.rec.unfinished); choose a folder that may be written to'),
    ('report {result} --format png --output {disk}/out', unwritable(
        '{disk}/out/report.html', READ_ONLY)
     + '; not written either: allan_deviation.png, gyro.png'),
    ('export {result} --for kalibr --output {disk}/x', unwritable('{disk}/x', READ_ONLY)),
    ('check {result} --spec {model} --json {disk}/x', unwritable('{disk}/x', READ_ONLY))],
    ids=['analyze', 'simulate', 'report', 'export', 'check'])
def test_a_read_only_disk_is_one_line_for_every_verb(
        tmp_path, short_recording, result, command, line, fails_with):
    model = tmp_path / 'm.yaml'
    model.write_text('gyro: {noise_density: 0.3 deg/sqrt(h)}\n')
    with mounted(tmp_path / 'disk', 'size=1m,ro') as disk:
        words = [word.format(disk=disk, recording=short_recording, result=result, model=model)
                 for word in command.split()]
        fails_with(line.format(disk=disk), *words)


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


@pytest.mark.parametrize(('kind', 'reason'), [
    ('null', None), ('full', 'No space left on device'),
    ('socket', 'No such device or address')])
def test_a_device_is_written_to_and_what_takes_no_bytes_is_one_line_and_stays(
        tmp_path, short_recording, output_of, fails_with, kind, reason):
    target = tmp_path / 'x'
    if kind == 'socket':
        socket.socket(socket.AF_UNIX).bind(str(target))
    else:
        try:
            os.mknod(target, stat.S_IFCHR | 0o666, os.makedev(1, {'null': 3, 'full': 7}[kind]))
            target.open('rb').close()
        except OSError:
            pytest.skip('making a device that can be opened needs root')
    before = target.lstat()
    command = ('analyze', short_recording, '--json', target)
    if reason is None:
        output_of(*command)
    else:
        fails_with(unwritable(target, reason), *command)
    assert (target.lstat().st_ino, target.lstat().st_mode) == (before.st_ino, before.st_mode)


@pytest.mark.parametrize('output', ['pipe', 'file'])
def test_a_result_goes_to_standard_output_wherever_that_leads(tmp_path, short_recording, output):
    file = tmp_path / 'out'
    with file.open('wb') as opened:
        done = subprocess.run(
            [sys.executable, '-m', 'imu_allan', 'analyze', str(short_recording), '--json',
             '/dev/stdout'], stdout=subprocess.PIPE if output == 'pipe' else opened, timeout=60,
            check=True)
    text = (done.stdout or file.read_bytes()).decode()
    document, end = json.JSONDecoder().raw_decode(text)
    assert document['schema'] == 'imu_allan.result/1'
    # The table follows; neither of the two is lost.
    assert '3,000 samples at 100 Hz, 30 s' in text[end:].splitlines()


def test_the_way_through_ones_own_links_and_dots_is_that_of_the_system(tmp_path):
    (tmp_path / 'deep' / 'er').mkdir(parents=True)
    (tmp_path / 'absolute').symlink_to(tmp_path / 'deep' / 'er')
    (tmp_path / 'relative').symlink_to('deep')
    for path, written in (('absolute/../one', 'deep/one'), ('relative/two', 'deep/two')):
        write_atomically(tmp_path / path, b'content')
        assert (tmp_path / written).read_bytes() == b'content'


def test_a_private_file_is_read_by_nobody_else_and_the_umask_stays(tmp_path, monkeypatch):
    monkeypatch.setattr(os, 'umask', lambda _: pytest.fail('the umask belongs to all threads'))
    (tmp_path / 'file').write_bytes(b'')
    (tmp_path / 'file').chmod(0o644)
    write_atomically(tmp_path / 'file', b'content')
    assert (tmp_path / 'file').stat().st_mode & 0o777 == 0o644
    write_atomically(tmp_path / 'file', b'content', private=True)
    assert (tmp_path / 'file').read_bytes() == b'content'
    assert (tmp_path / 'file').stat().st_mode & 0o777 == 0o600


def test_every_fault_of_the_page_names_a_test_that_exists():
    page = (ROOT / 'docs' / 'reliability.md').read_text().partition('## Threat model')[0]
    faults = [line for line in page.splitlines() if line.startswith('- ')]
    assert len(faults) > 20
    for fault in faults:
        names = re.findall(r'`(test/[\w/]+\.py)::(test_\w+)`', fault)
        assert names, fault
        for path, name in names:
            assert re.search(rf'^ *def {name}\(', (ROOT / path).read_text(), re.M), (path, name)
