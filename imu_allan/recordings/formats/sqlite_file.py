# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The .db3 files of rosbag2's sqlite3 storage, in one class because all of it reads the same copy.

A recording is never written to: where SQLite would have to, to roll back what a killed recorder
left beside the file, that is done in a copy.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from itertools import groupby
import os
from pathlib import Path
import sqlite3
from struct import unpack_from
import tempfile

from imu_allan.block import ImuBlock
from imu_allan.cdr import MalformedImu
from imu_allan.errors import ImuAllanError, printable
from imu_allan.recordings.descriptions import Descriptions
from imu_allan.recordings.formats.effort import Effort
from imu_allan.recordings.formats.message_compression import is_compressed, unpacked_message
from imu_allan.recordings.formats.rollback_journal import copy_plain, left_beside, roll_back
from imu_allan.recordings.formats.temporary_folder import make_folder, remove_folder, room_in
from imu_allan.recordings.formats.untrusted_database import (
    Budget,
    LONGEST_VALUE,
    require_plain_tables,
    untrusted_database,
)
from imu_allan.recordings.imu_topic import MalformedMessages
from imu_allan.recordings.messages.definitions import Definition, FORMS
from imu_allan.recordings.messages.piece import Piece
from imu_allan.recordings.options import RecordingOptions
from imu_allan.recordings.recording import Recording
import numpy as np

_FETCH = 64
"""Rows fetched at a time: few enough to be held where each is as large as it may be."""
_DECODE = 1 << 13
"""Messages decoded at a time."""
_LONGEST_STEP = 1 << 40
"""Rows that are passed over at most in search of a page that is not damaged."""
_MOST_PLACES = 1000
"""Damaged places behind which reading goes on."""
_COUNTED_BYTES = 1 << 26
"""Bytes of a file whose messages are counted on opening."""
_MOST_TOPICS = 1 << 16
"""Topics that are listed: as many as an MCAP file can number."""
_MOST_NUMBERS = 500
"""Numbers that one topic may have; rosbag2 gives it one."""
_HELD_BYTES = 1 << 24
"""Bytes of messages that are held at a time, where messages are large."""
_HELD_BYTES_OF_ALL = 1 << 26
"""The same of several topics together."""
_MOST_AT_ONCE = 8000
"""Numbers of topics in one statement: each takes 2 of the 25,000 steps that it may have."""
_TABLES = ('messages', 'topics')
_INTEGER = "CASE typeof({0}) WHEN 'integer' THEN {0} END"
"""A value that is not looked at where it is something else, however long."""
_BLOB = f"CASE WHEN typeof(data) = 'blob' AND length(data) <= {LONGEST_VALUE} THEN data END"
_COLUMNS = f'ifnull({_INTEGER.format("timestamp")}, 0), {_BLOB}, rowid'
_TEXT = "CASE typeof({0}) WHEN 'text' THEN {0} ELSE '' END"
_TOPIC_TEXTS = ('name', 'type', 'serialization_format')
_NO_MESSAGE = MalformedImu(f'not a blob of {LONGEST_VALUE:,} bytes at most')

Row = tuple[int, bytes | None, int]
"""Receive stamp, message (None where it cannot be one) and number of the row."""


class SqliteRecording(Recording):
    """
    A .db3 file.

    Parameters
    ----------
    path, stored : Path
        The recording as the user knows it, and where its bytes are.
    options : RecordingOptions
        What the user says about it.

    Raises
    ------
    ImuAllanError
        If the file is not a rosbag2 database.

    """

    def __init__(self, path: Path, stored: Path, options: RecordingOptions) -> None:
        super().__init__(path, options)
        self.size_bytes = stored.stat().st_size
        # SQLite looks beside the file itself, not beside a link to it.
        self._stored = Path(os.path.realpath(stored))
        self._copy: Path | None = None
        self._numbers: dict[str, list[int]] = {}
        self._beside, strange = left_beside(self._stored)
        if strange:
            self._beside = []
            self.remark('unfinished_recording', fault='not_regular',
                        file=printable(strange[0].name))
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
            remove_folder(self._copy)

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read blocks in the order of recording, each with the bytes consumed so far."""
        decode = self.imu(topic).messages.decoder()
        malformed = MalformedMessages()
        with self._database() as database:
            for pieces, position in self._pieces(database, topic, malformed):
                for block in decode(pieces, malformed):
                    yield block, position
        malformed.report(self.imu(topic), self.remark)

    # ---------------------------------------------------------------------------- what is there

    def _open(self) -> None:
        """List the topics, with as much tolerance as the file needs."""
        if not self._beside:
            self._cut_last_page()
        reason: Exception
        try:
            if any(beside.name.endswith('-journal') for beside in self._beside):
                self._use_journal()
            self._list_topics()
            return
        except (sqlite3.Error, OSError) as error:
            reason = error
        if self._beside and self._copy is None and self._copied():
            # A log can only be used where SQLite may write its index.
            with suppress(sqlite3.Error):
                self._list_topics()
                return
        if self._beside:
            self._mode = 'immutable=1'
            self.remark(
                'unfinished_recording', fault='unusable', file=printable(self._beside[0].name),
                reason=printable(reason))
        self._tolerant = True
        try:
            self._list_topics()
        except sqlite3.Error:
            raise ImuAllanError(
                f'{printable(self.path)}: not a readable rosbag2 database '
                f'({printable(reason)})') from reason

    def _use_journal(self) -> None:
        """Work on a copy in which the unfinished transaction is undone."""
        if not self._copied():
            raise OSError(f'no room for a copy in {tempfile.gettempdir()}; name a larger folder '
                          'with TMPDIR')
        roll_back(self._stored)
        self._mode = 'immutable=1'
        self.remark(
            'unfinished_recording', fault='killed', file=printable(self._beside[0].name))

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
            'truncated_recording', fault='database', missing_bytes=missing,
            bytes=pages * page_size)
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
        room = room_in(tempfile.gettempdir())
        if self.size_bytes + sum(beside.stat().st_size for beside in self._beside) > room:
            return False
        self._copy = make_folder()
        for beside in self._beside:
            copy_plain(beside, self._copy)
        self._stored = copy_plain(self._stored, self._copy)
        return True

    @contextmanager
    def _database(self) -> Iterator[sqlite3.Connection]:
        shared_memory = self._stored.with_name(f'{self._stored.name}-shm')
        existed = shared_memory.exists()
        self._budget = Budget.of_size(self._room)
        try:
            with untrusted_database(self._stored, self._mode, self._budget,
                                    tolerant=self._tolerant) as database:
                require_plain_tables(database, _TABLES)
                yield database
        finally:
            if not existed:
                with suppress(OSError):
                    shared_memory.unlink(missing_ok=True)

    @property
    def _room(self) -> int:
        """Bytes that file and log have for rows: none of them can take more."""
        return self.size_bytes + sum(
            beside.stat().st_size for beside in self._beside if beside.exists())

    def _list_topics(self) -> None:
        with self._database() as database:
            self._numbers, self.topics, self.other_topics = {}, [], {}
            self.reasons, self.thermometers, self._descriptions = {}, [], Descriptions()
            database.execute('SELECT id, topic_id, timestamp, data FROM messages LIMIT 0')
            kinds: dict[str, str] = {}
            room = self._room
            for place, (number, *texts) in enumerate(database.execute(
                    f'SELECT rowid, {", ".join(map(_TEXT.format, _TOPIC_TEXTS))} '
                    f'FROM topics NOT INDEXED ORDER BY rowid LIMIT {_MOST_TOPICS + 1}')):
                name, kind, form = texts
                if place == _MOST_TOPICS:
                    self.remark('many_topics', what='topics', listed=_MOST_TOPICS)
                    break
                room -= sum(map(len, texts))
                if room < 0:
                    raise sqlite3.DatabaseError('its topics have more text than the file')
                if form != 'cdr':
                    self.other_topics[name] = f'{kind} encoded as {form}'
                elif kinds.setdefault(name, kind) == kind:
                    self._numbers.setdefault(name, []).append(number)
            definitions = _definitions(database, set(kinds.values()), self._room)
            for name, kind in kinds.items():
                self.list_topic(name, kind, 'cdr', None, definitions.get(kind))
            counts = self._counts(database)
            if counts is not None:
                self.topics = [replace(imu, count=sum(
                    counts[number] for number in self._numbers[imu.topic])) for imu in self.topics]

    def _counts(self, database: sqlite3.Connection) -> Counter[int] | None:
        """Count the messages of every topic number; None where that would take long."""
        if self.size_bytes > _COUNTED_BYTES or self._tolerant or not self.topics:
            return None
        with suppress(sqlite3.Error):
            return Counter(number for [number] in database.execute(
                f'SELECT {_INTEGER.format("topic_id")} FROM messages NOT INDEXED'))
        return None

    # ------------------------------------------------------------------------------ going through

    def _pieces(
        self, database: sqlite3.Connection, topic: str, malformed: MalformedMessages,
    ) -> Iterator[tuple[list[Piece], int]]:
        """Fetch messages, those of equal size that follow each other as one piece, and place."""
        first = last = 0
        with suppress(sqlite3.Error):
            first, last = (number for order in ('ASC', 'DESC') for [number] in database.execute(
                f'SELECT rowid FROM messages NOT INDEXED ORDER BY rowid {order} LIMIT 1'))
        held = _HeldMessages(Effort(self.path, 0), malformed)
        position = 0
        for fetched in self._fetched(database, topic):
            if held.full:
                yield held.pieces(), position
            held.take(fetched)
            share = (fetched[-1][2] - first) / max(last - first, 1)
            position = int(self.size_bytes * min(max(share, 0.0), 1.0))
        yield held.pieces(), position

    def _fetched(self, database: sqlite3.Connection, topic: str) -> Iterator[list[Row]]:
        """Fetch rows; reading goes on behind damaged pages."""
        numbers = self._numbers[self.imu(topic).topic]
        if len(numbers) > _MOST_NUMBERS:
            self.remark('damaged_recording', fault='entries', topic=printable(topic),
                        entries=len(numbers), read=_MOST_NUMBERS)
            numbers = numbers[:_MOST_NUMBERS]
        source = (f'FROM messages NOT INDEXED WHERE {_INTEGER.format("topic_id")} '
                  f'IN ({_marks(numbers)})')
        messages = 0
        left = self._room
        reason: Exception
        try:
            cursor = database.execute(f'SELECT {_COLUMNS} {source} ORDER BY rowid', numbers)
            while rows := cursor.fetchmany(_FETCH):
                messages += len(rows)
                left -= sum(len(row[1]) for row in rows if row[1])
                if left < 0:
                    raise sqlite3.DatabaseError('its messages have more bytes than the file')
                yield rows
            return
        except sqlite3.Error as error:
            reason = error
        last = -2**63
        with suppress(sqlite3.Error):
            for [number] in database.execute(
                    f'SELECT rowid {source} ORDER BY rowid LIMIT 1 OFFSET ?',
                    (*numbers, max(messages, 1) - 1)):
                last = number if messages else number - 1
        query = f'SELECT {_COLUMNS} {source} AND rowid > ? ORDER BY rowid'
        places = step = 0
        while (step < _LONGEST_STEP and places < _MOST_PLACES and left >= 0
               and not self._budget.exhausted):
            # One by one, since a fetch that fails takes the rows before the damage along.
            rows = []
            try:
                for row in database.execute(query, (*numbers, last + step)):
                    # Damaged pages may lead back to rows that were read already.
                    if row[2] > last:
                        last, step = row[2], 0
                        rows.append(row)
                    if len(rows) == _FETCH:
                        yield rows
                        messages += len(rows)
                        left -= sum(len(row[1]) for row in rows if row[1])
                        rows = []
                        if left < 0:
                            break
                step = _LONGEST_STEP
            except sqlite3.Error:
                places += step == 0
                step = max(2 * step, 1)
            if rows:
                yield rows
                messages += len(rows)
                left -= sum(len(row[1]) for row in rows if row[1])
        self.remark(
            'damaged_recording', fault='database', places=places, reason=printable(reason),
            read=messages, topic=printable(topic))


def _marks(numbers: list[int]) -> str:
    return ','.join('?' * len(numbers))


def _definitions(database: sqlite3.Connection, kinds: set[str], room: int,
                 ) -> dict[str, Definition]:
    """Look types' definitions up, which bags since ROS 2 Iron hold."""
    found: dict[str, Definition] = {}
    with suppress(sqlite3.Error):
        require_plain_tables(database, ['message_definitions'])
        columns = ('topic_type', 'encoding', 'encoded_message_definition')
        for kind, form, text in database.execute(
                f'SELECT {", ".join(map(_TEXT.format, columns))} '
                f'FROM message_definitions NOT INDEXED ORDER BY rowid LIMIT {_MOST_TOPICS}'):
            room -= len(text)
            if room < 0:
                break
            if kind in kinds and form in FORMS and text.strip():
                found.setdefault(kind, Definition(text, FORMS[form]))
    return found


def _messages(times: Sequence[int], data: Sequence[bytes | None],
              ) -> tuple[tuple[int, ...], tuple[bytes, ...]]:
    """Receive stamps and messages of those rows that hold one."""
    kept = [(stamp, message) for stamp, message in zip(times, data, strict=True)
            if message is not None]
    return tuple(stamp for stamp, _ in kept), tuple(message for _, message in kept)


class _HeldMessages:
    """Messages of a topic as they are fetched, those of one size in a row as one piece."""

    def __init__(self, effort: Effort, malformed: Callable[[int, MalformedImu], None]) -> None:
        self._effort, self._malformed = effort, malformed
        self._pieces: list[Piece] = []
        self._parts: list[bytes] = []
        self._stamps: list[int] = []
        self._size = self._count = self._bytes = 0

    @property
    def full(self) -> bool:
        """Whether they are to be decoded before more are taken."""
        return self._count >= _DECODE or self._bytes >= _HELD_BYTES

    def take(self, fetched: Sequence[Row]) -> None:
        """Take some `_FETCH` rows."""
        times, data = zip(*(row[:2] for row in fetched), strict=True)
        if None in data:
            self._malformed(data.count(None), _NO_MESSAGE)
            times, data = _messages(times, data)
        if data and is_compressed(data[0]):
            data = tuple(unpacked_message(message, self._effort) for message in data)
        for length, run in _equal_sizes(data):
            if length != self._size:
                self._end_piece()
            self._size = length
            self._parts.append(b''.join(data[run]))
            self._stamps += times[run]
            self._bytes += len(self._parts[-1])
        self._count += len(data)

    def pieces(self) -> list[Piece]:
        """Give what is held, and hold it no longer."""
        self._end_piece()
        pieces, self._pieces = self._pieces, []
        self._count = self._bytes = 0
        return pieces

    def _end_piece(self) -> None:
        if self._parts:
            self._pieces.append(_piece(self._parts, self._stamps, self._size))
            self._parts, self._stamps = [], []


def _piece(parts: list[bytes], stamps: list[int], size: int) -> Piece:
    rows = np.frombuffer(b''.join(parts), np.uint8).reshape(len(stamps), size)
    return Piece(rows, np.array(stamps, np.int64))


def _equal_sizes(data: tuple[bytes, ...]) -> Iterator[tuple[int, slice]]:
    """Spans of messages of equal size."""
    sizes = list(map(len, data))
    if not sizes:
        return
    if min(sizes) == max(sizes):
        yield sizes[0], slice(None)
        return
    start = 0
    for size, run in groupby(sizes):
        stop = start + sum(1 for _ in run)
        yield size, slice(start, stop)
        start = stop
