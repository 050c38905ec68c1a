# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The .db3 files of rosbag2's sqlite3 storage.

A recording is never written to: where SQLite would have to, for what a killed recorder left beside
the file, that is done in a copy.
"""

from array import array
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from itertools import pairwise
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
from imu_allan.recordings.formats.temporary_folder import make_folder, remove_folder, room_in
from imu_allan.recordings.formats.untrusted_database import (
    Budget,
    copy_plain,
    left_beside,
    LONGEST_VALUE,
    require_plain_tables,
    untrusted_database,
    use_what_is_beside,
)
from imu_allan.recordings.imu_topic import MalformedMessages
from imu_allan.recordings.messages.definitions import Definition, FORMS
from imu_allan.recordings.messages.piece import Piece
from imu_allan.recordings.options import RecordingOptions
from imu_allan.recordings.recording import FileRecording
import numpy as np

_FETCH = 64
"""Rows fetched at a time: few enough to be held where each is as large as it may be."""
_DECODE, _HELD_BYTES = 1 << 13, 1 << 24
"""Messages decoded at a time, and their bytes where they are large."""
_STRETCHES = 200
"""Statements for all rows, so that it is known how far reading has come."""
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
_TEXT = "CASE typeof({0}) WHEN 'text' THEN {0} ELSE '' END"
_NO_MESSAGE = MalformedImu(f'not a blob of {LONGEST_VALUE:,} bytes at most')

Row = tuple[int, bytes]
"""Receive stamp and message, or whatever else stands there."""


class SqliteRecording(FileRecording):
    """A .db3 file; raises ImuAllanError where that is no rosbag2 database."""

    def __init__(self, path: Path, stored: Path, options: RecordingOptions) -> None:
        # SQLite looks beside the file itself, not beside a link to it.
        super().__init__(path, Path(os.path.realpath(stored)), options)
        self._copy: Path | None = None
        self._numbers: dict[str, list[int]] = {}
        self._tolerant = False
        beside, strange = left_beside(self._stored)
        # Bytes that file and log have for rows: none of them can take more.
        self._room = self.size_bytes + sum(file.stat().st_size for file in beside)
        try:
            if strange:
                self.remark('unfinished_recording', fault='not_regular',
                            file=printable(strange[0].name))
            self._open([] if strange else beside)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Remove the temporary copy, if one was needed."""
        if self._copy is not None:
            remove_folder(self._copy)

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read blocks in the order of recording, each with the bytes consumed so far."""
        imu = self.imu(topic)
        decode, malformed = imu.messages.decoder(), MalformedMessages()
        with self._database() as (database, budget):
            for pieces, position in self._pieces(database, budget, topic, malformed):
                for block in decode(pieces, malformed):
                    yield block, position
        malformed.report(imu, self.remark)

    # ---------------------------------------------------------------------------- what is there

    def _open(self, beside: list[Path]) -> None:
        """List the topics, with as much tolerance as the file needs."""
        reason: Exception
        try:
            if beside:
                self._work_on_copy(beside)
                use_what_is_beside(self._stored)
            else:
                self._cut_last_page()
            self._list_topics()
            if any(file.name.endswith('-journal') for file in beside):
                self.remark('unfinished_recording', fault='killed', file=printable(beside[0].name))
            return
        except (sqlite3.Error, OSError) as error:
            reason = error
        if beside:
            self.remark('unfinished_recording', fault='unusable', file=printable(beside[0].name),
                        reason=printable(reason))
        self._tolerant = True
        try:
            self._list_topics()
        except sqlite3.Error:
            raise ImuAllanError(f'{printable(self.path)}: not a readable rosbag2 database '
                                f'({printable(reason)})') from reason

    def _work_on_copy(self, beside: list[Path]) -> None:
        if self._room > room_in(tempfile.gettempdir()):
            raise OSError(f'no room for a copy in {tempfile.gettempdir()}; name a larger folder '
                          'with TMPDIR')
        self._copy = make_folder()
        for file in beside:
            copy_plain(file, self._copy)
        self._stored = copy_plain(self._stored, self._copy)

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
        self.remark('truncated_recording', fault='database', missing_bytes=missing,
                    bytes=pages * page_size)
        self._tolerant = True
        if missing % page_size:
            try:
                self._work_on_copy([])
            except OSError as error:
                raise ImuAllanError(f'{printable(self.path)}: cut short, and {printable(error)}'
                                    ) from error
            with self._stored.open('rb+') as file:
                file.truncate(self.size_bytes // page_size * page_size)

    @contextmanager
    def _database(self) -> Iterator[tuple[sqlite3.Connection, Budget]]:
        with untrusted_database(self._stored, self._room, tolerant=self._tolerant) as opened:
            require_plain_tables(opened[0], ('messages', 'topics'))
            yield opened

    def _list_topics(self) -> None:
        with self._database() as (database, _):
            self._numbers, self.topics, self.other_topics = {}, [], {}
            self.reasons, self.thermometers, self._descriptions = {}, [], Descriptions()
            database.execute('SELECT id, topic_id, timestamp, data FROM messages LIMIT 0')
            kinds: dict[str, str] = {}
            room = self._room
            texts = ', '.join(map(_TEXT.format, ('name', 'type', 'serialization_format')))
            for place, (number, name, kind, form) in enumerate(database.execute(
                    f'SELECT rowid, {texts} FROM topics NOT INDEXED ORDER BY rowid '
                    f'LIMIT {_MOST_TOPICS + 1}')):
                if place == _MOST_TOPICS:
                    self.remark('many_topics', what='topics', listed=_MOST_TOPICS)
                    break
                room -= len(name) + len(kind) + len(form)
                if room < 0:
                    raise sqlite3.DatabaseError('its topics have more text than the file')
                if form != 'cdr':
                    self.other_topics[name] = f'{kind} encoded as {form}'
                elif kinds.setdefault(name, kind) == kind:
                    self._numbers.setdefault(name, []).append(number)
            definitions = _definitions(database, set(kinds.values()), self._room)
            for name, kind in kinds.items():
                self.list_topic(name, kind, 'cdr', None, definitions.get(kind))
            if self.size_bytes > _COUNTED_BYTES or self._tolerant or not self.topics:
                return
            with suppress(sqlite3.Error):
                counts = Counter(number for [number] in database.execute(
                    "SELECT CASE typeof(topic_id) WHEN 'integer' THEN topic_id END "
                    'FROM messages NOT INDEXED'))
                self.topics = [replace(imu, count=sum(
                    counts[number] for number in self._numbers[imu.topic])) for imu in self.topics]

    # ------------------------------------------------------------------------------ going through

    def _pieces(self, database: sqlite3.Connection, budget: Budget, topic: str,
                malformed: MalformedMessages) -> Iterator[tuple[list[Piece], int]]:
        """Join messages of equal size that follow each other; yields thousands, and the place."""
        effort = Effort(self.path, 0)
        left = self._room
        pieces: list[Piece] = []
        parts: list[bytes] = []
        stamps = array('q')
        size = held = held_bytes = position = 0

        def end_piece() -> None:
            if stamps:
                pieces.append(Piece(np.frombuffer(b''.join(parts), np.uint8).reshape(
                    len(stamps), size), np.array(stamps)))
                parts.clear()
                del stamps[:]

        for rows, position in self._fetched(database, budget, topic):
            if held >= _DECODE or held_bytes >= _HELD_BYTES:
                end_piece()
                yield pieces, position
                pieces, held, held_bytes = [], 0, 0
            times, data = zip(*rows, strict=True)
            try:
                joined, received = b''.join(data), array('q', times)
            except TypeError:
                left -= sum(len(str(value)) for row in rows for value in row)
                kept = [(stamp if isinstance(stamp, int) else 0, message)
                        for stamp, message in rows if isinstance(message, bytes)]
                if len(kept) < len(rows):
                    malformed(len(rows) - len(kept), _NO_MESSAGE)
                data = tuple(message for _, message in kept)
                joined, received = b''.join(data), array('q', [stamp for stamp, _ in kept])
            left -= len(joined)
            if left < 0:
                self.remark('damaged_recording', fault='database', places=1, read=held,
                            reason='its messages have more bytes than the file',
                            topic=printable(topic))
                break
            if data and is_compressed(data[0]):
                data = tuple(unpacked_message(message, effort) for message in data)
                joined = b''.join(data)
            longest = max(map(len, data), default=0)
            alike = longest * len(data) == len(joined)
            for length, part, some in [(longest, joined, received)] if alike else zip(
                    map(len, data), data, zip(received, strict=True), strict=True):
                if length != size:
                    end_piece()
                size = length
                parts.append(part)
                stamps.extend(some)
            held, held_bytes = held + len(data), held_bytes + len(joined)
        end_piece()
        yield pieces, position

    def _fetched(self, database: sqlite3.Connection, budget: Budget, topic: str,
                 ) -> Iterator[tuple[list[Row], int]]:
        """Fetch rows, and how far that is; reading goes on behind damaged pages."""
        numbers = self._numbers[self.imu(topic).topic]
        if len(numbers) > _MOST_NUMBERS:
            self.remark('damaged_recording', fault='entries', topic=printable(topic),
                        entries=len(numbers), read=_MOST_NUMBERS)
            numbers = numbers[:_MOST_NUMBERS]
        # The length is known without the value, however long that is.
        query = (f'SELECT timestamp, CASE WHEN length(data) <= {LONGEST_VALUE} THEN data END{{}} '
                 'FROM messages NOT INDEXED WHERE rowid BETWEEN ? AND ? '
                 "AND typeof(topic_id) = 'integer' "
                 f'AND topic_id IN ({",".join(map(str, numbers))}) ORDER BY rowid')
        ends = [0, 0]
        for end, order in enumerate(('ASC', 'DESC')):
            with suppress(sqlite3.Error):
                for [ends[end]] in database.execute(
                        f'SELECT rowid FROM messages NOT INDEXED ORDER BY rowid {order} LIMIT 1'):
                    pass
        first, last = ends
        stretch = max(last - first, 0) // _STRETCHES + 1
        # In a damaged file rows may lie beyond its ends.
        edges = [-2**63, *range(first + stretch, last + 1, stretch), 2**63]
        messages = before = position = 0
        start = first
        try:
            for place, (start, stop) in enumerate(pairwise(edges)):
                before = messages
                position = self.size_bytes * place // (len(edges) - 1)
                cursor = database.execute(query.format(''), (start, stop - 1))
                while rows := cursor.fetchmany(_FETCH):
                    messages += len(rows)
                    yield rows, position
            return
        except sqlite3.Error as error:
            reason = error
        # Again from the last statement on, one by one: what fails takes the rows before it along.
        seen = messages - before
        number, step, places = max(start, first) - 1, 0, 0
        while step < _LONGEST_STEP and places < _MOST_PLACES and not budget.exhausted:
            rows = []
            try:
                for *row, found in database.execute(query.format(', rowid'), (
                        min(number + step + 1, 2**63 - 1), 2**63 - 1)):
                    # Damaged pages may lead back to rows that were read already.
                    if found <= number:
                        continue
                    number, step = found, 0
                    if seen:
                        seen -= 1
                        continue
                    rows.append((row[0], row[1]))
                    if len(rows) == _FETCH:
                        messages += len(rows)
                        yield rows, position
                        rows = []
                step = _LONGEST_STEP
            except sqlite3.Error:
                places += step == 0
                step = max(2 * step, 1)
            if rows:
                messages += len(rows)
                yield rows, position
        self.remark('damaged_recording', fault='database', places=places, reason=printable(reason),
                    read=messages, topic=printable(topic))


def _definitions(database: sqlite3.Connection, kinds: set[str], room: int,
                 ) -> dict[str, Definition]:
    """Look types' definitions up, which bags since ROS 2 Iron hold."""
    found: dict[str, Definition] = {}
    with suppress(sqlite3.Error):
        require_plain_tables(database, ['message_definitions'])
        texts = ', '.join(map(_TEXT.format, (
            'topic_type', 'encoding', 'encoded_message_definition')))
        for kind, form, text in database.execute(
                f'SELECT {texts} FROM message_definitions NOT INDEXED ORDER BY rowid '
                f'LIMIT {_MOST_TOPICS}'):
            room -= len(text)
            if room < 0:
                break
            if kind in kinds and form in FORMS and text.strip():
                found.setdefault(kind, Definition(text, FORMS[form]))
    return found
