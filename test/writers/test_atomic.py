# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
import os

from imu_allan.writers.atomic import write_atomically
import pytest
from whole_lines import refused, unwritable


def test_a_file_is_made_with_the_folders_it_needs_and_nothing_else_is_left(tmp_path):
    target = tmp_path / 'a' / 'b' / 'file'
    for content in (b'one', b'two'):
        write_atomically(target, content)
        assert [path.name for path in target.parent.iterdir()] == ['file']
        assert target.read_bytes() == content


def test_a_failure_leaves_the_old_content_and_no_debris(tmp_path, monkeypatch):
    write_atomically(tmp_path / 'file', b'old')

    def full_disk(_handle):
        raise OSError(28, 'No space left on device')

    monkeypatch.setattr(os, 'fsync', full_disk)
    with refused(unwritable(tmp_path / 'file', 'No space left on device')):
        write_atomically(tmp_path / 'file', b'new')
    assert [path.name for path in tmp_path.iterdir()] == ['file']
    assert (tmp_path / 'file').read_bytes() == b'old'


@pytest.mark.parametrize(('name', 'why'), [
    ('file/below', 'Not a directory'), ('folder', 'is a directory')])
def test_a_file_in_the_place_of_a_folder_and_the_reverse_are_reported(tmp_path, name, why):
    (tmp_path / 'file').write_bytes(b'')
    (tmp_path / 'folder').mkdir()
    with refused(unwritable(tmp_path / name, why)):
        write_atomically(tmp_path / name, b'x')


def test_permissions_are_those_of_the_file_before_or_of_the_umask(tmp_path):
    old = os.umask(0o027)
    try:
        write_atomically(tmp_path / 'new', b'')
    finally:
        os.umask(old)
    assert (tmp_path / 'new').stat().st_mode & 0o777 == 0o640
    (tmp_path / 'new').chmod(0o600)
    write_atomically(tmp_path / 'new', b'again')
    assert (tmp_path / 'new').stat().st_mode & 0o777 == 0o600
