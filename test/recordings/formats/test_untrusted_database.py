# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Databases that somebody made to cost the reader time, memory or files."""

import os
from pathlib import Path
import shutil
import sqlite3

from bags import assert_same, block, files_in, read, said, write_db3
from hostile_databases import HOSTILE
from imu_allan.recordings import open_recording
from measured_command import run
import pytest
from repeated import slow

LONGEST_S = 10.0
LARGEST_KB = 300_000
MAGIC = bytes.fromhex('d9d505f920a163d7')


NO_TABLE = 'is neither a table nor an index, and rosbag2 writes nothing else'
REASONS = {
    'endless view of messages': f'messages {NO_TABLE}', 'virtual table': f'messages {NO_TABLE}',
    'nested views': f'v0 {NO_TABLE}', 'computed column': 'column data of messages is computed',
    'another database': 'no such table: messages',
    'many tables': 'its schema has thousands of entries'}
"""Why those that are no databases of rosbag2 are not read."""


@pytest.mark.parametrize(('name', 'verb'), [
    *((name, 'analyze') for name in HOSTILE), ('many topics', 'info'), slow('many types', 'info')])
def test_a_hostile_database_costs_the_process_little_time_and_memory(tmp_path, name, verb):
    path = HOSTILE[name](tmp_path)
    before = sorted(tmp_path.iterdir()), path.stat().st_mtime_ns
    status, out, err, seconds, kilobytes = run(verb, path, '--no-progress')
    assert status in (0, 1), err
    assert err.count('\n') == status, err
    if name in REASONS:
        assert err == f'imu_allan: {path}: not a readable rosbag2 database ({REASONS[name]})\n'
    assert len(err) + len(out) < 30_000
    assert seconds < LONGEST_S
    assert kilobytes < LARGEST_KB
    assert (sorted(tmp_path.iterdir()), path.stat().st_mtime_ns) == before


def test_topics_beyond_those_of_any_robot_are_not_listed_but_reported(tmp_path):
    path = HOSTILE['many topics'](tmp_path)
    with open_recording(path) as recording:
        assert len(recording.topics) == 65_536
        assert recording.remarks == [said(path, 'many_topics', what='topics', listed=65_536)]


def test_messages_of_more_bytes_than_the_file_are_read_no_further(tmp_path):
    path = HOSTILE['default values'](tmp_path)
    with open_recording(path) as recording:
        assert not list(recording.decoded('/imu'))
        assert recording.remarks == [said(
            path, 'damaged_recording', fault='database', places=1, read=0, topic='/imu',
            reason='its messages have more bytes than the file')]


def killed_in_a_transaction(folder: Path) -> Path:
    """Return a database with the journal of an unfinished transaction beside it."""
    (folder / 'written').mkdir()
    path = write_db3(folder / 'written' / 'a.db3', block(5000))
    database = sqlite3.connect(path)
    database.execute('PRAGMA cache_size = 5')
    database.execute('BEGIN')
    database.execute('DELETE FROM messages WHERE id < 1000')
    killed = folder / 'killed'
    killed.mkdir()
    for name in ('a.db3', 'a.db3-journal'):
        shutil.copy(folder / 'written' / name, killed / name)
    database.rollback()
    database.close()
    return killed / 'a.db3'


def super_journal(named: Path) -> bytes:
    """Return the end of a journal that names another file."""
    name = os.fsencode(named)
    checksum = sum(name) & 0xffffffff
    return (name + len(name).to_bytes(4, 'big') + checksum.to_bytes(4, 'big') + MAGIC)


def test_no_file_that_a_journal_names_is_deleted(tmp_path):
    victim = tmp_path / 'precious'
    victim.write_bytes(b'anything at all')
    path = killed_in_a_transaction(tmp_path)
    journal = path.with_name('a.db3-journal')
    # The name of SQLite's lock page stands before it, as SQLite writes it.
    journal.write_bytes(journal.read_bytes() + (1).to_bytes(4, 'big') + super_journal(victim))
    before = files_in(path.parent)
    status, _, err, _, _ = run('analyze', path, '--no-progress')
    assert (status, err) == (0, '')
    assert victim.exists()
    assert files_in(path.parent) == before
    after, [remark, *_] = read(path)
    assert len(after) > 3000
    assert remark == said(path, 'unfinished_recording', fault='unusable', file='a.db3-journal',
                          reason='rosbag2 leaves none')
    assert victim.exists()
    # SQLite itself carries the attack out.
    with sqlite3.connect(path) as database:
        database.execute('SELECT count(*) FROM messages')
    database.close()
    assert not victim.exists()


@pytest.mark.parametrize('kind', ['wal', 'journal'])
@pytest.mark.parametrize('what', ['link', 'pipe', 'folder'])
def test_what_is_no_file_beside_a_database_is_not_used(tmp_path, kind, what):
    path = write_db3(tmp_path / 'a.db3', block(2000))
    victim = tmp_path / 'precious'
    victim.write_bytes(b'anything at all')
    beside = tmp_path / f'a.db3-{kind}'
    {'link': lambda: beside.symlink_to(victim), 'pipe': lambda: os.mkfifo(beside),
     'folder': beside.mkdir}[what]()
    after, [remark] = read(path)
    assert_same(block(2000), after)
    assert remark == said(path, 'unfinished_recording', fault='not_regular', file=f'a.db3-{kind}')
    assert victim.read_bytes() == b'anything at all'
