# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The folder of a run belongs to one process; lock and state are plain files of one user."""

import os
from pathlib import Path
import subprocess
import sys
import time

from imu_allan.errors import ImuAllanError
from imu_allan.node.checkpoint import StateFile
from imu_allan.node.run_folder import claimed, leave_if_empty
import numpy as np
import pytest
from whole_lines import refused, Varying

CLAIM = """
import sys
from pathlib import Path
from imu_allan.node.run_folder import claimed
print(claimed(Path(sys.argv[1])), flush=True)
sys.stdin.read()
"""


def test_two_processes_have_two_folders_and_a_later_one_the_first_again(tmp_path: Path) -> None:
    folder = tmp_path / 'runs' / 'imu_allan_2026-11-22T00-00-00'
    assert claimed(folder) == claimed(folder) == folder
    for _ in range(2):
        other = subprocess.run([sys.executable, '-c', CLAIM, str(folder)], text=True,
                               capture_output=True, stdin=subprocess.DEVNULL, timeout=300,
                               check=True)
        # The process before has ended: its folder is free again, this one's is not.
        assert other.stdout == f'{folder}-2\n'
    assert sorted(path.name for path in folder.parent.iterdir()) == [
        folder.name, f'{folder.name}-2']


def test_a_folder_that_stays_empty_is_removed_and_free_for_others(tmp_path: Path) -> None:
    folder = tmp_path / 'imu_allan_2026-11-22T00-00-00'
    leave_if_empty(claimed(folder))
    assert not folder.exists()
    with subprocess.Popen([sys.executable, '-c', CLAIM, str(folder)], text=True,
                          stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == f'{folder}\n'
        second = claimed(folder)
        assert second == folder.with_name(f'{folder.name}-2')
        (second / 'result.json').write_text('{}')
        # What is in it stays, and so does the claim.
        leave_if_empty(second)
        assert claimed(folder) == second
        other.communicate()


def test_a_node_that_is_reset_a_hundred_times_keeps_few_files_open(tmp_path: Path) -> None:
    open_files = Path('/proc/self/fd')
    folders = [tmp_path / f'imu_allan_{number}' for number in range(100)]
    claimed(folders[0])
    before = len(list(open_files.iterdir()))
    assert [claimed(folder) for folder in folders] == folders
    assert len(list(open_files.iterdir())) < before + 40
    # The one in use stays this process's own, and an earlier one is its own again.
    assert claimed(folders[-1]) == folders[-1]
    assert claimed(folders[0]) == folders[0]


@pytest.mark.parametrize('name', ['state', 'state.lock'])
def test_a_pipe_as_state_or_lock_is_one_line_at_once(tmp_path: Path, name: str) -> None:
    os.mkfifo(tmp_path / name)
    began = time.monotonic()
    with pytest.raises(ImuAllanError) as error:
        StateFile(tmp_path / 'state')
    # A pipe is waited for until somebody writes to it: for ever.
    assert time.monotonic() - began < 60
    assert str(error.value) == f'state_file {tmp_path / "state"}: ' + (
        'is a device, a pipe or a socket; name a regular file, or one that is not there yet'
        if name == 'state' else
        'cannot be written (state.lock is not a regular file); choose a folder that may be '
        'written to')
    assert sorted(path.name for path in tmp_path.iterdir()) == [name]


def test_a_lock_that_is_a_link_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / 'precious').write_text('mine')
    (tmp_path / 'state.lock').symlink_to(tmp_path / 'precious')
    with refused(Varying(f'state_file {tmp_path / "state"}: cannot be written (<words>); choose a '
                         'folder that may be written to')):
        StateFile(tmp_path / 'state')
    assert (tmp_path / 'precious').read_text() == 'mine'


def test_state_and_lock_are_read_by_nobody_else(tmp_path: Path) -> None:
    file = StateFile(tmp_path / 'state')
    file.save({'sums': np.arange(3.0)})
    file.close()
    assert {path.name: path.stat().st_mode & 0o777 for path in tmp_path.iterdir()} == {
        'state': 0o600, 'state.lock': 0o600}


def test_a_state_that_could_not_be_loaded_is_not_saved(tmp_path: Path) -> None:
    file = StateFile(tmp_path / 'state')
    file.save({'sums': np.arange(3.0)})
    with refused(Varying(f'{tmp_path / "state"}: a state of <number> bytes could not be resumed '
                         'from, so it is not written; the one before it stays')):
        file.save({'sums': np.zeros(9_000_000)})
    assert file.load() is not None
    file.close()
