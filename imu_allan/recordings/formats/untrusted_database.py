# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
SQLite access to a file from an untrusted source, which is never written to.

A database can contain programs: views, generated columns and virtual tables may compute forever.
An overflow page that points to itself is a gigabyte long, and a tree with shared leaves has more
rows than the disk. So only plain tables are read, values are bounded, and statements share a
budget of steps that no genuine file of that size exhausts. This follows
https://sqlite.org/security.html, as far as Python permits.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
import sqlite3

from imu_allan.errors import brief

LONGEST_VALUE = 1 << 20
"""Bytes of a text or blob. An Imu has 324 plus its frame_id; definitions are the longest."""
_STEPS_AT_A_TIME = 1000
"""Steps between two calls of the progress handler, so that its cost is negligible. This is also
the resolution of the budget."""


class Budget:
    """Steps of the SQLite virtual machine that all statements together may take."""

    def __init__(self, steps: int) -> None:
        self._steps = steps

    @property
    def exhausted(self) -> bool:
        """Return whether the budget is used up, so that every further statement fails."""
        return self._steps <= 0

    def spend(self) -> bool:
        """Count steps; True aborts the statement."""
        self._steps -= _STEPS_AT_A_TIME
        return self.exhausted


@contextmanager
def untrusted_database(path: Path, size_bytes: int, mode: str = 'immutable=1', *,
                       tolerant: bool = False) -> Iterator[tuple[sqlite3.Connection, Budget]]:
    """
    Open a database with a budget for its size; raise sqlite3.Error if it cannot be read.

    Opened as immutable, SQLite reads only this file, creates none, and takes no lock that a
    recorder could meet. With `tolerant`, a file shorter than its header says is read as far as it
    goes.
    """
    database = sqlite3.connect(f'{path.absolute().as_uri()}?{mode}', uri=True)
    limits = {
        'SQLITE_LIMIT_LENGTH': LONGEST_VALUE,
        'SQLITE_LIMIT_SQL_LENGTH': 100_000,     # rosbag2's longest statement has 200
        'SQLITE_LIMIT_COLUMN': 100,             # rosbag2's widest table has 6
        'SQLITE_LIMIT_EXPR_DEPTH': 50,          # our own deepest expression has 5
        'SQLITE_LIMIT_COMPOUND_SELECT': 3,
        'SQLITE_LIMIT_VDBE_OP': 25_000,
        'SQLITE_LIMIT_FUNCTION_ARG': 8,
        'SQLITE_LIMIT_ATTACHED': 0,
    }
    try:
        database.text_factory = lambda data: data.decode('utf-8', 'replace')
        database.execute('PRAGMA trusted_schema = OFF')
        database.execute('PRAGMA cell_size_check = ON')
        if hasattr(database, 'setlimit'):
            for name, limit in limits.items():
                database.setlimit(getattr(sqlite3, name), limit)
        else:
            # Python before 3.11 cannot limit a single value, only the total memory.
            database.execute(f'PRAGMA hard_heap_limit = {1 << 28}')
        if tolerant:
            database.execute('PRAGMA writable_schema = ON')
        _require_plain_schema(database)
        # A row takes 7 to 25 steps, and occupies at least 14 bytes.
        budget = Budget(20_000_000 + 2 * size_bytes)
        database.set_progress_handler(budget.spend, _STEPS_AT_A_TIME)
        yield database, budget
    finally:
        database.close()


def require_plain_tables(database: sqlite3.Connection, names: Sequence[str]) -> None:
    """Check that the columns of these tables are stored, not computed."""
    for name in names:
        for column, hidden in database.execute(
                'SELECT name, hidden FROM pragma_table_xinfo(?)', (name,)):
            if hidden:
                raise sqlite3.DatabaseError(
                    f'column {brief(column, 60)} of {name} is computed')
        database.execute(f'SELECT rowid FROM {name} NOT INDEXED LIMIT 0')


def _require_plain_schema(database: sqlite3.Connection) -> None:
    # Enough for a schema of some 2,000 entries; rosbag2 writes 6.
    schema = Budget(50_000)
    database.set_progress_handler(schema.spend, _STEPS_AT_A_TIME)
    try:
        for name, beginning in database.execute(
                'SELECT CAST(name AS TEXT), lower(substr(CAST(sql AS TEXT), 1, 20)) '
                'FROM sqlite_master WHERE sql NOT NULL'):
            # The SQL text defines what an entry is; its name and type columns may be forged.
            if not beginning.startswith(
                    ('create table ', 'create index ', 'create unique index ')):
                raise sqlite3.DatabaseError(
                    f'{brief(name or "", 60)} is neither a table nor an index, and '
                    'rosbag2 writes nothing else')
    except sqlite3.OperationalError as error:
        if schema.exhausted:
            raise sqlite3.DatabaseError('its schema has thousands of entries') from error
        raise
