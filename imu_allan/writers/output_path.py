# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Where an output really goes, and whose turn it is to write there.

In a folder that everybody may write to, such as /tmp, somebody else may have put a symbolic link
where an output is expected, and the output would go wherever the link leads. Linux refuses to
follow such links where fs.protected_symlinks is set; here they are refused everywhere, and so are
those of others in folders that others made there. Links that come between looking and writing are
not followed either: the folder is opened step by step, and the file is made in what is open.
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

_STEP = os.O_RDONLY | getattr(os, 'O_DIRECTORY', 0) | getattr(os, 'O_NOFOLLOW', 0)
_ONLY_PASSED = getattr(os, 'O_PATH', 0)
"""Folders on the way may be ones that one may pass through and not list."""
PATIENCE_S = 30.0
"""Writing takes seconds; whoever holds a folder for longer keeps it."""


def followed(path: str | os.PathLike[str]) -> Path:
    """
    Return the absolute path without symbolic links, as ``os.path.realpath``.

    OSError if a link on the way lies in a folder that everybody may write to, or below one, and is
    neither of this user nor of root.
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
        shared = shared or _is_everybodys(current)
        if not Path(step).is_symlink():
            current = step
            continue
        links += 1
        # As many as Linux follows.
        if links > 40:
            raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), os.fspath(path))
        if shared and os.lstat(step).st_uid not in (os.geteuid(), 0):
            raise OSError(None, f'{step} is a link that another user put into a folder that '
                          'everybody may write to', step)
        target = str(Path(step).readlink())
        if target.startswith('/'):
            # Whoever owns the link vouches for where it leads.
            current, shared = '/', False
        pending += target.split('/')[::-1]
    return Path(current)


def require_writable(folder: str | os.PathLike[str]) -> None:
    """
    Refuse a folder that cannot be written to, before the work for it begins.

    A folder that is missing is not made; a full disk is not found out. Where it is missing, the
    nearest one above that exists has to be a folder that may be written to.
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
    Open a folder, made where it is missing, without following a link at any step.

    `path` is absolute, without links, as of `followed`. The descriptor is for ``dir_fd``. OSError
    if a step is none, may not be made or passed, or has become a link since.
    """
    handle = os.open('/', _STEP | _ONLY_PASSED)
    try:
        for part in path.parts[1:]:
            try:
                os.stat(part, dir_fd=handle, follow_symlinks=False)
            except FileNotFoundError:
                with contextlib.suppress(FileExistsError):
                    os.mkdir(part, dir_fd=handle)
            try:
                step = os.open(part, _STEP | _ONLY_PASSED, dir_fd=handle)
            except OSError as error:
                raise OSError(error.errno, error.strerror, str(path)) from error
            os.close(handle)
            handle = step
    except BaseException:
        os.close(handle)
        raise
    return handle


@contextlib.contextmanager
def turn_in(folder: str | os.PathLike[str]) -> Iterator[None]:
    """
    Wait until no other process writes to a folder, and keep the others waiting meanwhile.

    The lock is on the folder itself: it leaves no file and ends with the process. Where the file
    system has no locks, nobody waits. The folder is made where it is missing. ImuAllanError if
    another process keeps it for longer than `PATIENCE_S`.
    """
    try:
        # Not there on Windows.
        import fcntl
    except ImportError:
        yield
        return
    with contextlib.ExitStack() as stack:
        handle = None
        # What is wrong with the folder is reported by whoever writes to it.
        with contextlib.suppress(OSError):
            passed = open_folder(followed(folder))
            stack.callback(os.close, passed)
            handle = os.open('.', os.O_RDONLY, dir_fd=passed)
            stack.callback(os.close, handle)
        end = time.monotonic() + PATIENCE_S
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
            # From one look to the next: nobody notices so long a wait.
            time.sleep(0.05)
        yield


def _is_everybodys(folder: str) -> bool:
    try:
        return bool(os.stat(folder).st_mode & stat.S_IWOTH)  # noqa: PTH116
    except OSError:
        # What is not there holds no links.
        return False
