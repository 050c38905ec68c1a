# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Databases that ask for more than they hold, or for something else than reading."""

from collections.abc import Callable, Iterable
from contextlib import closing
from pathlib import Path
import sqlite3

from bags import block, IMU, write_db3

TOPICS = ('CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, '
          'serialization_format TEXT)')
MESSAGES = ('CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, '
            'data BLOB)')
ENDLESS = ('WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i AS id, '
           '1 AS topic_id, i AS timestamp, randomblob(336) AS data FROM n')


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


HOSTILE: dict[str, Callable[[Path], Path]] = {
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
