# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The .db3 files of rosbag2's sqlite3 storage.

A recording is never written to: where SQLite would have to (to roll back or to merge what a killed
recorder left beside the file), the file alone is read and the loss is told.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import groupby
from pathlib import Path
import sqlite3

from imu_allan.block import ImuBlock
from imu_allan.cdr import decode_imu_rows
from imu_allan.errors import ImuAllanError, printable
from imu_allan.recordings.message_compression import is_compressed, unpacked_message
from imu_allan.recordings.recording import IMU_TYPES, ImuTopic, MalformedMessages, Recording
import numpy as np
from numpy.typing import NDArray

_FETCH = 256
"""Rows fetched at a time: few enough to stay in the cache until they are joined."""
_DECODE = 1 << 13
"""Messages decoded at a time."""
_COUNTED_BYTES = 1 << 26
"""Bytes of a file whose messages are counted on opening."""


class SqliteRecording(Recording):
    """
    A .db3 file.

    Parameters
    ----------
    path, stored : Path
        The recording as the user knows it, and where its bytes are.

    Raises
    ------
    ImuAllanError
        If the file is not a rosbag2 database.

    """

    def __init__(self, path: Path, stored: Path) -> None:
        super().__init__(path)
        self._stored = stored
        self._numbers: dict[str, list[int]] = {}
        self.size_bytes = stored.stat().st_size
        self._beside = [
            beside for beside in (stored.with_name(f'{stored.name}-{kind}')
                                  for kind in ('wal', 'journal'))
            if beside.is_file() and beside.stat().st_size > 0]
        # Opened as immutable, SQLite creates no file and takes no lock that a recorder could meet.
        self._immutable = not self._beside
        try:
            self._list_topics()
        except sqlite3.Error as error:
            if self._immutable:
                raise self._unreadable(error) from error
            self._immutable = True
            self.remark(
                'unfinished_recording',
                f'{printable(self._beside[0].name)} beside it cannot be merged '
                f'({printable(error)}); the last messages before the recorder was killed are '
                'missing')
            try:
                self._list_topics()
            except sqlite3.Error as second:
                raise self._unreadable(second) from second

    def close(self) -> None:
        """Release nothing: each reading opens and closes the file itself."""

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read blocks in the order of recording, each with the bytes consumed so far."""
        malformed = MalformedMessages()
        messages = 0
        try:
            with self._database() as database:
                for rows, stamps, position in self._rows(database, topic):
                    messages += len(rows)
                    for block in decode_imu_rows(rows, stamps, 'cdr', malformed):
                        yield block, position
        except sqlite3.Error as error:
            self.remark(
                'damaged_recording',
                f'the database is damaged ({printable(error)}): {messages} messages of '
                f'{printable(topic)} were read, what follows them is lost')
        malformed.report(self, topic)

    def _rows(
        self, database: sqlite3.Connection, topic: str,
    ) -> Iterator[tuple[NDArray[np.uint8], NDArray[np.int64], int]]:
        """Fetch messages of equal size as rows of one array, with receive stamps and place."""
        numbers = self._numbers[topic]
        [[start, end]] = database.execute(
            'SELECT CAST(min(timestamp) AS INTEGER), CAST(max(timestamp) AS INTEGER) '
            'FROM messages')
        # The casts cost nothing where the columns hold what they should.
        cursor = database.execute(
            "SELECT ifnull(CAST(timestamp AS INTEGER), 0), ifnull(CAST(data AS BLOB), x'') "
            f'FROM messages WHERE topic_id IN ({_marks(numbers)}) ORDER BY id', numbers)
        parts: list[bytes] = []
        stamps: list[int] = []
        size = position = 0
        failure: sqlite3.Error | None = None
        while failure is None:
            try:
                fetched = cursor.fetchmany(_FETCH)
            except sqlite3.Error as error:
                failure = error
                break
            if not fetched:
                break
            times, data = zip(*fetched, strict=True)
            if is_compressed(data[0]):
                data = tuple(map(unpacked_message, data))
            for length, run in _equal_sizes(data):
                if parts and (length != size or len(stamps) >= _DECODE):
                    yield _array(parts, len(stamps), size), np.array(stamps, np.int64), position
                    parts, stamps = [], []
                size = length
                parts.append(b''.join(data[run]))
                stamps += times[run]
            share = (times[-1] - start) / max(end - start, 1)
            position = int(self.size_bytes * min(max(share, 0.0), 1.0))
        if parts:
            yield _array(parts, len(stamps), size), np.array(stamps, np.int64), position
        if failure is not None:
            raise failure

    def _unreadable(self, error: sqlite3.Error) -> ImuAllanError:
        return ImuAllanError(
            f'{printable(self.path)}: not a readable rosbag2 database ({printable(error)})')

    @contextmanager
    def _database(self) -> Iterator[sqlite3.Connection]:
        shared_memory = self._stored.with_name(f'{self._stored.name}-shm')
        existed = shared_memory.exists()
        mode = 'immutable=1' if self._immutable else 'mode=ro'
        database = sqlite3.connect(f'{self._stored.absolute().as_uri()}?{mode}', uri=True)
        database.text_factory = _text
        try:
            yield database
        finally:
            database.close()
            if not existed and not self._immutable:
                with suppress(OSError):
                    shared_memory.unlink(missing_ok=True)

    def _list_topics(self) -> None:
        with self._database() as database:
            self._numbers, self.topics, self.other_topics = {}, [], {}
            for number, name, kind, form in database.execute(
                    'SELECT id, CAST(name AS TEXT), CAST(type AS TEXT), '
                    'CAST(serialization_format AS TEXT) FROM topics ORDER BY id'):
                if kind in IMU_TYPES and form == 'cdr':
                    self._numbers.setdefault(name, []).append(number)
                else:
                    self.other_topics[str(name)] = (
                        str(kind) if form == 'cdr' else f'{kind} encoded as {form}')
            database.execute('SELECT max(id) FROM messages').fetchall()
            for name, numbers in self._numbers.items():
                count = None
                if self.size_bytes <= _COUNTED_BYTES:
                    with suppress(sqlite3.Error):
                        [[count]] = database.execute(
                            'SELECT count(*) FROM messages WHERE topic_id IN '
                            f'({_marks(numbers)})', numbers)
                self.topics.append(ImuTopic(name, count))
            self._note_carriers(database)

    def _note_carriers(self, database: sqlite3.Connection) -> None:
        """Note which other types contain an Imu, where the file has the definitions."""
        with suppress(sqlite3.Error):
            carrying = {kind for [kind] in database.execute(
                'SELECT CAST(topic_type AS TEXT) FROM message_definitions '
                "WHERE instr(CAST(encoded_message_definition AS TEXT), 'sensor_msgs/Imu') "
                "OR instr(CAST(encoded_message_definition AS TEXT), 'sensor_msgs/msg/Imu')")}
            self.carriers = {name for name, kind in self.other_topics.items() if kind in carrying}


def _marks(numbers: list[int]) -> str:
    return ','.join('?' * len(numbers))


def _text(data: bytes) -> str:
    return data.decode('utf-8', 'replace')


def _array(parts: list[bytes], count: int, size: int) -> NDArray[np.uint8]:
    return np.frombuffer(b''.join(parts), np.uint8).reshape(count, size)


def _equal_sizes(data: tuple[bytes, ...]) -> Iterator[tuple[int, slice]]:
    """Spans of messages of equal size."""
    sizes = list(map(len, data))
    if min(sizes) == max(sizes):
        yield sizes[0], slice(None)
        return
    start = 0
    for size, run in groupby(sizes):
        stop = start + sum(1 for _ in run)
        yield size, slice(start, stop)
        start = stop
