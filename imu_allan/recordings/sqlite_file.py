# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The .db3 files of rosbag2's sqlite3 storage.

A recording is never written to: where SQLite would have to (to roll back or to merge what a killed
recorder left beside the file), the file alone is read and the loss is told.
"""

from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
import sqlite3

from imu_allan.block import ImuBlock
from imu_allan.cdr import blocks_from_messages
from imu_allan.errors import ImuAllanError, printable
from imu_allan.recordings.recording import IMU_TYPES, ImuTopic, MalformedMessages, Recording
import numpy as np

MAGIC = b'SQLite format 3\0'

_FETCH = 4096
_COUNTED_BYTES = 1 << 26
"""Bytes of a file whose messages are counted on opening."""


class SqliteRecording(Recording):
    """
    A .db3 file.

    Parameters
    ----------
    path : Path
        The file.
    unpack : callable, optional
        Decompresses one message, for bags whose messages are compressed one by one.

    Raises
    ------
    ImuAllanError
        If the file is not a rosbag2 database.
    """

    def __init__(self, path: Path, unpack: Callable[[bytes], bytes] | None = None) -> None:
        super().__init__(path)
        self._unpack = unpack
        self.size_bytes = path.stat().st_size
        self._numbers: dict[str, list[int]] = {}
        self._immutable = False
        try:
            with closing(self._connect()) as database:
                self._list_topics(database)
        except sqlite3.Error as error:
            raise ImuAllanError(
                f'{printable(path)}: not a readable rosbag2 database '
                f'({printable(error)})') from error

    def close(self) -> None:
        """Release nothing: each reading opens and closes the file itself."""

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read blocks in the order of recording, each with the bytes consumed so far."""
        numbers = self._numbers[topic]
        malformed = MalformedMessages()
        messages = 0
        marks = ','.join('?' * len(numbers))
        with closing(self._connect()) as database:
            [[last]] = database.execute('SELECT max(id) FROM messages')
            cursor = database.execute(
                f'SELECT id, timestamp, data FROM messages WHERE topic_id IN ({marks}) '
                'ORDER BY id', numbers)
            while True:
                try:
                    rows = cursor.fetchmany(_FETCH)
                except sqlite3.Error as error:
                    self.remark(
                        'damaged_recording',
                        f'the database is damaged ({printable(error)}): {messages} messages of '
                        f'{printable(topic)} were read up to that place, the rest is lost')
                    break
                if not rows:
                    break
                ids, stamps, data = zip(*rows, strict=True)
                messages += len(rows)
                if self._unpack is not None:
                    data = tuple(map(self._unpack, data))
                position = self.size_bytes * ids[-1] // max(last or 1, 1)
                for block in blocks_from_messages(
                        data, np.array(stamps, np.int64), 'cdr', malformed):
                    yield block, position
        malformed.report(self, topic)

    def _connect(self) -> sqlite3.Connection:
        database = sqlite3.connect(f'{self.path.absolute().as_uri()}?mode=ro', uri=True)
        return database

    def _list_topics(self, database: sqlite3.Connection) -> None:
        for number, name, kind, form in database.execute(
                'SELECT id, name, type, serialization_format FROM topics ORDER BY id'):
            if kind in IMU_TYPES and form == 'cdr':
                self._numbers.setdefault(name, []).append(number)
            else:
                self.other_topics[name] = kind if form == 'cdr' else f'{kind} encoded as {form}'
        for name, numbers in self._numbers.items():
            count = None
            if self.size_bytes <= _COUNTED_BYTES:
                marks = ','.join('?' * len(numbers))
                [[count]] = database.execute(
                    f'SELECT count(*) FROM messages WHERE topic_id IN ({marks})', numbers)
            self.topics.append(ImuTopic(name, count))
