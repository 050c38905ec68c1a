# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Where a file is unpacked or copied to, and how that goes away again."""

import errno
from pathlib import Path
import shutil
import tempfile

from imu_allan.errors import ImuAllanError, printable

_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
SPARED_DISK = 1 << 28
"""Bytes of the temporary folder's disk that are never filled."""


def make_folder() -> Path:
    """Make a temporary folder that nobody else can look into."""
    return Path(tempfile.mkdtemp(prefix='imu_allan_'))


def room_in(folder: Path | str) -> int:
    """Bytes that may still be written to a folder, negative where its disk is nearly full."""
    return shutil.disk_usage(folder).free - SPARED_DISK


def remove_folder(folder: Path) -> None:
    """Remove a temporary folder and all it holds, also where an end from outside interrupts."""
    try:
        shutil.rmtree(folder, ignore_errors=True)
    except BaseException:
        # A process that is ended in peace is interrupted once, see `serve` of the workers.
        shutil.rmtree(folder, ignore_errors=True)
        raise


def unreadable(recording: Path, error: OSError, what: str = '') -> ImuAllanError:
    """Return what to say of a recording: what has no room is its copy, and it is not to blame."""
    reason = error.strerror or printable(error)
    if error.errno in _NO_ROOM:
        return ImuAllanError(f'{printable(recording)}: cannot be unpacked or copied to '
                             f'{printable(tempfile.gettempdir())} ({reason}); name a larger '
                             'folder with TMPDIR, or raise the limit (ulimit -f)')
    return ImuAllanError(f'{printable(recording)}: '
                         f'{f"{what} ({printable(reason)})" if what else reason}')
