# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Two processes, or two users, that write to the same place at the same time."""

from contextlib import contextmanager
import os
import shutil
import subprocess
import sys
import time

from imu_allan.analysis import Choice
from imu_allan.cli.tasks import characterize, Task
from imu_allan.errors import ImuAllanError
from imu_allan.writers import output_path
from imu_allan.writers.atomic import write_atomically
from imu_allan.writers.output_path import folder_lock
import pytest
from shared_places import planted, shared_folder, SOMEBODY_ELSE
from whole_lines import unwritable, Varying

KEPT = ('{}: cannot be written (another process writes to it); choose another folder, or wait '
        'until it has ended')
SWAP = """
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


@contextmanager
def links_come_and_go(link, target):
    """Let another user put a link there and take it away again, all the time."""
    process = subprocess.Popen(
        [sys.executable, '-I', '-c', SWAP, str(SOMEBODY_ELSE), str(link), str(target)],
        stdout=subprocess.PIPE)
    with process:
        try:
            process.stdout.readline()
            yield
        finally:
            process.kill()


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
    with links_come_and_go(shared / 'out', precious):
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
    assert written > 10
    assert refusals > 10


@pytest.fixture
def link(tmp_path):
    """Give a link to a folder of this user that another one put into a shared one."""
    (tmp_path / 'precious').mkdir()
    return planted(shared_folder(tmp_path / 'shared') / 'link', tmp_path / 'precious')


def test_a_simulated_recording_follows_no_link_of_another_user(tmp_path, link, fails_with):
    for output in (link / 'sim', link / 'deeper' / 'sim'):
        fails_with(f'{output}: cannot be created ({link} is a link that another user put into a '
                   'folder that everybody may write to); choose a folder that may be written to',
                   'simulate', 'consumer_mems', '--duration', '1s', '--output', output)
    assert not list((tmp_path / 'precious').iterdir())


def test_analyze_waits_for_its_turn_and_mixes_no_files(tmp_path, short_recording, monkeypatch):
    monkeypatch.setattr(output_path, 'LOCK_TIMEOUT_S', 0.1)
    with folder_lock(tmp_path / 'out'):
        result, error = characterize(Task(str(short_recording), Choice(), folder=tmp_path / 'out'))
    assert result.axes
    assert str(error) == KEPT.format(tmp_path / 'out')
    assert not list((tmp_path / 'out').iterdir())
