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
import shutil
import sqlite3
from struct import unpack_from
import tempfile

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
_LONGEST_STEP = 1 << 40
"""Rows that are passed over at most in search of a page that is not damaged."""
_MOST_PLACES = 1000
"""Damaged places behind which reading goes on."""
_SPARED_DISK = 1 << 28
"""Bytes of the temporary folder's disk that are never filled."""
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
        self.size_bytes = stored.stat().st_size
        self._stored = stored
        self._copy: Path | None = None
        self._numbers: dict[str, list[int]] = {}
        self._beside = [
            beside for beside in (stored.with_name(f'{stored.name}-{kind}')
                                  for kind in ('wal', 'journal'))
            if beside.is_file() and beside.stat().st_size > 0]
        # Opened as immutable, SQLite creates no file and takes no lock that a recorder could meet.
        self._mode = 'mode=ro' if self._beside else 'immutable=1'
        self._tolerant = False
        try:
            self._open()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Remove the temporary copy, if one was needed."""
        if self._copy is not None:
            shutil.rmtree(self._copy, ignore_errors=True)

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read blocks in the order of recording, each with the bytes consumed so far."""
        malformed = MalformedMessages()
        with self._database() as database:
            for rows, stamps, position in self._rows(database, topic):
                for block in decode_imu_rows(rows, stamps, 'cdr', malformed):
                    yield block, position
        malformed.report(self, topic)

    # ---------------------------------------------------------------------------- what is there

    def _open(self) -> None:
        """List the topics, with as much tolerance as the file needs."""
        if not self._beside:
            self._cut_last_page()
        try:
            self._list_topics()
            return
        except sqlite3.Error as error:
            reason = error
        if self._beside:
            beside = printable(self._beside[0].name)
            if self._copied():
                self._mode = 'mode=rw'
                with suppress(sqlite3.Error):
                    self._list_topics()
                    self.remark(
                        'unfinished_recording',
                        f'{beside} beside it tells that the recorder was killed; what it was '
                        'about to write then is missing')
                    return
            self._mode = 'immutable=1'
            self.remark(
                'unfinished_recording',
                f'{beside} beside it could not be used ({printable(reason)}); the last messages '
                'before the recorder was killed are missing or damaged')
        self._tolerant = True
        try:
            self._list_topics()
        except sqlite3.Error:
            raise ImuAllanError(
                f'{printable(self.path)}: not a readable rosbag2 database '
                f'({printable(reason)})') from reason

    def _cut_last_page(self) -> None:
        """Work on a copy without its last page where that is incomplete: SQLite would pad it."""
        with self._stored.open('rb') as file:
            header = file.read(100).ljust(100, b'\0')
        [page_size] = unpack_from('>H', header, 16)
        page_size = 65536 if page_size == 1 else page_size
        [changes, pages] = unpack_from('>II', header, 24)
        [counted_at] = unpack_from('>I', header, 92)
        missing = pages * page_size - self.size_bytes
        # The number of pages is valid where it was counted at the latest change.
        if changes != counted_at or missing <= 0:
            return
        self.remark(
            'truncated_recording',
            f'{missing} of {pages * page_size} bytes are missing at the end of the database (was '
            'the recorder killed, or the copy cut short?)')
        self._tolerant = True
        if missing % page_size:
            if not self._copied():
                raise ImuAllanError(
                    f'{printable(self.path)}: cut short, and no room for a copy in '
                    f'{printable(tempfile.gettempdir())}; name a larger folder with TMPDIR')
            with self._stored.open('rb+') as file:
                file.truncate(self.size_bytes // page_size * page_size)

    def _copied(self) -> bool:
        """Copy the file and what lies beside it to where SQLite may write; False without room."""
        room = shutil.disk_usage(tempfile.gettempdir()).free - _SPARED_DISK
        if self.size_bytes + sum(beside.stat().st_size for beside in self._beside) > room:
            return False
        self._copy = Path(tempfile.mkdtemp(prefix='imu_allan_'))
        for file in (self._stored, *self._beside):
            shutil.copyfile(file, self._copy / file.name)
        self._stored = self._copy / self._stored.name
        return True

    @contextmanager
    def _database(self) -> Iterator[sqlite3.Connection]:
        shared_memory = self._stored.with_name(f'{self._stored.name}-shm')
        existed = shared_memory.exists()
        database = sqlite3.connect(
            f'{self._stored.absolute().as_uri()}?{self._mode}', uri=True)
        database.text_factory = _text
        try:
            if self._tolerant:
                # Without it SQLite refuses a file shorter than its header says as a whole.
                database.execute('PRAGMA writable_schema = ON')
            yield database
        finally:
            database.close()
            if not existed:
                with suppress(OSError):
                    shared_memory.unlink(missing_ok=True)

    def _list_topics(self) -> None:
        with self._database() as database:
            self._numbers, self.topics, self.other_topics = {}, [], {}
            database.execute('SELECT id, topic_id, timestamp, data FROM messages LIMIT 0')
            for number, name, kind, form in database.execute(
                    'SELECT id, CAST(name AS TEXT), CAST(type AS TEXT), '
                    'CAST(serialization_format AS TEXT) FROM topics ORDER BY id'):
                if kind in IMU_TYPES and form == 'cdr':
                    self._numbers.setdefault(str(name), []).append(number)
                else:
                    self.other_topics[str(name)] = (
                        str(kind) if form == 'cdr' else f'{kind} encoded as {form}')
            for name, numbers in self._numbers.items():
                count = None
                if self.size_bytes <= _COUNTED_BYTES and not self._tolerant:
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

    # ------------------------------------------------------------------------------ going through

    def _rows(
        self, database: sqlite3.Connection, topic: str,
    ) -> Iterator[tuple[NDArray[np.uint8], NDArray[np.int64], int]]:
        """Fetch messages of equal size as rows of one array, with receive stamps and place."""
        start = end = 0
        with suppress(sqlite3.Error):
            [[start, end]] = database.execute(
                'SELECT ifnull(CAST(min(timestamp) AS INTEGER), 0), '
                'ifnull(CAST(max(timestamp) AS INTEGER), 0) FROM messages')
        parts: list[bytes] = []
        stamps: list[int] = []
        size = position = 0
        for fetched in self._fetched(database, topic):
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

    def _fetched(
        self, database: sqlite3.Connection, topic: str,
    ) -> Iterator[list[tuple[int, bytes]]]:
        """Fetch rows of receive stamp and message; reading goes on behind damaged pages."""
        numbers = self._numbers[topic]
        # The casts cost nothing where the columns hold what they should.
        columns = "ifnull(CAST(timestamp AS INTEGER), 0), ifnull(CAST(data AS BLOB), x'')"
        source = f'FROM messages WHERE topic_id IN ({_marks(numbers)})'
        messages = 0
        try:
            cursor = database.execute(f'SELECT {columns} {source} ORDER BY id', numbers)
            while fetched := cursor.fetchmany(_FETCH):
                messages += len(fetched)
                if messages > self.size_bytes:
                    raise sqlite3.DatabaseError('more rows than bytes')
                yield fetched
            return
        except sqlite3.Error as error:
            reason = error
        last = -2**63
        with suppress(sqlite3.Error):
            for [number] in database.execute(
                    f'SELECT id {source} ORDER BY id LIMIT 1 OFFSET ?',
                    (*numbers, max(messages, 1) - 1)):
                last = number if messages else number - 1
        query = f'SELECT {columns}, id {source} AND id > ? ORDER BY id'
        places = step = 0
        while step < _LONGEST_STEP and places < _MOST_PLACES:
            # One by one, since a fetch that fails takes the rows before the damage along.
            rows: list[tuple[int, bytes]] = []
            try:
                for stamp, data, number in database.execute(query, (*numbers, last + step)):
                    # Damaged pages may lead back to rows that were read already.
                    if number > last:
                        last, step = number, 0
                        rows.append((stamp, data))
                    if len(rows) == _FETCH:
                        yield rows
                        messages += len(rows)
                        rows = []
                step = _LONGEST_STEP
            except sqlite3.Error:
                places += step == 0
                step = max(2 * step, 1)
            if rows:
                yield rows
                messages += len(rows)
        self.remark(
            'damaged_recording',
            f'the database is damaged in {places} places ({printable(reason)}): {messages} '
            f'messages of {printable(topic)} could be read, those in the damaged places are lost')


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
