# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""rosbag2 databases: whole, unfinished, damaged, made to cost time, memory or files."""

from contextlib import closing
import os
import shutil
import sqlite3

import bags
from bags import assert_same, block, files_in, IMU, read, said, serialized, write_db3
from imu_allan.recordings import open_recording
import numpy as np
from processes import run
import pytest

WHOLE = block(5000)
TOPICS = ('CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, '
          'serialization_format TEXT)')
MESSAGES = ('CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, '
            'data BLOB)')
ENDLESS = ('WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i AS id, '
           '1 AS topic_id, i AS timestamp, randomblob(336) AS data FROM n')


def test_every_bit_of_the_old_schema_is_read_in_order_even_where_stamps_go_back(tmp_path):
    shuffled = WHOLE.part(np.random.default_rng(1).permutation(5000))
    folder = tmp_path / 'a b?c#d%20ä\nx'
    folder.mkdir()
    path = write_db3(folder / 'q&r=1.db3', shuffled, [('/chatter', 'std_msgs/msg/String')])
    with open_recording(path) as recording:
        assert [(topic.name, topic.count) for topic in recording.topics] == [('/imu', None)]
        assert recording.other_topics == {'/chatter': 'std_msgs/msg/String'}
    after, remarks = read(path)
    assert_same(shuffled, after)
    assert remarks == []


@pytest.mark.parametrize('writable', [True, False])
def test_what_a_killed_recorder_left_in_the_write_ahead_log_is_read(tmp_path, writable):
    path = write_db3(tmp_path / 'a.db3', WHOLE)
    database = sqlite3.connect(path)
    database.execute('PRAGMA journal_mode = WAL')
    database.execute('PRAGMA wal_autocheckpoint = 0')
    database.execute('DELETE FROM messages WHERE id > 4000')
    bags.insert(database, serialized(block(100, first=4000)))
    database.commit()
    killed = tmp_path / 'killed'
    killed.mkdir()
    for name in ('a.db3', 'a.db3-wal'):
        shutil.copy(tmp_path / name, killed / name)
    database.close()
    before = files_in(killed)
    killed.chmod(0o755 if writable else 0o555)
    try:
        after, remarks = read(killed / 'a.db3')
    finally:
        killed.chmod(0o755)
    assert_same(block(4100), after)
    assert remarks == []
    assert files_in(killed) == before


@pytest.mark.parametrize('share', [0.1, 0.999])
def test_a_truncated_database_gives_what_is_there(tmp_path, share):
    path = write_db3(tmp_path / 'a.db3', WHOLE)
    whole = path.read_bytes()
    left = int(len(whole) * share)
    path.write_bytes(whole[:left])
    after, remarks = read(path)
    assert_same(block(len(after)), after)
    assert len(after) > 5000 * share * 0.85
    assert remarks[0] == said(path, 'truncated_recording', fault='database',
                              missing_bytes=len(whole) - left, bytes=len(whole),
                              severity='act' if share < 0.5 else 'know')
    assert all(one.values['read'] == len(after) for one in remarks[1:])


@pytest.mark.parametrize(('share', 'severity'), [(0.3, 'act'), (0.7, 'know')])
def test_messages_before_a_damaged_page_are_read(tmp_path, share, severity):
    path = write_db3(tmp_path / 'a.db3', WHOLE)
    data = bytearray(path.read_bytes())
    place = int(len(data) * share) // 4096 * 4096
    data[place:place + 4096] = b'\xff' * 4096
    path.write_bytes(data)
    after, [remark] = read(path)
    assert_same(block(len(after)), after)
    assert 5000 * (share - 0.05) < len(after) < 5000 * (share + 0.05)
    assert remark == said(path, 'damaged_recording', fault='database', read=len(after),
                          topic='/imu', reason=remark.values['reason'], severity=severity)


def test_columns_of_the_wrong_type_are_malformed_messages(tmp_path):
    path = write_db3(tmp_path / 'a.db3', block(4))
    with closing(sqlite3.connect(path)) as database:
        database.executescript(
            'CREATE TABLE m(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp, data);'
            'INSERT INTO m SELECT * FROM messages; DROP TABLE messages;'
            'ALTER TABLE m RENAME TO messages;'
            "INSERT INTO messages VALUES (5, 1, 5, 'text'), (6, 1, 6, NULL), (7, 1, 'x', 1.5);"
            "INSERT INTO messages SELECT 8, 1, 'no time', data FROM messages WHERE id = 4;")
    after, [remark] = read(path)
    assert after.receive_ns.tolist() == [*block(4).receive_ns.tolist(), 0]
    assert_same(block(4), after.part(slice(4)))
    assert remark == said(path, 'malformed_messages', what='message', count=3, topic='/imu',
                          type='sensor_msgs/Imu', first='not a blob')


def from_script(*statements, first=None):
    """Make a database by statements, some with rows; topic /imu is entered with its table."""
    def make(folder):
        path = folder / 'a.db3' if first is None else first(folder)
        with closing(sqlite3.connect(path)) as database:
            for statement in statements:
                if isinstance(statement, str):
                    database.execute(statement)
                else:
                    database.executemany(statement[0], statement[1]())
                if statement == TOPICS:
                    database.execute(f"INSERT INTO topics VALUES (1, '/imu', '{IMU}', 'cdr')")
            database.commit()
        return path
    return make


def written(folder):
    return write_db3(folder / 'a.db3', block(2000))


HOSTILE = {
    'endless view of messages': from_script(TOPICS, f'CREATE VIEW messages AS {ENDLESS}'),
    'endless view of topics': from_script(MESSAGES, (
        'CREATE VIEW topics AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) '
        f"SELECT i AS id, '/' || i AS name, '{IMU}' AS type, 'cdr' AS serialization_format "
        'FROM n')),
    'nested views': from_script(TOPICS, MESSAGES, 'CREATE VIEW v0 AS SELECT * FROM messages', *(
        f'CREATE VIEW v{level} AS SELECT a.id FROM v{level - 1} a, v{level - 1} b'
        for level in range(1, 40))),
    'computed column': from_script(
        TOPICS, 'CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp '
        'INTEGER, data AS (zeroblob(900000000)))',
        'INSERT INTO messages(topic_id, timestamp) VALUES (1, 1), (1, 2), (1, 3)'),
    'another database': from_script('CREATE TABLE birds(name TEXT)'),
    'virtual table': from_script(
        TOPICS, 'CREATE VIRTUAL TABLE messages USING rtree(id, timestamp, until, +topic_id, '
        '+data)'),
    'many tables': from_script(TOPICS, MESSAGES, 'PRAGMA writable_schema = ON', (
        "INSERT INTO sqlite_master VALUES ('table', ?, ?, 2, ?)",
        lambda: ((f't{n}', f't{n}', f'CREATE TABLE t{n}(a, b, c)') for n in range(200_000)))),
    # Each with a message.
    'many topics': from_script(
        TOPICS, MESSAGES,
        ("INSERT INTO topics VALUES (?, ?, ?, 'cdr')",
         lambda: ((n, f'/imu{n}', IMU) for n in range(2, 100_000))),
        ("INSERT INTO messages VALUES (?, ?, ?, x'')",
         lambda: ((n, n, n) for n in range(2, 100_000)))),
    # Each of a type of its own that holds an Imu.
    'many types': from_script(
        TOPICS, MESSAGES, 'CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type '
        'TEXT, encoding TEXT, encoded_message_definition TEXT)',
        ("INSERT INTO topics VALUES (?, ?, ?, 'cdr')",
         lambda: ((n, f'/imu{n}', f'a_msgs/msg/T{n}') for n in range(2, 100_002))),
        ("INSERT INTO message_definitions VALUES (?, ?, 'ros2msg', 'sensor_msgs/Imu imu')",
         lambda: ((n, f'a_msgs/msg/T{n}') for n in range(2, 100_002)))),
    'one topic of many numbers': from_script(
        ("INSERT INTO topics VALUES (?, '/imu', ?, 'cdr')",
         lambda: ((n, IMU) for n in range(2, 100_000))), first=written),
    'large blobs': from_script(
        ('INSERT INTO messages VALUES (?, 1, ?, zeroblob(2000000))',
         lambda: ((n, n) for n in range(3000, 3064))), first=written),
    # Every row leaves out a column whose default is long.
    'default values': from_script(
        TOPICS, 'CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp '
        'INTEGER)', ('INSERT INTO messages VALUES (?, 1, ?)',
                     lambda: ((n, n) for n in range(100_000))),
        f"ALTER TABLE messages ADD COLUMN data DEFAULT x'{'00' * 45_000}'"),
}
REASONS = {'another database': 'no such table: messages'}
"""Why those that are no databases of rosbag2 are not read."""


@pytest.mark.parametrize(('name', 'verb'), [
    *((name, 'analyze' if name in ('many types', 'many topics') else 'info') for name in HOSTILE)])
def test_a_hostile_database_costs_the_process_little_time_and_memory(tmp_path, name, verb):
    path = HOSTILE[name](tmp_path)
    before = sorted(tmp_path.iterdir()), path.stat().st_mtime_ns
    status, out, err = run(verb, path, '--no-progress')
    assert status in (0, 1), err
    assert err.count('\n') == status, err
    if name in REASONS:
        assert err == f'imu_allan: {path}: not a readable rosbag2 database ({REASONS[name]})\n'
    assert len(err) + len(out) < 30_000
    assert (sorted(tmp_path.iterdir()), path.stat().st_mtime_ns) == before


def test_messages_of_more_bytes_than_the_file_are_read_no_further(tmp_path):
    path = HOSTILE['default values'](tmp_path)
    with open_recording(path) as recording:
        assert not list(recording.decoded('/imu'))
        remark = recording.remarks[0]
        assert remark.values['read'] <= 512
        assert remark == said(
            path, 'damaged_recording', fault='database', read=remark.values['read'], topic='/imu',
            reason='its messages have more bytes than the file', severity='act')
        assert [one.code for one in recording.remarks] == [
            'damaged_recording', 'malformed_messages']


def test_no_file_that_a_journal_names_is_deleted(tmp_path):
    written, killed, victim = (tmp_path / name for name in ('written', 'killed', 'precious'))
    written.mkdir()
    victim.write_bytes(b'anything at all')
    # The recorder is killed within a transaction.
    with closing(sqlite3.connect(write_db3(written / 'a.db3', WHOLE))) as database:
        database.execute('PRAGMA cache_size = 5')
        database.execute('BEGIN')
        database.execute('DELETE FROM messages WHERE id > 4000')
        shutil.copytree(written, killed)
    path, name = killed / 'a.db3', os.fsencode(victim)
    with (killed / 'a.db3-journal').open('ab') as journal:
        # The name of SQLite's lock page stands before that of the file, as SQLite writes it.
        journal.write((1).to_bytes(4, 'big') + name + len(name).to_bytes(4, 'big')
                      + sum(name).to_bytes(4, 'big') + bytes.fromhex('d9d505f920a163d7'))
    before = files_in(killed)
    after, [remark, *_] = read(path)
    assert len(after) > 3000
    assert remark == said(path, 'unfinished_recording', fault='unusable', file='a.db3-journal',
                          reason='rosbag2 leaves none')
    assert victim.read_bytes() == b'anything at all'
    assert files_in(killed) == before
    # SQLite itself carries the attack out.
    with closing(sqlite3.connect(path)) as database:
        database.execute('SELECT count(*) FROM messages')
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
