# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Devices, pipes, sockets and other people's links as outputs: written to or refused."""

import json
import os
from pathlib import Path
import socket
import stat
import subprocess
import sys

from imu_allan.cli.main import main
from imu_allan.writers.atomic import write_atomically
import pytest
from shared_places import planted, shared_folder
from whole_lines import unwritable


def special_file(path: Path, kind: str) -> Path:
    """Make a pipe, a socket or a device; skip where that is not allowed."""
    if kind == 'pipe':
        os.mkfifo(path)
    elif kind == 'socket':
        socket.socket(socket.AF_UNIX).bind(str(path))
    else:
        try:
            os.mknod(path, stat.S_IFCHR | 0o666, os.makedev(1, {'null': 3, 'full': 7}[kind]))
            path.open('rb').close()
        except OSError:
            pytest.skip('making a device that can be opened needs root')
    return path


def test_a_device_is_written_to_and_stays_a_device(tmp_path, short_recording):
    null = special_file(tmp_path / 'null', 'null')
    before = null.stat()
    assert main(['analyze', str(short_recording), '--json', str(null)]) == 0
    assert (null.stat().st_ino, null.stat().st_mode) == (before.st_ino, before.st_mode)


@pytest.mark.parametrize(('kind', 'reason'), [
    ('full', 'No space left on device'), ('pipe', 'No such device or address'),
    ('socket', 'No such device or address')])
def test_what_takes_no_bytes_is_one_line_and_stays(
        tmp_path, short_recording, fails_with, kind, reason):
    target = special_file(tmp_path / 'x', kind)
    before = target.lstat().st_mode
    fails_with(unwritable(target, reason), 'analyze', short_recording, '--json', target)
    assert target.lstat().st_mode == before


@pytest.mark.parametrize('output', ['pipe', 'file'])
def test_a_result_goes_to_standard_output_wherever_that_leads(tmp_path, short_recording, output):
    command = [sys.executable, '-m', 'imu_allan', 'analyze', str(short_recording), '--json',
               '/dev/stdout']
    if output == 'pipe':
        text = subprocess.run(command, capture_output=True, text=True, timeout=60,
                              check=True).stdout
    else:
        with (tmp_path / 'out').open('wb') as file:
            subprocess.run(command, stdout=file, timeout=60, check=True)
        text = (tmp_path / 'out').read_text()
    document, end = json.JSONDecoder().raw_decode(text)
    assert document['schema'] == 'imu_allan.result/1'
    # The table follows; neither of the two is lost.
    assert '3,000 samples at 100 Hz, 30 s' in text[end:].splitlines()


@pytest.mark.parametrize(('option', 'inside'), [('--json', ''), ('--output', 'result.json')])
def test_a_link_planted_in_a_shared_folder_is_not_followed(
        tmp_path, short_recording, fails_with, option, inside):
    precious = tmp_path / 'precious' / 'result.json'
    precious.parent.mkdir()
    precious.write_text('mine')
    link = planted(shared_folder(tmp_path / 'shared') / 'link',
                   precious.parent if inside else precious)
    fails_with(unwritable(link / inside, f'{link} is a link that another user put into a folder '
                                         'that everybody may write to'),
               'analyze', short_recording, option, link)
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
