# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Temporary folders for unpacked or copied files, and their removal."""

import atexit
import errno
from pathlib import Path
import secrets
import shutil
import tempfile

from imu_allan.errors import ImuAllanError, printable

RESERVED_DISK_BYTES = 1 << 28
"""Bytes on the disk of the temporary folder that are always left free."""


def make_folder() -> Path:
    """Create a temporary folder that only this user can access."""
    folder = Path(tempfile.gettempdir(), f'imu_allan_{secrets.token_hex(8)}')
    # Ctrl-C may come before the caller knows of the folder.
    atexit.register(remove_folder, folder)
    folder.mkdir(mode=0o700)
    return folder


def room_in(folder: Path | str) -> int:
    """Return the bytes that may be written to a folder; negative if its disk is nearly full."""
    return shutil.disk_usage(folder).free - RESERVED_DISK_BYTES


def remove_folder(folder: Path) -> None:
    """Remove a temporary folder with its content, even if a termination request interrupts."""
    try:
        shutil.rmtree(folder, ignore_errors=True)
    except BaseException:
        # `exit_on_sigterm` interrupts a process only once, so the second attempt completes.
        shutil.rmtree(folder, ignore_errors=True)
        raise


def unreadable_error(recording: Path, error: OSError, what: str = '') -> ImuAllanError:
    """Return the error to report; lack of disk space concerns the temporary copy."""
    reason = error.strerror or printable(error)
    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        return ImuAllanError(f'{printable(recording)}: cannot be unpacked or copied to '
                             f'{printable(tempfile.gettempdir())} ({reason}); name a larger '
                             'folder with TMPDIR, or raise the limit (ulimit -f)')
    return ImuAllanError(f'{printable(recording)}: '
                         f'{f"{what} ({printable(reason)})" if what else reason}')
