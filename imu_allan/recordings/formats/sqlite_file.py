# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The .db3 files of rosbag2's sqlite3 storage.

A recording is never modified. If SQLite has to write, to apply the log that a killed recorder left
beside the file, it does so in a copy.

A database can contain programs: views and virtual tables may compute forever. An overflow page
that points to itself is a gigabyte long, and a tree with shared leaves has more rows than the
disk. So values are bounded, and all statements share a budget of steps that no genuine file of
that size exhausts. See https://sqlite.org/security.html.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import replace
from itertools import islice
import os
from pathlib import Path
import shutil
import sqlite3
import stat
from struct import unpack_from

from imu_allan.block import ImuBlock
from imu_allan.cdr import batches_of, MalformedImu
from imu_allan.errors import error_about, printable
from imu_allan.recordings.formats.decompress import ReadingLimits, unpacked
from imu_allan.recordings.messages.definitions import Definition, FORMS
from imu_allan.recordings.options import RecordingOptions
from imu_allan.recordings.recording import FileRecording, ImuTopic, make_folder, TopicDecoder
import numpy as np


class SqliteRecording(FileRecording):
    """A .db3 file; raises ImuAllanError if it is not a rosbag2 database."""

    def __init__(self, path: Path, stored: Path, options: RecordingOptions) -> None:
        # SQLite looks for the log beside the target of a link, not beside the link.
        super().__init__(path, Path(os.path.realpath(stored)), options)
        self._kinds: dict[str, str] = {}
        self._tolerant = False
        # Rows at the end that may be on an incomplete page, which SQLite pads with zeros.
        self._unsure = 0
        # Bytes of the file and its log, which bound the size of all rows.
        self._room = self.size_bytes
        try:
            self._open(self._log_beside())
        except BaseException:
            self.close()
            raise

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read blocks in the order of recording, each with the number of bytes consumed so far."""
        decode = TopicDecoder(self.imu(topic))
        limits = ReadingLimits(self.path)
        with self._database() as database:
            for stamps, messages, position in self._fetched(database, decode):
                batches = batches_of(messages, np.array(stamps, np.int64))
                for block in decode(unpacked(batches, limits)):
                    yield block, position
        decode.report(self.remark)

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
        try:
            if log is None:
                self._note_missing_end()
            else:
                self._work_on_copy(log)
                with self._database('mode=rw'):
                    # Opening the database applies the log.
                    pass
            definitions = self._described()
        except (sqlite3.Error, OSError) as error:
            if log is not None:
                self.remark('unfinished_recording', fault='unusable', file=printable(log.name),
                            reason=printable(error))
            self._tolerant = True
            try:
                definitions = self._described()
            except sqlite3.Error:
                raise error_about(self.path, 'not a readable rosbag2 database '
                                  f'({printable(error)})') from error
        for name, kind in self._kinds.items():
            self.list_topic(name, kind, 'cdr', None, definitions.get(kind))
        with suppress(sqlite3.Error), self._database() as database:
            self.topics = [imu if self._has_rows(database, imu) else replace(imu, count=0)
                           for imu in self.topics]
            self.ends_ns = [stamp for order in ('ASC', 'DESC') for [stamp] in database.execute(
                f'SELECT timestamp FROM messages ORDER BY rowid {order} LIMIT 1')
                if isinstance(stamp, int)]

    def _work_on_copy(self, log: Path) -> None:
        folder, room = make_folder()
        self.folders.append(folder)
        if self._room > room:
            raise OSError(f'no room for a copy in {folder.parent}; name a larger folder with '
                          'TMPDIR')
        for file in (log, self._stored):
            shutil.copyfile(file, folder / file.name, follow_symlinks=False)
        self._stored = folder / self._stored.name

    def _note_missing_end(self) -> None:
        """Add a remark if the file is shorter than its header says, and tolerate that."""
        with self._stored.open('rb') as file:
            header = file.read(100).ljust(100, b'\0')
        [page_size] = unpack_from('>H', header, 16)
        page_size = 65536 if page_size == 1 else page_size
        [changes, pages] = unpack_from('>II', header, 24)
        [counted_at] = unpack_from('>I', header, 92)
        missing = pages * page_size - self.size_bytes
        # The page count is valid only if it was written with the latest change.
        if changes == counted_at and missing > 0:
            self.remark('truncated_recording', fault='database', missing_bytes=missing,
                        bytes=pages * page_size, lost_share=missing / (pages * page_size))
            self._tolerant, self._unsure = True, page_size // 256

    @contextmanager
    def _database(self, mode: str = 'immutable=1') -> Iterator[sqlite3.Connection]:
        """
        Open the database with a budget for its size; raise sqlite3.Error if it is none.

        Opened as immutable, SQLite reads only this file, creates none, and takes no lock that a
        recorder could meet. If tolerant, a file shorter than its header says is read as far as it
        goes.
        """
        uri = f'{self._stored.absolute().as_uri()}?{mode}'
        with closing(sqlite3.connect(uri, uri=True)) as database:
            database.text_factory = lambda data: data.decode('utf-8', 'replace')
            database.execute('PRAGMA trusted_schema = OFF')
            # Python 3.10 has no limits.
            if hasattr(database, 'setlimit'):
                # An Imu has 324 bytes plus its frame_id; definitions are the longest values.
                database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, 1 << 20)
            if self._tolerant:
                database.execute('PRAGMA writable_schema = ON')
            # Enough for a schema of some 2,000 entries; rosbag2 writes 6.
            _limit_steps(database, 50)
            database.execute('SELECT * FROM sqlite_master LIMIT 0')
            # A row takes 7 to 25 steps, and occupies at least 14 bytes.
            _limit_steps(database, 20_000 + self._room // 500)
            yield database

    def _described(self) -> dict[str, Definition]:
        """Look up the types of the topics; return those definitions that the file has of them."""
        found: dict[str, Definition] = {}
        with self._database() as database:
            database.execute('SELECT id, topic_id, timestamp, data FROM messages LIMIT 0')
            self._kinds = {}
            for name, kind, form in _texts(
                    database, 'topics', 'name', 'type', 'serialization_format'):
                if form != 'cdr':
                    self.other_topics[name] = f'{kind} encoded as {form}'
                else:
                    self._kinds.setdefault(name, kind)
            kinds = set(self._kinds.values())
            # Bags contain definitions since ROS 2 Iron.
            with suppress(sqlite3.Error):
                for kind, form, text in _texts(database, 'message_definitions', 'topic_type',
                                               'encoding', 'encoded_message_definition'):
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

    def _fetched(self, database: sqlite3.Connection, decode: TopicDecoder,
                 ) -> Iterator[tuple[Sequence[int], Sequence[bytes], int]]:
        """Fetch hundreds of messages at a time, with stamps and bytes consumed, up to damage."""
        first, last = self.ends_ns if len(self.ends_ns) == 2 else (0, 0)
        read = all_bytes = 0
        share, damage = 0.0, ''
        rows: list[tuple[int, bytes]] = []
        cursor: Iterator[tuple[int, bytes]] | None = None
        most = 512
        while not damage:
            held = len(rows)
            try:
                cursor = cursor or database.execute(
                    'SELECT timestamp, data FROM messages NOT INDEXED '
                    f'WHERE topic_id IN ({self._numbers(database, decode.imu)}) ORDER BY rowid')
                # Those before a damaged one stay in the list.
                rows.extend(islice(cursor, most))
            except sqlite3.Error as error:
                damage = printable(error)
            else:
                if len(rows) == held:
                    return
            sure = max(len(rows) - self._unsure, 0)
            read += sure
            stamps, messages = _columns(rows[:sure], decode)
            rows = rows[sure:]
            if not messages:
                continue
            all_bytes += sum(map(len, messages))
            # A megabyte at a time fits into the cache.
            most = min(max((1 << 20) // max(len(messages[-1]), 1), 64), 2048)
            if all_bytes > self._room:
                damage = damage or 'its messages have more bytes than the file'
            share = min(max((stamps[-1] - first) / max(last - first, 1), 0.0), 1.0)
            yield stamps, messages, int(share * self.size_bytes)
        self.remark('damaged_recording', fault='database', reason=damage, read=read,
                    topic=printable(decode.imu.name), lost_share=1 - share)


def _columns(rows: list[tuple[int, bytes]], decode: TopicDecoder) -> tuple[list[int], list[bytes]]:
    """Return stamps and messages; a value may have any type, whatever its column has."""
    blobs = [row for row in rows if type(row[1]) is bytes]
    if len(blobs) < len(rows):
        decode.reject(len(rows) - len(blobs), MalformedImu('not a blob'))
    return ([stamp if type(stamp) is int else 0 for stamp, _ in blobs],
            [message for _, message in blobs])


def _texts(database: sqlite3.Connection, table: str, *columns: str) -> Iterator[Sequence[str]]:
    """Read columns of a table; what is no text becomes an empty one."""
    texts = ', '.join(f"CASE typeof({name}) WHEN 'text' THEN {name} ELSE '' END"
                      for name in columns)
    return database.execute(
        f'SELECT {texts} FROM {table} NOT INDEXED ORDER BY rowid LIMIT {1 << 16}')


def _limit_steps(database: sqlite3.Connection, thousands: int) -> None:
    """Let all statements together take so many thousand steps of SQLite's virtual machine."""
    left = iter(range(thousands))
    database.set_progress_handler(lambda: next(left, None) is None, 1000)
