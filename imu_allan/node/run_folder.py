# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The folder of a run, into which ``~/save`` writes."""

from collections.abc import Iterator
import contextlib
import fcntl
import os
from pathlib import Path
import re
import secrets
import tempfile

from imu_allan.errors import ImuAllanError
from imu_allan.node.interface import DEFAULT_OUTPUT_DIR
from imu_allan.result import Result
from imu_allan.writers.output_path import followed, open_folder, open_to_lock

_CLAIMS: dict[Path, int] = {}
"""Folders of this process, and the handles that hold their locks, the latest last."""
_MOST_CLAIMS = 32
"""Nodes of one process; a node that is reset for every unit on a bench has a thousand runs."""
_MOST_OF_ONE_NAME = 100
"""Nodes of one name that start in one second: one is a slip, a hundred a loop without end."""


def try_folder(output_dir: str) -> None:
    """Write a file into the output folder and remove it, as a save will have to."""
    expanded = _expanded(output_dir)
    try:
        folder = open_folder(followed(expanded))
        try:
            _try_file(f'.imu_allan.{secrets.token_hex(4)}', folder)
        finally:
            os.close(folder)
    except OSError as error:
        raise ImuAllanError(
            f'output_dir {output_dir}: cannot be written ({error.strerror or error}); set the '
            'parameter to a folder that may be written to') from error


def other_folders(state_file: Path | None) -> Iterator[str]:
    """Where a result goes when the output folder takes nothing, the likeliest first."""
    if state_file is not None:
        yield str(state_file.parent)
    yield DEFAULT_OUTPUT_DIR
    # None of the folders that the system has for temporary files may be writable.
    with contextlib.suppress(OSError):
        yield str(Path(tempfile.gettempdir()) / 'imu_allan')


def run_folder(output_dir: str, node_name: str, result: Result) -> Path:
    """Name the folder of one run: another run or another node has another."""
    start = (result.source.start_time or 'unknown').partition('.')[0].removesuffix('Z')
    name = f'{node_name.strip("/")}_{start}'
    return _expanded(output_dir) / re.sub(r'[^A-Za-z0-9_-]+', '-', name.replace('/', '_'))


def claimed(folder: Path) -> Path:
    """
    Make the folder of a run, for this process alone.

    Two nodes of one name that start in the same second would have the same; the second one gets
    another, with a number. Held by a lock on the folder itself, which leaves no file and ends with
    the process: after a restart the run goes on in its folder.
    """
    candidates = [folder, *(folder.with_name(f'{folder.name}-{number}')
                            for number in range(2, _MOST_OF_ONE_NAME))]
    for candidate in candidates:
        if candidate in _CLAIMS:
            _CLAIMS[candidate] = _CLAIMS.pop(candidate)
            return candidate
        # Where a folder cannot be made or opened, the files are about to tell why.
        with contextlib.suppress(OSError):
            handle = open_to_lock(candidate)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                os.close(handle)
                continue
            _CLAIMS[candidate] = handle
            if len(_CLAIMS) > _MOST_CLAIMS:
                # A run that ended long ago: as if its process had.
                os.close(_CLAIMS.pop(next(iter(_CLAIMS))))
        return candidate
    return folder


def leave_if_empty(folder: Path) -> None:
    """Remove a claimed folder into which nothing could be written, and the claim with it."""
    with contextlib.suppress(OSError):
        folder.rmdir()
        os.close(_CLAIMS.pop(folder))


def _try_file(name: str, folder: int) -> None:
    """Write a byte to a new file in an open folder and remove it."""
    handle = os.open(name, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600, dir_fd=folder)
    try:
        os.write(handle, b'x')
    finally:
        os.close(handle)
        os.unlink(name, dir_fd=folder)


def _expanded(folder: str) -> Path:
    try:
        return Path(folder).expanduser()
    except RuntimeError as error:
        raise ImuAllanError(f'output_dir {folder}: this user has no home folder; '
                            'write the path without ~') from error
