# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
SQLite on a file that anybody may have made, and that is never written to.

A database holds programs beside data: views, generated columns and virtual tables compute without
end. An overflow page that follows itself is a gigabyte, and a tree whose branches share leaves has
more rows than the disk. So only plain tables are read, every statement has a budget of steps that
no honest file of its size uses up, and values are bounded. After https://sqlite.org/security.html,
as far as Python reaches.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
import sqlite3

from imu_allan.errors import printable, shorten

LONGEST_VALUE = 1 << 20
"""Bytes of a text or a blob; an Imu has 324 and its frame_id, definitions are the longest."""
_LIMITS = {
    'SQLITE_LIMIT_LENGTH': LONGEST_VALUE,
    'SQLITE_LIMIT_SQL_LENGTH': 100_000,     # rosbag2's longest statement has 200
    'SQLITE_LIMIT_COLUMN': 100,             # rosbag2's widest table has 6
    'SQLITE_LIMIT_EXPR_DEPTH': 50,          # our own deepest expression has 5
    'SQLITE_LIMIT_COMPOUND_SELECT': 3,
    'SQLITE_LIMIT_VDBE_OP': 25_000,
    'SQLITE_LIMIT_FUNCTION_ARG': 8,
    'SQLITE_LIMIT_ATTACHED': 0,
}
_STEPS_AT_A_TIME = 1000
"""Between two calls into Python, which cost nothing beside so many; the budget ends as exactly."""


class Budget:
    """Steps of SQLite's machine that all statements on a database may take together."""

    def __init__(self, steps: int) -> None:
        self._steps = steps

    @property
    def exhausted(self) -> bool:
        """Whether it is used up: then every further statement fails."""
        return self._steps <= 0

    def spend(self) -> bool:
        """Count steps; True ends the statement."""
        self._steps -= _STEPS_AT_A_TIME
        return self.exhausted


@contextmanager
def untrusted_database(path: Path, size_bytes: int, mode: str = 'immutable=1', *,
                       tolerant: bool = False) -> Iterator[tuple[sqlite3.Connection, Budget]]:
    """
    Open a database with the budget of its size; raises sqlite3.Error.

    As immutable, nothing but the file is looked at, no file created and no lock taken that a
    recorder could meet. `tolerant` reads a file that is shorter than it says as far as it goes.
    """
    database = sqlite3.connect(f'{path.absolute().as_uri()}?{mode}', uri=True)
    try:
        database.text_factory = lambda data: data.decode('utf-8', 'replace')
        database.execute('PRAGMA trusted_schema = OFF')
        database.execute('PRAGMA cell_size_check = ON')
        if hasattr(database, 'setlimit'):
            for name, limit in _LIMITS.items():
                database.setlimit(getattr(sqlite3, name), limit)
        else:
            # Before Python 3.11 a single value cannot be limited, but all memory can.
            database.execute(f'PRAGMA hard_heap_limit = {1 << 28}')
        if tolerant:
            database.execute('PRAGMA writable_schema = ON')
        _require_plain_schema(database)
        # A row takes 7 to 25 steps of SQLite's machine, and 14 bytes at least.
        budget = Budget(20_000_000 + 2 * size_bytes)
        database.set_progress_handler(budget.spend, _STEPS_AT_A_TIME)
        yield database, budget
    finally:
        database.close()


def require_plain_tables(database: sqlite3.Connection, names: Sequence[str]) -> None:
    """Make sure that whatever is read of these tables stands in the file as it is."""
    for name in names:
        for column, hidden in database.execute(
                'SELECT name, hidden FROM pragma_table_xinfo(?)', (name,)):
            if hidden:
                raise sqlite3.DatabaseError(
                    f'column {printable(shorten(column, 60))} of {name} is computed')
        database.execute(f'SELECT rowid FROM {name} NOT INDEXED LIMIT 0')


def _require_plain_schema(database: sqlite3.Connection) -> None:
    # Enough for a schema of some 2,000 entries, of which rosbag2 writes 6.
    schema = Budget(50_000)
    database.set_progress_handler(schema.spend, _STEPS_AT_A_TIME)
    try:
        for name, beginning in database.execute(
                'SELECT CAST(name AS TEXT), lower(substr(CAST(sql AS TEXT), 1, 20)) '
                'FROM sqlite_master WHERE sql NOT NULL'):
            # What an entry is its text says; its name and its type may say anything.
            if not beginning.startswith(
                    ('create table ', 'create index ', 'create unique index ')):
                raise sqlite3.DatabaseError(
                    f'{printable(shorten(name or "", 60))} is neither a table nor an index, and '
                    'rosbag2 writes nothing else')
    except sqlite3.OperationalError as error:
        if schema.exhausted:
            raise sqlite3.DatabaseError('its schema has thousands of entries') from error
        raise
