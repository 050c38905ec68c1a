# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Whose turn it is to write to a folder: files of two results are never mixed in one."""

from collections.abc import Iterator
import contextlib
import os
import time

from imu_allan.errors import ImuAllanError
from imu_allan.writers.output_path import open_to_lock

PATIENCE_S = 30.0
"""Writing takes seconds; whoever holds a folder for longer keeps it."""


@contextlib.contextmanager
def turn_in(folder: str | os.PathLike[str]) -> Iterator[None]:
    """
    Wait until no other process writes to a folder, and keep the others waiting meanwhile.

    The lock is on the folder itself: it leaves no file and ends with the process. Where the file
    system has no locks, nobody waits.

    Parameters
    ----------
    folder : path
        Made where it is missing.

    Raises
    ------
    ImuAllanError
        If another process keeps it for longer than `PATIENCE_S`.

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
        with contextlib.suppress(OSError, ImuAllanError):
            handle = open_to_lock(folder)
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
