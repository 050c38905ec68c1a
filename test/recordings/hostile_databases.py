# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Databases that ask for more than they hold, or for something else than reading."""

from collections.abc import Callable
from pathlib import Path
import sqlite3
import struct

from bags import block, IMU, write_db3

TOPICS = ('CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, '
          'serialization_format TEXT)')
MESSAGES = ('CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, '
            'data BLOB)')
ENDLESS = ('WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i AS id, '
           '1 AS topic_id, i AS timestamp, randomblob(336) AS data FROM n')
PAGE = 4096
OVERFLOWING = 1_000_000_000


def from_script(*statements: str) -> Callable[[Path], Path]:
    """Make a database by statements; a topic /imu is entered where its table is plain."""
    def make(folder: Path) -> Path:
        path = folder / 'a.db3'
        with sqlite3.connect(path) as database:
            for statement in statements:
                database.execute(statement)
            if TOPICS in statements:
                database.execute(f"INSERT INTO topics VALUES (1, '/imu', '{IMU}', 'cdr')")
        database.close()
        return path
    return make


def disguised_view(folder: Path) -> Path:
    """Enter an endless view into the schema as what its columns call a table."""
    path = from_script(TOPICS, MESSAGES)(folder)
    with sqlite3.connect(path) as database:
        database.execute('PRAGMA writable_schema = ON')
        database.execute("UPDATE sqlite_master SET sql = ?, rootpage = 0 WHERE name = 'messages'",
                         ('CREATE VIEW messages AS ' + ENDLESS,))
    database.close()
    return path


def many_tables(folder: Path) -> Path:
    """Make a schema of 200,000 tables."""
    path = from_script(TOPICS, MESSAGES)(folder)
    with sqlite3.connect(path) as database:
        database.execute('PRAGMA writable_schema = ON')
        database.executemany(
            "INSERT INTO sqlite_master VALUES ('table', ?, ?, 2, ?)",
            ((f't{number}', f't{number}', f'CREATE TABLE t{number}(a, b, c)')
             for number in range(200_000)))
    database.close()
    return path


def long_schema(folder: Path) -> Path:
    """Make a schema with a statement of 20 MB."""
    path = from_script(TOPICS, MESSAGES)(folder)
    with sqlite3.connect(path) as database:
        database.execute('PRAGMA writable_schema = ON')
        database.execute("INSERT INTO sqlite_master VALUES ('table', 't', 't', 2, ?)",
                         ('CREATE TABLE t(a DEFAULT (' + '1+' * 10_000_000 + '1))',))
    database.close()
    return path


def many_topics(folder: Path) -> Path:
    """Make 100,000 Imu topics, each with a message."""
    path = from_script(TOPICS, MESSAGES)(folder)
    with sqlite3.connect(path) as database:
        database.executemany('INSERT INTO topics VALUES (?, ?, ?, ?)', (
            (number, f'/imu{number}', IMU, 'cdr') for number in range(2, 100_000)))
        database.executemany('INSERT INTO messages VALUES (?, ?, ?, ?)', (
            (number, number, number, b'') for number in range(2, 100_000)))
    database.close()
    return path


def many_types(folder: Path) -> Path:
    """Make 100,000 topics, each of a type of its own that holds an Imu."""
    path = from_script(
        TOPICS, MESSAGES, 'CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type '
        'TEXT, encoding TEXT, encoded_message_definition TEXT)')(folder)
    with sqlite3.connect(path) as database:
        for number in range(2, 100_002):
            kind = f'a_msgs/msg/T{number}'
            database.execute("INSERT INTO topics VALUES (?, ?, ?, 'cdr')",
                             (number, f'/imu{number}', kind))
            database.execute("INSERT INTO message_definitions VALUES (?, ?, 'ros2msg', ?)",
                             (number, kind, 'sensor_msgs/Imu imu'))
    database.close()
    return path


def one_topic_of_many_numbers(folder: Path) -> Path:
    """Enter the topic /imu 100,000 times."""
    path = write_db3(folder / 'a.db3', block(2000))
    with sqlite3.connect(path) as database:
        database.executemany('INSERT INTO topics VALUES (?, ?, ?, ?)', (
            (number, '/imu', IMU, 'cdr') for number in range(2, 100_000)))
    database.close()
    return path


def large_blobs(folder: Path) -> Path:
    """Store 64 messages of 2 MB among others."""
    path = write_db3(folder / 'a.db3', block(2000))
    with sqlite3.connect(path) as database:
        database.executemany('INSERT INTO messages VALUES (?, 1, ?, zeroblob(2000000))', (
            (number, number) for number in range(3000, 3064)))
    database.close()
    return path


def default_values(folder: Path) -> Path:
    """Leave out of every row a column whose default is long."""
    path = from_script(TOPICS, 'CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, '
                       'timestamp INTEGER)')(folder)
    with sqlite3.connect(path) as database:
        database.executemany('INSERT INTO messages VALUES (?, 1, ?)', (
            (number, number) for number in range(100_000)))
        database.execute(
            f"ALTER TABLE messages ADD COLUMN data DEFAULT x'{'00' * 45_000}'")
    database.close()
    return path


def followed_by_itself(table: str) -> Callable[[Path], Path]:
    """Make rows of a gigabyte each, whose overflow page follows itself."""
    def make(folder: Path) -> Path:
        path = folder / 'a.db3'
        with sqlite3.connect(path) as database:
            database.execute(f'PRAGMA page_size = {PAGE}')
            database.execute(TOPICS)
            database.execute(MESSAGES)
            if table == 'messages':
                database.execute(f"INSERT INTO topics VALUES (1, '/imu', '{IMU}', 'cdr')")
                database.executemany('INSERT INTO messages VALUES (?, 1, ?, ?)', (
                    (number, number, b'x' * 20_000) for number in range(1, 40)))
            else:
                database.executemany("INSERT INTO topics VALUES (?, ?, ?, 'cdr')", (
                    (number, 'x' * 20_000, IMU) for number in range(1, 40)))
        database.close()
        data = bytearray(path.read_bytes())
        # The cell of a row: bytes of payload, row number, head of the row, payload, next page.
        for page in range(1, len(data) // PAGE):
            at = page * PAGE
            if data[at] != 13:
                continue
            for cell in range(struct.unpack_from('>H', data, at + 3)[0]):
                [place] = struct.unpack_from('>H', data, at + 8 + 2 * cell)
                start = at + place
                payload, after = varint(data, start)
                if payload < 20_000:
                    continue
                _, head = varint(data, after)
                longer(data, start, head, after, payload)
        path.write_bytes(data)
        return path
    return make


def longer(data: bytearray, start: int, head: int, after: int, payload: int) -> None:
    """Let a row declare a gigabyte, and its first overflow page follow itself."""
    grown = encoded(OVERFLOWING, after - start)
    if grown is None:
        # Three bytes hold up to two million: seven times what is there.
        grown = encoded(2_000_000, after - start)
    assert grown is not None
    data[start:after] = grown
    least = (PAGE - 12) * 32 // 255 - 23
    usable = least + (payload - least) % (PAGE - 4)
    held = usable if usable <= PAGE - 35 else least
    [overflow] = struct.unpack_from('>I', data, head + held)
    if 0 < overflow <= len(data) // PAGE:
        struct.pack_into('>I', data, (overflow - 1) * PAGE, overflow)


def encoded(value: int, length: int) -> bytes | None:
    """Encode a variable integer in so many bytes."""
    if value >> 7 * length:
        return None
    digits = [value >> 7 * place & 127 for place in reversed(range(length))]
    return bytes([digit | 128 for digit in digits[:-1]] + digits[-1:])


def varint(data: bytearray, at: int) -> tuple[int, int]:
    """Decode a variable integer; returns it and the place behind it."""
    value = 0
    for place in range(9):
        value = value << 7 | data[at + place] & 127
        if data[at + place] < 128:
            break
    return value, at + place + 1


def shared_leaves(folder: Path) -> Path:
    """Let all branches of the tree of messages lead to the same leaf, three levels deep."""
    path = write_db3(folder / 'a.db3', block(100))
    with sqlite3.connect(path) as database:
        [[root]] = database.execute("SELECT rootpage FROM sqlite_master WHERE name = 'messages'")
        # Of another topic: none of the rows is asked for.
        database.execute('UPDATE messages SET topic_id = 2')
    database.close()
    data = bytearray(path.read_bytes())
    pages = len(data) // PAGE
    [leaf] = struct.unpack_from('>I', data, (root - 1) * PAGE + 8)
    for level in range(3):
        branch = bytearray(PAGE)
        cells = 300
        child = leaf if level == 0 else pages + level
        struct.pack_into('>BHHHBI', branch, 0, 5, 0, cells, PAGE - 8 * cells, 0, child)
        for cell in range(cells):
            place = PAGE - 8 * (cell + 1)
            struct.pack_into('>H', branch, 12 + 2 * cell, place)
            struct.pack_into('>IB', branch, place, child, cell % 127)
        data += branch
    data[(root - 1) * PAGE:root * PAGE] = data[-PAGE:]
    struct.pack_into('>I', data, 28, len(data) // PAGE)
    path.write_bytes(data)
    return path


HOSTILE: dict[str, Callable[[Path], Path]] = {
    'endless view of messages': from_script(TOPICS, f'CREATE VIEW messages AS {ENDLESS}'),
    'endless view of topics': from_script(MESSAGES, (
        'CREATE VIEW topics AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) '
        f"SELECT i AS id, '/' || i AS name, '{IMU}' AS type, 'cdr' AS serialization_format "
        'FROM n')),
    'view called a table': disguised_view,
    'nested views': from_script(TOPICS, MESSAGES, 'CREATE VIEW v0 AS SELECT * FROM messages', *(
        f'CREATE VIEW v{level} AS SELECT a.id FROM v{level - 1} a, v{level - 1} b'
        for level in range(1, 40))),
    'computed column': from_script(
        TOPICS, 'CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp '
        'INTEGER, data AS (zeroblob(900000000)))',
        'INSERT INTO messages(topic_id, timestamp) VALUES (1, 1), (1, 2), (1, 3)'),
    'virtual table': from_script(
        TOPICS, 'CREATE VIRTUAL TABLE messages USING rtree(id, timestamp, until, +topic_id, '
        '+data)'),
    'virtual table of text': from_script(
        MESSAGES, 'CREATE VIRTUAL TABLE topics USING fts4(id, name, type, serialization_format)'),
    'no numbers': from_script(
        TOPICS, 'CREATE TABLE messages(id TEXT PRIMARY KEY, topic_id, timestamp, data) '
        'WITHOUT ROWID'),
    'many tables': many_tables,
    'long schema': long_schema,
    'many topics': many_topics,
    'many types': many_types,
    'one topic of many numbers': one_topic_of_many_numbers,
    'large blobs': large_blobs,
    'default values': default_values,
    'messages that follow themselves': followed_by_itself('messages'),
    'topics that follow themselves': followed_by_itself('topics'),
    'shared leaves': shared_leaves,
}
