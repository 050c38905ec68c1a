# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Where an output really goes.

In a folder that everybody may write to, such as /tmp, somebody else may have put a symbolic link
where an output is expected, and the output would go wherever the link leads. Linux refuses to
follow such links where fs.protected_symlinks is set; here they are refused everywhere.
"""

from __future__ import annotations

import errno
import os
from pathlib import Path
import stat

from imu_allan.errors import ImuAllanError, printable

_MOST_LINKS = 40
"""As many as Linux follows."""


def followed(path: str | os.PathLike[str]) -> Path:
    """
    Return the absolute path without symbolic links, as ``os.path.realpath``.

    Raises
    ------
    OSError
        If a link on the way was put into a folder that everybody may write to by another user than
        this one or the owner of that folder.

    """
    if os.name != 'posix':
        return Path(os.path.realpath(path))
    pending = os.path.join(Path.cwd(), path).split('/')[::-1]  # noqa: PTH118
    current = '/'
    links = 0
    while pending:
        part = pending.pop()
        if part in ('', '.'):
            continue
        if part == '..':
            current = str(Path(current).parent)
            continue
        step = os.path.join(current, part)  # noqa: PTH118
        if not Path(step).is_symlink():
            current = step
            continue
        links += 1
        if links > _MOST_LINKS:
            raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), os.fspath(path))
        _require_own(step)
        target = str(Path(step).readlink())
        current = '/' if target.startswith('/') else current
        pending += target.split('/')[::-1]
    return Path(current)


def require_writable(folder: str | os.PathLike[str]) -> None:
    """
    Refuse a folder that cannot be written to, before the work for it begins.

    A folder that is missing is not made; a full disk is not found out.

    Raises
    ------
    ImuAllanError
        If it, or the nearest one above that exists, is no folder or may not be written to.

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


def _require_own(link: str) -> None:
    folder = Path(link).parent.stat()
    everybodys = folder.st_mode & stat.S_ISVTX and folder.st_mode & stat.S_IWOTH
    if everybodys and os.lstat(link).st_uid not in (os.geteuid(), folder.st_uid):
        raise OSError(None, f'{link} is a link that another user put into a folder that everybody '
                      'may write to', link)
