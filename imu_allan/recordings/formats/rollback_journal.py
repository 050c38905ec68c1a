# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What SQLite leaves beside a database in the middle of a transaction.

A journal is undone in a copy, since that writes. It may name another file, the super-journal of a
transaction over several databases, which SQLite removes once the journal is undone: whichever file
that is. rosbag2 writes to one database, so a journal that names another file is not used at all.
"""

from __future__ import annotations

import os
from pathlib import Path
import shutil
import sqlite3
import stat

from imu_allan.recordings.formats.untrusted_database import Budget, untrusted_database

_MAGIC = bytes.fromhex('d9d505f920a163d7')
"""At the very end of a journal: the name of a super-journal stands before it."""


def left_beside(file: Path) -> tuple[list[Path], list[Path]]:
    """
    Find what a recorder left beside its database.

    Returns
    -------
    usable : list of Path
        Write-ahead log and journal that are not empty.
    strange : list of Path
        Files of such names that no recorder leaves: links, pipes, folders.

    """
    usable, strange = [], []
    for kind in ('wal', 'journal', 'shm'):
        path = file.with_name(f'{file.name}-{kind}')
        try:
            status = path.lstat()
        except OSError:
            continue
        if not stat.S_ISREG(status.st_mode):
            strange.append(path)
        elif status.st_size and kind != 'shm':
            usable.append(path)
    return usable, strange


def copy_plain(file: Path, folder: Path) -> Path:
    """
    Copy a regular file; what became a link in the meantime is not followed.

    Raises
    ------
    OSError
        If it is no regular file, or there is no room.

    """
    copy = folder / file.name
    # Not to be kept waiting by a pipe either.
    handle = os.open(file, os.O_RDONLY | getattr(os, 'O_NOFOLLOW', 0)
                     | getattr(os, 'O_NONBLOCK', 0))
    with os.fdopen(handle, 'rb') as source, copy.open('xb') as target:
        if not stat.S_ISREG(os.fstat(source.fileno()).st_mode):
            raise OSError(None, 'not a regular file', os.fspath(file))
        shutil.copyfileobj(source, target, 1 << 20)
    return copy


def roll_back(copy: Path) -> None:
    """
    Undo the unfinished transaction of a copied database by the journal copied with it.

    Raises
    ------
    sqlite3.Error
        If the journal names another file, or cannot be used.

    """
    journal = copy.with_name(f'{copy.name}-journal')
    if journal.exists():
        with journal.open('rb') as file:
            file.seek(max(journal.stat().st_size - len(_MAGIC), 0))
            if file.read() == _MAGIC:
                raise sqlite3.DatabaseError('it names another file, which rosbag2 never does')
    with untrusted_database(copy, 'mode=rw', Budget(0)):
        # The first look into the file has done it.
        pass
