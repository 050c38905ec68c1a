# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings made wrong on purpose rather than damaged: schemas, journals, definitions."""

from pathlib import Path
from random import Random
import sqlite3
import tempfile
import time

from bags import block, IMU, write_db3
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
KINDS = ['', 'INTEGER', 'TEXT', 'BLOB', 'REAL', 'NUMERIC', 'INTEGER NOT NULL', 'ANY',
         'INTEGER PRIMARY KEY', 'TEXT UNIQUE', 'INTEGER PRIMARY KEY DESC', 'TEXT COLLATE NOCASE',
         'DEFAULT (randomblob(100))', "DEFAULT x'00'", 'AS (zeroblob(500000000))',
         "AS (printf('%.*c', 300000000, 'x')) STORED", 'CHECK (length(data) > 0)']
QUERIES = ['SELECT * FROM {other}', 'SELECT 1 AS id, 1 AS topic_id, 1 AS timestamp, x AS data',
           'WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i+1 FROM n) SELECT i AS id, '
           '1 AS topic_id, i AS timestamp, zeroblob(336) AS data FROM n',
           "SELECT 1 AS id, '/imu' AS name, 'sensor_msgs/msg/Imu' AS type, "
           "'cdr' AS serialization_format", "SELECT value FROM json_each('[1,2]')",
           'SELECT * FROM pragma_table_info(1)', 'SELECT * FROM {other} a, {other} b, {other} c']
MODULES = ['rtree(id, a, b)', 'fts4(id, topic_id, timestamp, data)', 'fts5(name, type)', 'dbstat',
           'nonsense(1)', 'rtree(id, timestamp, until, +topic_id, +data)', 'geopoly(a)']
COLUMNS = {'topics': ['id', 'name', 'type', 'serialization_format', 'offered_qos_profiles'],
           'messages': ['id', 'topic_id', 'timestamp', 'data'],
           'message_definitions': ['id', 'topic_type', 'encoding', 'encoded_message_definition']}


def table(name: str, choice: Random) -> str:
    """Return a statement that makes something of that name, more often a table than not."""
    kind = choice.randrange(12)
    if kind == 0:
        other = choice.choice(['t', *COLUMNS])
        return f'CREATE VIEW {name} AS ' + choice.choice(QUERIES).format(other=other)
    if kind == 1:
        return f'CREATE VIRTUAL TABLE {name} USING {choice.choice(MODULES)}'
    columns = [column for column in COLUMNS[name] if choice.random() > .04]
    choice.shuffle(columns)
    text = ', '.join(
        f'{column} {choice.choice(KINDS) if choice.random() < .2 else ""}' for column in columns)
    ending = choice.choice(['', '', '', '', ' WITHOUT ROWID', ' STRICT'])
    return f'CREATE {choice.choice(["", "", "", "TEMP "])}TABLE {name}({text}){ending}'


def value(choice: Random) -> object:
    return choice.choice([
        None, 1, 2, 'text', b'', 1.5, choice.choice(ROWS), choice.choice(ROWS)[:-8], b'x' * 70_000,
        choice.choice(TEXTS), min(choice.choice(EXTREMES), 2**63 - 1), -1, 'cdr', IMU, '/imu'])


def hostile_database(folder: Path, choice: Random) -> Path:
    """Make a database out of statements of which any may fail."""
    path = folder / 'a.db3'
    database = sqlite3.connect(path)
    database.text_factory = bytes
    for name in COLUMNS:
        attempt(database, table(name, choice))
    attempt(database, 'INSERT INTO topics(id, name, type, serialization_format) '
            f"VALUES (1, '/imu', '{IMU}', 'cdr')")
    for _ in range(choice.randrange(60)):
        name = choice.choice(list(COLUMNS))
        columns = COLUMNS[name]
        values = [value(choice) for _ in columns]
        if name == 'messages' and choice.random() < .8:
            values = [None, 1, choice.randrange(10**18), choice.choice(ROWS)]
        attempt(database, f'INSERT INTO {name}({", ".join(columns)}) '
                f'VALUES ({", ".join("?" * len(columns))})', values)
    for _ in range(choice.randrange(3)):
        attempt(database, choice.choice([
            'CREATE INDEX i ON messages(topic_id)', 'CREATE INDEX j ON messages(hex(data))',
            'CREATE TRIGGER k AFTER INSERT ON messages BEGIN SELECT 1; END',
            'ALTER TABLE messages RENAME TO m', "ALTER TABLE messages ADD COLUMN e DEFAULT 'x'",
            'DROP TABLE topics', 'CREATE VIEW v AS SELECT * FROM messages']))
    if choice.random() < .3:
        attempt(database, 'PRAGMA writable_schema = ON')
        attempt(database, f'UPDATE sqlite_master SET {choice.choice(["sql", "name", "type"])} = ? '
                'WHERE rowid = ?', (choice.choice([
                    table('messages', choice), table('topics', choice), 'x', '', None]),
                    choice.randrange(1, 5)))
        attempt(database, 'UPDATE sqlite_master SET rootpage = ? WHERE rowid = ?',
                (choice.randrange(8), choice.randrange(1, 5)))
    database.commit()
    database.close()
    return path


def attempt(database: sqlite3.Connection, statement: str, values: object = ()) -> None:
    # What is made by chance need not be possible.
    database.set_progress_handler(lambda: True, 3_000_000)
    try:
        database.execute(statement, values).fetchmany(1)
    except (sqlite3.Error, UnicodeEncodeError, OverflowError):
        return


def journal(path: Path, choice: Random) -> None:
    """Put a journal or a log beside a database whose parts are anything."""
    magic = bytes.fromhex('d9d505f920a163d7')
    pages = path.stat().st_size // 4096
    head = magic + b''.join(
        choice.choice([number, choice.choice(EXTREMES) & 0xffffffff]).to_bytes(4, 'big')
        for number in (choice.randrange(4), 7, pages, 512, 4096))
    records = b''.join(
        (choice.randrange(pages + 2)).to_bytes(4, 'big') + choice.randbytes(64).ljust(4096, b'\0')
        + choice.randrange(1 << 32).to_bytes(4, 'big') for _ in range(choice.randrange(4)))
    name = str(path.parent / 'precious').encode()
    ending = choice.choice([b'', name + len(name).to_bytes(4, 'big')
                            + (sum(name) & 0xffffffff).to_bytes(4, 'big') + magic])
    log = bytes.fromhex('377f0682') + (3007000).to_bytes(4, 'big') + (4096).to_bytes(4, 'big')
    kind = choice.choice(['journal', 'journal', 'wal'])
    content = (head.ljust(512, b'\0') + records + ending if kind == 'journal'
               else log + choice.randbytes(20) + records)
    path.with_name(f'{path.name}-{kind}').write_bytes(content)


def judge_schema(choice: Random) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = hostile_database(Path(folder), choice)
        before = sorted(Path(folder).iterdir())
        read_in_part(path)
        assert sorted(Path(folder).iterdir()) == before


def judge_journal(choice: Random) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = write_db3(Path(folder) / 'a.db3', MESSAGES)
        precious = Path(folder) / 'precious'
        precious.write_text('mine')
        journal(path, choice)
        before = {file.name: file.read_bytes() for file in Path(folder).iterdir()}
        read_in_part(path)
        assert {file.name: file.read_bytes() for file in Path(folder).iterdir()} == before


def judge_decoding(text: str, message: bytes, options: RecordingOptions) -> None:
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


STORE = store_with({'a/msg/F': 'std_msgs/Header header\nstring[] names\nsensor_msgs/Imu[2] imus\n'
                               'float32[<=4] rest\n'})
DEFINITION = full_definition(STORE, 'a/msg/F')
MESSAGE = bytes(STORE.serialize_cdr(STORE.types['a/msg/F'](
    stamped(STORE, 1), ['a', 'bc'], [imu(STORE, 1), imu(STORE, 2)], np.ones(3, np.float32)),
    'a/msg/F'))
PATHS = ('imus[0].angular_velocity', 'rest[0:3]', 'header.stamp.sec,rest[0],rest[1]', 'names[0]')


def judge_fields(choice: Random) -> None:
    """Damage the definition of a message, the message, or the path of a field of it."""
    parts = [DEFINITION.encode(), MESSAGE, choice.choice(PATHS).encode()]
    damaged = choice.randrange(3)
    parts[damaged] = mutated_bytes(parts[damaged], choice) or b'?'
    judge_decoding(parts[0].decode('utf-8', 'replace'), parts[1], RecordingOptions(
        gyro=parts[2].decode('utf-8', 'replace'), accel='imus[1].linear_acceleration'))


@pytest.mark.parametrize('judge', [judge_schema, judge_journal, judge_fields])
@rounds(40)
def test_what_is_made_wrong_is_refused_or_read_in_part(judge, count, seed):
    each(count, seed, judge)


@pytest.mark.parametrize('parts', [
    ['a/msg/F f'], ['a/A a[2]', 'MSG: a/A\na/B[] b', 'MSG: a/B\na/A a']])
def test_types_in_a_circle_are_refused_or_read(parts):
    text = ('\n' + '=' * 80 + '\n').join([f'sensor_msgs/Imu imu\n{parts[0]}', *parts[1:]])
    judge_decoding(text, b'\0\1\0\0' + ROWS[0][4:] * 2, RecordingOptions())
