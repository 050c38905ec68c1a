# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The .db3 files of rosbag2's sqlite3 storage.

A recording is never modified. If SQLite has to write, to apply the log that a killed recorder left
beside the file, it does so in a copy.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from itertools import pairwise
import os
from pathlib import Path
import shutil
import sqlite3
import stat
from struct import unpack_from
import tempfile

from imu_allan.block import ImuBlock
from imu_allan.cdr import batches_of, MalformedImu
from imu_allan.errors import ImuAllanError, printable
from imu_allan.recordings.formats.decompress import ReadingLimits, unpacked
from imu_allan.recordings.formats.temporary_folder import make_folder, room_in
from imu_allan.recordings.formats.untrusted_database import (
    Budget,
    LONGEST_VALUE,
    require_plain_tables,
    untrusted_database,
)
from imu_allan.recordings.imu_topic import ImuTopic, MalformedMessages
from imu_allan.recordings.messages.definitions import Definition, FORMS
from imu_allan.recordings.options import RecordingOptions
from imu_allan.recordings.recording import FileRecording
import numpy as np

_TEXT = "CASE typeof({0}) WHEN 'text' THEN {0} ELSE '' END"


class SqliteRecording(FileRecording):
    """A .db3 file; raises ImuAllanError if it is not a rosbag2 database."""

    def __init__(self, path: Path, stored: Path, options: RecordingOptions) -> None:
        # SQLite looks for the log beside the target of a link, not beside the link.
        super().__init__(path, Path(os.path.realpath(stored)), options)
        self._kinds: dict[str, str] = {}
        self._tolerant = False
        # Bytes of the file and its log, which bound the size of all rows.
        self._room = self.size_bytes
        try:
            self._open(self._log_beside())
        except BaseException:
            self.close()
            raise

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read blocks in the order of recording, each with the number of bytes consumed so far."""
        imu = self.imu(topic)
        decode, malformed = imu.messages.decoder(), MalformedMessages()
        limits = ReadingLimits(self.path, 0)
        with self._database() as (database, budget):
            for stamps, messages, position in self._fetched(database, budget, imu, malformed):
                batches = batches_of(messages, np.array(stamps, np.int64))
                for block in decode(unpacked(batches, limits), malformed):
                    yield block, position
        malformed.report(imu, self.remark)

    # ---------------------------------------------------------------------------- what is there

    def _log_beside(self) -> Path | None:
        """Find the write-ahead log of a killed recorder; ignore a rollback journal."""
        for kind in ('journal', 'wal'):
            path = self._stored.with_name(f'{self._stored.name}-{kind}')
            with suppress(OSError):
                status = path.lstat()
                if not stat.S_ISREG(status.st_mode):
                    self.remark('unfinished_recording', fault='not_regular',
                                file=printable(path.name))
                elif status.st_size and kind == 'wal':
                    self._room += status.st_size
                    return path
                elif status.st_size:
                    # A journal may name another file, which SQLite would then delete.
                    self.remark('unfinished_recording', fault='unusable',
                                file=printable(path.name), reason='rosbag2 leaves none')
        return None

    def _open(self, log: Path | None) -> None:
        """List the topics; tolerate damage only if the file cannot be read otherwise."""
        reason: Exception
        try:
            if log is None:
                self._cut_last_page()
            else:
                self._work_on_copy(log)
                with untrusted_database(self._stored, 0, 'mode=rw'):
                    # Opening the database applies the log.
                    pass
            definitions = self._described()
        except (sqlite3.Error, OSError) as error:
            reason = error
            if log is not None:
                self.remark('unfinished_recording', fault='unusable', file=printable(log.name),
                            reason=printable(reason))
            self._tolerant = True
            try:
                definitions = self._described()
            except sqlite3.Error:
                raise ImuAllanError(f'{printable(self.path)}: not a readable rosbag2 database '
                                    f'({printable(reason)})') from reason
        for name, kind in self._kinds.items():
            self.list_topic(name, kind, 'cdr', None, definitions.get(kind))
        with suppress(sqlite3.Error), self._database() as (database, _):
            self.topics = [imu if self._has_rows(database, imu) else replace(imu, count=0)
                           for imu in self.topics]
            self.ends_ns = [stamp for order in ('ASC', 'DESC') for [stamp] in database.execute(
                f'SELECT timestamp FROM messages ORDER BY rowid {order} LIMIT 1')
                if isinstance(stamp, int)]

    def _work_on_copy(self, *beside: Path) -> None:
        if self._room > room_in(tempfile.gettempdir()):
            raise OSError(f'no room for a copy in {tempfile.gettempdir()}; name a larger folder '
                          'with TMPDIR')
        self.folders.append(make_folder())
        for file in (*beside, self._stored):
            shutil.copyfile(file, self.folders[-1] / file.name, follow_symlinks=False)
        self._stored = self.folders[-1] / self._stored.name

    def _cut_last_page(self) -> None:
        """Work on a copy without an incomplete last page, which SQLite would pad."""
        with self._stored.open('rb') as file:
            header = file.read(100).ljust(100, b'\0')
        [page_size] = unpack_from('>H', header, 16)
        page_size = 65536 if page_size == 1 else page_size
        [changes, pages] = unpack_from('>II', header, 24)
        [counted_at] = unpack_from('>I', header, 92)
        missing = pages * page_size - self.size_bytes
        # The page count is valid only if it was written with the latest change.
        if changes != counted_at or missing <= 0:
            return
        self.remark('truncated_recording', fault='database', missing_bytes=missing,
                    bytes=pages * page_size, lost_share=missing / (pages * page_size))
        self._tolerant = True
        if missing % page_size:
            try:
                self._work_on_copy()
            except OSError as error:
                raise ImuAllanError(f'{printable(self.path)}: cut short, and {printable(error)}'
                                    ) from error
            os.truncate(self._stored, self.size_bytes // page_size * page_size)

    @contextmanager
    def _database(self) -> Iterator[tuple[sqlite3.Connection, Budget]]:
        with untrusted_database(self._stored, self._room, tolerant=self._tolerant) as opened:
            require_plain_tables(opened[0], ('messages', 'topics'))
            yield opened

    def _described(self) -> dict[str, Definition]:
        """Look up the types of the topics; return the available definitions of them."""
        with self._database() as (database, _):
            database.execute('SELECT id, topic_id, timestamp, data FROM messages LIMIT 0')
            self._kinds = {}
            texts = ', '.join(map(_TEXT.format, ('name', 'type', 'serialization_format')))
            for name, kind, form in database.execute(
                    f'SELECT {texts} FROM topics NOT INDEXED ORDER BY rowid'):
                if not self.reserve_bytes(len(name) + len(kind) + len(form)):
                    break
                if form != 'cdr':
                    self.other_topics[name] = f'{kind} encoded as {form}'
                else:
                    self._kinds.setdefault(name, kind)
            return self._definitions(database, set(self._kinds.values()))

    def _definitions(self, database: sqlite3.Connection, kinds: set[str],
                     ) -> dict[str, Definition]:
        """Look up the definitions of types, which bags contain since ROS 2 Iron."""
        found: dict[str, Definition] = {}
        with suppress(sqlite3.Error):
            require_plain_tables(database, ['message_definitions'])
            texts = ', '.join(map(_TEXT.format, (
                'topic_type', 'encoding', 'encoded_message_definition')))
            for kind, form, text in database.execute(
                    f'SELECT {texts} FROM message_definitions NOT INDEXED ORDER BY rowid'):
                if not self.reserve_bytes(len(text)):
                    break
                if kind in kinds and form in FORMS and text.strip():
                    found.setdefault(kind, Definition(text, FORMS[form]))
        return found

    def _has_rows(self, database: sqlite3.Connection, imu: ImuTopic) -> bool:
        """Return whether a topic has messages; in a large file, whether any topic has."""
        # To search a large file for a message of each topic would make opening slow.
        only = '' if self._tolerant or self.size_bytes > 1 << 26 else (
            f'WHERE topic_id IN ({self._numbers(database, imu)}) ')
        return bool(database.execute(
            f'SELECT rowid FROM messages NOT INDEXED {only}LIMIT 1').fetchall())

    def _numbers(self, database: sqlite3.Connection, imu: ImuTopic) -> str:
        """List the ids of a topic; rosbag2 assigns one."""
        return ','.join(str(number) for [number] in database.execute(
            'SELECT rowid FROM topics NOT INDEXED '
            "WHERE name = ? AND type = ? AND serialization_format = 'cdr'",
            (imu.topic, self._kinds[imu.topic])))

    # ------------------------------------------------------------------------------ going through

    def _fetched(self, database: sqlite3.Connection, budget: Budget, imu: ImuTopic,
                 malformed: MalformedMessages,
                 ) -> Iterator[tuple[list[int], list[bytes], int]]:
        """Fetch thousands of messages at a time, past damage, with stamps and bytes consumed."""
        # SQLite knows type and length without loading the value, however long it is.
        query = ("SELECT rowid, CASE typeof(timestamp) WHEN 'integer' THEN timestamp ELSE 0 END, "
                 f"CASE WHEN typeof(data) = 'blob' AND length(data) <= {LONGEST_VALUE} "
                 'THEN data END FROM messages NOT INDEXED WHERE rowid BETWEEN ? AND ? '
                 "AND typeof(topic_id) = 'integer' "
                 f'AND topic_id IN ({self._numbers(database, imu)}) ORDER BY rowid')
        edges = _parts_of_rows(database)
        # All messages together cannot exceed the bytes of file and log.
        read = places = handed = held_bytes = position = 0
        step, latest, left = 1, -2**63, self._room
        stamps: list[int] = []
        messages: list[bytes] = []
        reason: sqlite3.Error | None = None
        for place, (start, stop) in enumerate(pairwise(edges)):
            # Few enough rows to hold in memory even if all are as large as permitted.
            most = 64
            # Give up after a thousand damaged places.
            while start < stop and places < 1000 and not budget.exhausted and left >= 0:
                before = latest
                try:
                    cursor = database.execute(query, (start, stop - 1))
                    while found := cursor.fetchmany(most):
                        # This many messages fit into the cache, unless they are large.
                        if len(messages) >= 1 << 11 or held_bytes >= 1 << 24:
                            yield stamps, messages, position
                            handed += len(messages)
                            stamps, messages, held_bytes = [], [], 0
                        position = self.size_bytes * place // (len(edges) - 1)
                        held = len(messages)
                        for number, stamp, message in found:
                            # Damaged pages may point back to rows that were already read.
                            if number <= latest:
                                continue
                            latest = number
                            read += 1
                            if message is None:
                                malformed(1, MalformedImu(
                                    f'not a blob of {LONGEST_VALUE:,} bytes at most'))
                                continue
                            stamps.append(stamp)
                            messages.append(message)
                        size = sum(map(len, messages[held:]))
                        held_bytes += size
                        left -= size
                        if left < 0:
                            del stamps[held:], messages[held:]
                            self.remark('damaged_recording', fault='database', places=1,
                                        read=handed + held, topic=printable(imu.name),
                                        reason='its messages have more bytes than the file')
                            break
                    start, step = stop, 1
                except sqlite3.Error as error:
                    reason = reason or error
                    if latest > before:
                        start, step = max(start, latest + 1), 1
                    elif most == 1:
                        places += step == 1
                        start, step = start + step, 2 * step
                    # After a failure fetch row by row, as it also discards good rows of the same
                    # fetch.
                    most = 1
        if messages:
            yield stamps, messages, position
        if reason is not None and left >= 0:
            self.remark('damaged_recording', fault='database', places=places,
                        reason=printable(reason), read=read, topic=printable(imu.name))


def _parts_of_rows(database: sqlite3.Connection) -> list[int]:
    """Return the edges of 200 parts of all rows, to report progress from one to the next."""
    ends = [0, 0]
    for end, order in enumerate(('ASC', 'DESC')):
        with suppress(sqlite3.Error):
            for [ends[end]] in database.execute(
                    f'SELECT rowid FROM messages NOT INDEXED ORDER BY rowid {order} LIMIT 1'):
                pass
    first, last = sorted(ends)
    span = (last - first) // 200 + 1
    # In a damaged file, rows may lie beyond the first and last one found.
    return [first, *range(first + span, last + 1, span), 2**63]
