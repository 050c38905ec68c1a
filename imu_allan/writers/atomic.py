# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Writing a file so that a reader sees the old content or the new, never a part."""

import contextlib
import os
from pathlib import Path
import tempfile

from imu_allan.errors import ImuAllanError


def write_atomically(path: str | os.PathLike[str], data: bytes) -> None:
    """
    Replace the content of `path` by `data`, all of it or nothing.

    The bytes reach the disk under another name in the same folder before the name changes hands,
    so that a crash or a power cut leaves the old file. Folders that are missing are made; a
    symbolic link is followed; the permissions of a file that is replaced are kept.

    Raises
    ------
    ImuAllanError
        If the file cannot be written; the message names it and the reason.

    """
    target = Path(os.path.realpath(path))
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        if target.is_dir():
            raise IsADirectoryError(None, 'is a directory')
        handle, temporary = tempfile.mkstemp(prefix=f'.{target.name[:100]}.', dir=target.parent)
        try:
            with os.fdopen(handle, 'wb') as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            Path(temporary).chmod(_mode(target))
            Path(temporary).replace(target)
        except BaseException:
            with contextlib.suppress(FileNotFoundError):
                Path(temporary).unlink()
            raise
        _sync_folder(target.parent)
    except OSError as error:
        raise ImuAllanError(
            f'{path}: cannot be written ({error.strerror or error}); '
            'choose a folder that exists on a disk with room and may be written to') from error


def _mode(target: Path) -> int:
    try:
        return target.stat().st_mode & 0o777
    except FileNotFoundError:
        mask = os.umask(0)
        os.umask(mask)
        return 0o666 & ~mask


def _sync_folder(folder: Path) -> None:
    # Windows cannot open a folder, and some network file systems cannot sync one.
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
