# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Disks that are full, devices, links of others, kills while writing; the table of faults."""

from contextlib import contextmanager
import json
import os
from pathlib import Path
from random import Random
import re
import shutil
import signal
import socket
import stat
import subprocess
import sys
import time

from imu_allan import analyze
from imu_allan.analysis import Choice
from imu_allan.cli.tasks import characterize, Task
from imu_allan.errors import ImuAllanError
from imu_allan.writers import output_path
from imu_allan.writers.atomic import write_atomically
from imu_allan.writers.output_path import folder_lock
from imu_allan.writers.result_file import load_result, save_result
import pytest
from repeated import slow
from whole_lines import unwritable, Varying

ROOT = Path(__file__).parents[1]
READ_ONLY = 'Read-only file system'
SOMEBODY_ELSE = 12345


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
        fails_with(unwritable(disk / 'out' / '<words>', 'No space left on device'),
                   'analyze', short_recording, '--output', disk / 'out')
        # What was complete before the disk was full is there and whole.
        assert {path.name for path in (disk / 'out').iterdir()} <= {
            'result.json', 'curve.csv', 'allan_deviation.png'}
        assert load_result(disk / 'out' / 'result.json').axes


@pytest.mark.parametrize(('command', 'line'), [
    ('analyze {recording} --output {disk}/out', '{disk}/out: cannot be written ({disk} lies on a '
     f'{READ_ONLY}); choose a folder that may be written to'),
    ('simulate {model} --duration 1s --output {disk}/rec', '{disk}/rec: cannot be created '
     f'({READ_ONLY}: {{disk}}/.rec.unfinished); choose a folder that may be written to'),
    ('report {result} --output {disk}/out', unwritable('{disk}/out/report.html', READ_ONLY)),
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
    ('null', None), ('full', 'No space left on device'), ('pipe', 'No such device or address'),
    ('socket', 'No such device or address')])
def test_a_device_is_written_to_and_what_takes_no_bytes_is_one_line_and_stays(
        tmp_path, short_recording, output_of, fails_with, kind, reason):
    target = tmp_path / 'x'
    if kind == 'pipe':
        os.mkfifo(target)
    elif kind == 'socket':
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


def shared_folder(folder):
    """Make a folder like /tmp: everybody may write to it, nobody may remove what is not theirs."""
    folder.mkdir()
    folder.chmod(0o1777)
    return folder


def test_a_link_planted_in_a_shared_folder_is_not_followed(tmp_path, short_recording, fails_with):
    precious = tmp_path / 'precious' / 'result.json'
    precious.parent.mkdir()
    precious.write_text('mine')
    shared = shared_folder(tmp_path / 'shared')
    file, folder = shared / 'file', shared / 'folder'
    for link, target in ((file, precious), (folder, precious.parent)):
        link.symlink_to(target)
        try:
            os.lchown(link, SOMEBODY_ELSE, SOMEBODY_ELSE)
        except PermissionError:
            pytest.skip('acting as another user needs root')
    why = 'is a link that another user put into a folder that everybody may write to'
    for option, link, output in (('--json', file, file),
                                 ('--output', folder, folder / 'result.json')):
        fails_with(unwritable(output, f'{link} {why}'), 'analyze', short_recording, option, link)
    for output in (folder / 'sim', folder / 'deeper' / 'sim'):
        fails_with(f'{output}: cannot be created ({folder} {why}); choose a folder that may be '
                   'written to',
                   'simulate', 'consumer_mems', '--duration', '1s', '--output', output)
    assert [*precious.parent.iterdir()] == [precious]
    assert precious.read_text() == 'mine'


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


SWAPS_A_LINK = """
import os, random, sys, time
os.setuid(int(sys.argv[1]))
link, target = sys.argv[2:]
print('ready', flush=True)
while True:
    try:
        os.symlink(target, link)
        time.sleep(random.random() * 0.003)
        os.unlink(link)
        time.sleep(random.random() * 0.003)
    except OSError:
        pass
"""


def test_a_link_that_comes_between_looking_and_writing_is_not_followed(tmp_path):
    # 3 in 1000 writes went to the other folder before.
    if os.name != 'posix' or os.geteuid() != 0:
        pytest.skip('acting as another user needs root')
    shared, precious = shared_folder(tmp_path / 'shared'), tmp_path / 'precious'
    # The other user has to get there.
    for above in shared.parents:
        above.chmod(above.stat().st_mode | 0o111)
    precious.mkdir()
    (precious / 'result.json').write_text('mine')
    written = refusals = 0
    line = Varying(unwritable(shared / 'out' / 'result.json', '<words>'))
    with subprocess.Popen([sys.executable, '-I', '-c', SWAPS_A_LINK, str(SOMEBODY_ELSE),
                           str(shared / 'out'), str(precious)], stdout=subprocess.PIPE) as other:
        try:
            other.stdout.readline()
            # On a busy computer the other user seldom comes to its turn.
            end = time.monotonic() + 2.0
            while time.monotonic() < end or (
                    min(written, refusals) <= 10 and time.monotonic() < end + 60):
                try:
                    write_atomically(shared / 'out' / 'result.json', b'x')
                except ImuAllanError as error:
                    assert str(error) == line
                    refusals += 1
                else:
                    written += 1
                    shutil.rmtree(shared / 'out', ignore_errors=True)
                assert [path.name for path in precious.iterdir()] == ['result.json']
                assert (precious / 'result.json').read_text() == 'mine'
        finally:
            other.kill()
    assert written > 10
    assert refusals > 10


def test_analyze_waits_for_its_turn_and_mixes_no_files(tmp_path, short_recording, monkeypatch):
    monkeypatch.setattr(output_path, 'LOCK_TIMEOUT_S', 0.1)
    with folder_lock(tmp_path / 'out'):
        result, error = characterize(Task(str(short_recording), Choice(), folder=tmp_path / 'out'))
    assert result.axes
    assert str(error) == (
        f'{tmp_path}/out: cannot be written (another process writes to it); choose another '
        'folder, or wait until it has ended')
    assert not list((tmp_path / 'out').iterdir())


def test_every_fault_of_the_page_names_a_test_that_exists():
    page = (ROOT / 'docs' / 'reliability.md').read_text().partition('## Threat model')[0]
    faults = [line for line in page.splitlines() if line.startswith('- ')]
    assert len(faults) > 20
    for fault in faults:
        names = re.findall(r'`(test/[\w/]+\.py)::(test_\w+)`', fault)
        assert names, fault
        for path, name in names:
            assert re.search(rf'^ *def {name}\(', (ROOT / path).read_text(), re.M), (path, name)
