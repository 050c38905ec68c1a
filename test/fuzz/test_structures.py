# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings made wrong on purpose rather than damaged: schemas, logs, definitions."""

from contextlib import suppress
from pathlib import Path
import sqlite3
import tempfile
import time

from bags import block, files_in, IMU, write_db3
from imu_allan.cdr import encode_imu_rows, MessageBatch
from imu_allan.errors import ImuAllanError
from imu_allan.recordings import RecordingOptions
from imu_allan.recordings.messages.definitions import Definition
from imu_allan.recordings.messages.imus_in import imus_in
from mutations import each, EXTREMES, LONGEST_S, mutated_bytes, read_in_part, rounds, TEXTS
import numpy as np
from other_types import full_definition, imu, stamped, store_with
import pytest

MESSAGES = block(60)
ROWS = [row.tobytes() for row in encode_imu_rows(MESSAGES)]
BILLIONS = ('WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i+1 FROM n) SELECT i AS id, '
            '1 AS topic_id, i AS timestamp, zeroblob(336) AS data FROM n')
COLUMNS = {'topics': 'id INTEGER PRIMARY KEY, name, type, serialization_format',
           'messages': 'id INTEGER PRIMARY KEY, topic_id, timestamp, data',
           'message_definitions': 'id, topic_type, encoding, encoded_message_definition'}
KINDS = ['', '', '', 'INTEGER', 'TEXT UNIQUE', 'BLOB NOT NULL', 'REAL', 'TEXT COLLATE NOCASE',
         "DEFAULT x'00'", 'DEFAULT (randomblob(100))', 'AS (zeroblob(500000000))',
         "AS (printf('%.*c', 300000000, 'x')) STORED", 'CHECK (length(data) > 0)']
OTHERS = [*(f'CREATE VIEW {{name}} AS SELECT {query}' for query in (
              '* FROM {other}', '* FROM {other} a, {other} b, {other} c', '* FROM v',
              f"1 AS id, '/imu' AS name, '{IMU}' AS type, 'cdr' AS serialization_format",
              f'* FROM ({BILLIONS})', "value FROM json_each('[1,2]')")),
          *(f'CREATE VIRTUAL TABLE {{name}} USING {module}' for module in (
              'rtree(id, timestamp, until, +topic_id, +data)', 'fts5(name, type)', 'dbstat',
              'fts4(id, topic_id, timestamp, data)', 'nonsense(1)')),
          'CREATE TEMP TABLE {name}(id)', 'ALTER TABLE {other} RENAME TO {name}',
          'CREATE INDEX i ON messages(hex(data))', "ALTER TABLE {name} ADD COLUMN e DEFAULT 'x'",
          'CREATE TRIGGER k AFTER INSERT ON messages BEGIN SELECT 1; END', 'DROP TABLE {name}',
          "UPDATE sqlite_master SET sql = 'x' WHERE name = '{name}'",
          "UPDATE sqlite_master SET rootpage = 3 WHERE name = '{name}'",
          "UPDATE sqlite_master SET name = '{other}' WHERE name = '{name}'"]
STORE = store_with({'a/msg/F': 'std_msgs/Header header\nstring[] names\nsensor_msgs/Imu[2] imus\n'
                               'float32[<=4] rest\n'})
DEFINITION = full_definition(STORE, 'a/msg/F')
MESSAGE = bytes(STORE.serialize_cdr(STORE.types['a/msg/F'](
    stamped(STORE, 1), ['a', 'bc'], [imu(STORE, 1), imu(STORE, 2)], np.ones(3, np.float32)),
    'a/msg/F'))
PATHS = ('imus[0].angular_velocity', 'rest[0:3]', 'header.stamp.sec,rest[0],rest[1]', 'names[0]')


def value(choice):
    return choice.choice([
        None, 1, 2, 'text', b'', 1.5, choice.choice(ROWS), choice.choice(ROWS)[:-8], b'x' * 70_000,
        choice.choice(TEXTS), min(choice.choice(EXTREMES), 2**63 - 1), -1, 'cdr', IMU, '/imu'])


def hostile_database(folder, choice):
    """Make a database out of statements of which any may fail."""
    path = folder / 'a.db3'
    database = sqlite3.connect(path)
    attempt(database, 'PRAGMA writable_schema = ON')
    for name, columns in COLUMNS.items():
        kinds = [f'{column} {choice.choice(KINDS) if choice.random() < .1 else ""}'
                 for column in columns.split(', ') if choice.random() > .02]
        text = f'CREATE TABLE {name}({", ".join(kinds)}){choice.choice(["", "", " STRICT"])}'
        attempt(database, choice.choice(OTHERS).format(
            name=name, other=choice.choice([*COLUMNS])) if choice.random() < .1 else text)
    attempt(database, f"INSERT INTO topics VALUES (1, '/imu', '{IMU}', 'cdr')")
    for _ in range(choice.randrange(60)):
        attempt(database, 'INSERT INTO messages VALUES (NULL, 1, ?, ?)', (
            choice.randrange(10**18), choice.choice(ROWS)))
        attempt(database, f'INSERT INTO {choice.choice([*COLUMNS])} VALUES (?, ?, ?, ?)',
                [value(choice) for _ in range(4)])
    for _ in range(choice.randrange(3)):
        attempt(database, choice.choice(OTHERS).format(
            name=choice.choice([*COLUMNS]), other=choice.choice([*COLUMNS])))
    database.commit()
    database.close()
    return path


def attempt(database, statement, values=()):
    # What is made by chance need not be possible.
    database.set_progress_handler(lambda: True, 3_000_000)
    with suppress(sqlite3.Error, UnicodeEncodeError, OverflowError):
        database.execute(statement, values).fetchmany(1)


def judge_schema(choice):
    with tempfile.TemporaryDirectory() as folder:
        path = hostile_database(Path(folder), choice)
        before = sorted(Path(folder).iterdir())
        read_in_part(path)
        assert sorted(Path(folder).iterdir()) == before


def judge_log(choice):
    """Put a write-ahead log whose parts are anything beside a database."""
    with tempfile.TemporaryDirectory() as folder:
        path = write_db3(Path(folder) / 'a.db3', MESSAGES)
        pages = b''.join(choice.randrange(path.stat().st_size // 4096 + 2).to_bytes(4, 'big')
                         + choice.randbytes(20).ljust(4116, b'\0')
                         for _ in range(choice.randrange(4)))
        (Path(folder) / 'a.db3-wal').write_bytes(
            bytes.fromhex('377f0682 002de218 00001000') + choice.randbytes(20) + pages)
        before = files_in(Path(folder))
        read_in_part(path)
        assert files_in(Path(folder)) == before


def judge_decoding(text, message, options):
    """Require blocks, or one line."""
    began = time.process_time()
    try:
        for messages in imus_in('/imu', 'a/msg/F', 'cdr', Definition(text), options).values():
            blocks = messages.decoder()(
                [MessageBatch(np.frombuffer(message, np.uint8)[None], np.zeros(1, np.int64))],
                lambda *_: None)
            assert all(part.samples.shape == (len(part), 6) for part in blocks)
    except ImuAllanError as error:
        assert str(error).isprintable()
        assert len(str(error)) < 1000
    assert time.process_time() - began < LONGEST_S


def judge_fields(choice):
    """Damage the definition of a message, the message, or the path of a field of it."""
    parts = [DEFINITION.encode(), MESSAGE, choice.choice(PATHS).encode()]
    damaged = choice.randrange(3)
    parts[damaged] = mutated_bytes(parts[damaged], choice) or b'?'
    judge_decoding(parts[0].decode('utf-8', 'replace'), parts[1], RecordingOptions(
        gyro=parts[2].decode('utf-8', 'replace'), accel='imus[1].linear_acceleration'))


@pytest.mark.parametrize('judge', [judge_schema, judge_log, judge_fields])
@rounds(40)
def test_what_is_made_wrong_is_refused_or_read_in_part(judge, count, seed):
    each(count, seed, judge)


@pytest.mark.parametrize('parts', [
    ['a/msg/F f'], ['a/A a[2]', 'MSG: a/A\na/B[] b', 'MSG: a/B\na/A a']])
def test_types_in_a_circle_are_refused_or_read(parts):
    text = ('\n' + '=' * 80 + '\n').join([f'sensor_msgs/Imu imu\n{parts[0]}', *parts[1:]])
    judge_decoding(text, b'\0\1\0\0' + ROWS[0][4:] * 2, RecordingOptions())
