# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""rosbag2 databases, whole, unfinished and damaged."""

import shutil
import sqlite3

from bags import (
    assert_same,
    block,
    files_in,
    insert,
    joined,
    read,
    refusal,
    said,
    serialized,
    write_db3,
)
from imu_allan.recordings import open_recording
import numpy as np
import pytest

MESSAGES = block(5000)


def test_every_bit_of_the_old_schema_is_read_in_order_even_where_stamps_go_back(tmp_path):
    shuffled = MESSAGES.part(np.random.default_rng(1).permutation(5000))
    folder = tmp_path / 'a b?c#d%20ä\nx'
    folder.mkdir()
    path = write_db3(folder / 'q&r=1.db3', shuffled, [('/chatter', 'std_msgs/msg/String')])
    with open_recording(path) as recording:
        assert [(topic.name, topic.count) for topic in recording.topics] == [('/imu', None)]
        assert recording.other_topics == {'/chatter': 'std_msgs/msg/String'}
    after, remarks = read(path)
    assert_same(shuffled, after)
    assert remarks == []


def test_messages_of_differing_size_are_read_in_order(tmp_path):
    path = write_db3(tmp_path / 'a.db3', block(10))
    parts = [block(10), block(3, 'a_much_longer_frame_id', 10), block(700, first=13)]
    with sqlite3.connect(path) as database:
        for part in parts[1:]:
            insert(database, serialized(part))
    after, _ = read(path)
    assert after.receive_ns.tolist() == joined(parts).receive_ns.tolist()
    assert after.samples.tobytes() == joined(parts).samples.tobytes()


@pytest.mark.parametrize('writable', [True, False])
def test_what_a_killed_recorder_left_in_the_write_ahead_log_is_read(tmp_path, writable):
    path = write_db3(tmp_path / 'a.db3', MESSAGES)
    database = sqlite3.connect(path)
    database.execute('PRAGMA journal_mode = WAL')
    database.execute('PRAGMA wal_autocheckpoint = 0')
    database.execute('DELETE FROM messages WHERE id > 4000')
    insert(database, serialized(block(100, first=4000)))
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
    path = write_db3(tmp_path / 'a.db3', MESSAGES)
    whole = path.read_bytes()
    left = int(len(whole) * share)
    path.write_bytes(whole[:left])
    after, remarks = read(path)
    assert_same(block(len(after)), after)
    assert len(after) > 5000 * share * 0.9
    assert remarks[0] == said(path, 'truncated_recording', fault='database',
                              missing_bytes=len(whole) - left, bytes=len(whole))


def test_messages_behind_a_damaged_page_are_read(tmp_path):
    path = write_db3(tmp_path / 'a.db3', MESSAGES)
    data = bytearray(path.read_bytes())
    middle = len(data) // 2 // 4096 * 4096
    data[middle:middle + 4096] = b'\xff' * 4096
    path.write_bytes(data)
    after, [remark] = read(path)
    assert 4960 < len(after) < 5000
    assert after.receive_ns[[0, -1]].tolist() == MESSAGES.receive_ns[[0, -1]].tolist()
    assert np.isin(after.samples[:, 0], MESSAGES.samples[:, 0]).all()
    assert remark == said(path, 'damaged_recording', fault='database', places=1, read=len(after),
                          topic='/imu', reason=remark.values['reason'])


def test_pages_that_lead_back_give_no_message_twice(tmp_path):
    path = write_db3(tmp_path / 'a.db3', MESSAGES)
    with sqlite3.connect(path) as database:
        [[root]] = database.execute("SELECT rootpage FROM sqlite_master WHERE name = 'messages'")
    database.close()
    data, page = bytearray(path.read_bytes()), (root - 1) * 4096
    # Of two cells next to each other, both lead to the first's child.
    first, second = (page + int.from_bytes(data[page + at:page + at + 2], 'big')
                     for at in (12, 14))
    data[second:second + 4] = data[first:first + 4]
    path.write_bytes(data)
    after, _ = read(path)
    assert (np.diff(after.receive_ns) > 0).all()
    assert 4900 < len(after) < 5000


def test_what_is_no_database_is_refused(tmp_path):
    assert refusal(tmp_path / 'a.db3', b'SQLite format 3\0' + bytes(200)) == (
        'not a readable rosbag2 database (file is not a database)')


def test_columns_of_the_wrong_type_are_malformed_messages(tmp_path):
    path = write_db3(tmp_path / 'a.db3', block(4))
    with sqlite3.connect(path) as database:
        database.executescript(
            'CREATE TABLE m(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp, data);'
            'INSERT INTO m SELECT * FROM messages; DROP TABLE messages;'
            'ALTER TABLE m RENAME TO messages;'
            "INSERT INTO messages VALUES (5, 1, 5, 'text'), (6, 1, 6, NULL), (7, 1, 'x', 1.5);"
            "INSERT INTO messages SELECT 8, 1, 'no time', data FROM messages WHERE id = 4;")
    database.close()
    after, [remark] = read(path)
    assert after.receive_ns.tolist() == [*block(4).receive_ns.tolist(), 0]
    assert_same(block(4), after.part(slice(4)))
    assert remark == said(path, 'malformed_messages', what='message', count=3, topic='/imu',
                          type='sensor_msgs/Imu', first='not a blob of 1,048,576 bytes at most')
