# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Databases that ask for more than they hold, or for something else than reading."""

from collections.abc import Callable, Iterable
from contextlib import closing
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


def from_script(*statements: str | tuple[str, Callable[[], Iterable[tuple[object, ...]]]],
                first: Callable[[Path], Path] | None = None) -> Callable[[Path], Path]:
    """Make a database by statements, some with rows; topic /imu is entered with its table."""
    def make(folder: Path) -> Path:
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


def written(folder: Path) -> Path:
    """Write 2000 messages."""
    return write_db3(folder / 'a.db3', block(2000))


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
    # What its columns call a table.
    'view called a table': from_script(TOPICS, MESSAGES, 'PRAGMA writable_schema = ON', (
        "UPDATE sqlite_master SET sql = ?, rootpage = 0 WHERE name = 'messages'",
        lambda: [('CREATE VIEW messages AS ' + ENDLESS,)])),
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
    'virtual table of text': from_script(
        MESSAGES, 'CREATE VIRTUAL TABLE topics USING fts4(id, name, type, serialization_format)'),
    'no numbers': from_script(
        TOPICS, 'CREATE TABLE messages(id TEXT PRIMARY KEY, topic_id, timestamp, data) '
        'WITHOUT ROWID'),
    'many tables': from_script(TOPICS, MESSAGES, 'PRAGMA writable_schema = ON', (
        "INSERT INTO sqlite_master VALUES ('table', ?, ?, 2, ?)",
        lambda: ((f't{n}', f't{n}', f'CREATE TABLE t{n}(a, b, c)') for n in range(200_000)))),
    # A statement of 20 MB.
    'long schema': from_script(TOPICS, MESSAGES, 'PRAGMA writable_schema = ON', (
        "INSERT INTO sqlite_master VALUES ('table', 't', 't', 2, ?)",
        lambda: [('CREATE TABLE t(a DEFAULT (' + '1+' * 10_000_000 + '1))',)])),
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
    'messages that follow themselves': followed_by_itself('messages'),
    'topics that follow themselves': followed_by_itself('topics'),
    'shared leaves': shared_leaves,
}
