# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Resolution and locking of output paths.

In a folder that everybody may write to, such as /tmp, another user may have placed a symbolic link
where an output is expected. The output would then go wherever the link leads. Linux refuses to
follow such links if fs.protected_symlinks is set. This module always refuses them, and also links
of other users in subfolders that other users created there. Links created between check and
writing are not followed either: the folder is opened step by step, and the file is created
relative to the open folder.
"""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import errno
import os
from pathlib import Path
import stat
import time

from imu_allan.errors import ImuAllanError, printable

LOCK_TIMEOUT_S = 30.0
"""Seconds to wait for the lock of a folder. Writing takes seconds; a longer lock is not
transient."""


def resolved(path: str | os.PathLike[str]) -> Path:
    """
    Return the absolute path without symbolic links, like ``os.path.realpath``.

    Raises OSError for a link in or below a folder that everybody may write to, unless this user or
    root owns the link.
    """
    if os.name != 'posix':
        return Path(os.path.realpath(path))
    pending = os.path.join(Path.cwd(), path).split('/')[::-1]  # noqa: PTH118
    current = '/'
    links, shared = 0, False
    while pending:
        part = pending.pop()
        if part in ('', '.'):
            continue
        if part == '..':
            current = str(Path(current).parent)
            continue
        step = os.path.join(current, part)  # noqa: PTH118
        shared = shared or _is_world_writable(current)
        if not Path(step).is_symlink():
            current = step
            continue
        links += 1
        # The limit of Linux.
        if links > 40:
            raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), os.fspath(path))
        if shared and os.lstat(step).st_uid not in (os.geteuid(), 0):
            raise OSError(None, f'{step} is a link that another user put into a folder that '
                          'everybody may write to', step)
        target = str(Path(step).readlink())
        if target.startswith('/'):
            # The owner of the link is trusted for its target.
            current, shared = '/', False
        pending += target.split('/')[::-1]
    return Path(current)


def require_writable(folder: str | os.PathLike[str]) -> None:
    """
    Raise ImuAllanError if a folder cannot be written to, before any work is done.

    A missing folder is not created; instead, its nearest existing parent has to be a writable
    folder. A full disk is not detected.
    """
    nearest = Path(os.path.abspath(folder))  # noqa: PTH100
    try:
        while not os.path.lexists(nearest):
            nearest = nearest.parent
        reason = ('is not a folder' if not nearest.is_dir() else
                  '' if os.access(nearest, os.W_OK | os.X_OK) else
                  f'lies on a {os.strerror(errno.EROFS)}'
                  if os.statvfs(nearest).f_flag & os.ST_RDONLY else 'may not be written to')
    except (OSError, ValueError) as error:
        reason = f'cannot be looked at ({error})'
    if reason:
        raise ImuAllanError(f'{printable(folder)}: cannot be written ({printable(nearest)} '
                            f'{reason}); choose a folder that may be written to')


def open_folder(path: Path) -> int:
    """
    Open a folder without following a link at any step; create it if missing.

    `path` is absolute and without links, as returned by `resolved`. Use the descriptor as
    ``dir_fd``. Raises OSError if a step is not a folder, cannot be created or traversed, or has
    become a link.
    """
    # O_PATH: folders on the path may permit traversal without permitting listing.
    flags = os.O_RDONLY
    for name in ('O_DIRECTORY', 'O_NOFOLLOW', 'O_PATH'):
        flags |= getattr(os, name, 0)
    handle = os.open('/', flags)
    try:
        for part in path.parts[1:]:
            try:
                os.stat(part, dir_fd=handle, follow_symlinks=False)
            except FileNotFoundError:
                with contextlib.suppress(FileExistsError):
                    os.mkdir(part, dir_fd=handle)
            try:
                step = os.open(part, flags, dir_fd=handle)
            except OSError as error:
                raise OSError(error.errno, error.strerror, str(path)) from error
            os.close(handle)
            handle = step
    except BaseException:
        os.close(handle)
        raise
    return handle


@contextlib.contextmanager
def folder_lock(folder: str | os.PathLike[str]) -> Iterator[None]:
    """
    Lock a folder against concurrent writers of this package; wait while it is locked.

    The lock is on the folder itself, so it leaves no file and ends with the process. A missing
    folder is created. Without file system locks nobody waits. Raises ImuAllanError if another
    process holds the lock for longer than `LOCK_TIMEOUT_S`.
    """
    try:
        # Not available on Windows.
        import fcntl
    except ImportError:
        yield
        return
    with contextlib.ExitStack() as stack:
        handle = None
        # Problems of the folder are reported by the writing itself.
        with contextlib.suppress(OSError):
            passed = open_folder(resolved(folder))
            stack.callback(os.close, passed)
            handle = os.open('.', os.O_RDONLY, dir_fd=passed)
            stack.callback(os.close, handle)
        end = time.monotonic() + LOCK_TIMEOUT_S
        while handle is not None:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if time.monotonic() > end:
                    raise ImuAllanError(
                        f'{os.fspath(folder)}: cannot be written (another process writes to it); '
                        'choose another folder, or wait until it has ended') from None
            except OSError:
                break
            # A delay that nobody notices.
            time.sleep(0.05)
        yield


def _is_world_writable(folder: str) -> bool:
    try:
        return bool(os.stat(folder).st_mode & stat.S_IWOTH)  # noqa: PTH116
    except OSError:
        # A folder that does not exist contains no links.
        return False
