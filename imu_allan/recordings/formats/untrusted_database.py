# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
SQLite access to a file from an untrusted source, which is never written to.

A database can contain programs: views and virtual tables may compute forever. An overflow page
that points to itself is a gigabyte long, and a tree with shared leaves has more rows than the
disk. So values are bounded, and all statements share a budget of steps that no genuine file of
that size exhausts. See https://sqlite.org/security.html.
"""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
import sqlite3

LONGEST_VALUE = 1 << 20
"""Bytes of a text or blob. An Imu has 324 plus its frame_id; definitions are the longest."""


@contextmanager
def untrusted_database(path: Path, size_bytes: int, mode: str = 'immutable=1', *,
                       tolerant: bool = False) -> Iterator[sqlite3.Connection]:
    """
    Open a database with a budget for its size; raise sqlite3.Error if it is none.

    Opened as immutable, SQLite reads only this file, creates none, and takes no lock that a
    recorder could meet. With `tolerant`, a file shorter than its header says is read as far as it
    goes.
    """
    with closing(sqlite3.connect(f'{path.absolute().as_uri()}?{mode}', uri=True)) as database:
        database.text_factory = lambda data: data.decode('utf-8', 'replace')
        database.execute('PRAGMA trusted_schema = OFF')
        # Python 3.10 has no limits.
        if hasattr(database, 'setlimit'):
            database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LONGEST_VALUE)
        if tolerant:
            database.execute('PRAGMA writable_schema = ON')
        # Enough for a schema of some 2,000 entries; rosbag2 writes 6.
        _limit_steps(database, 50)
        database.execute('SELECT * FROM sqlite_master LIMIT 0')
        # A row takes 7 to 25 steps, and occupies at least 14 bytes.
        _limit_steps(database, 20_000 + size_bytes // 500)
        yield database


def _limit_steps(database: sqlite3.Connection, thousands: int) -> None:
    """Let all statements together take so many thousand steps of SQLite's virtual machine."""
    left = iter(range(thousands))
    database.set_progress_handler(lambda: next(left, None) is None, 1000)
