# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Opening a recording by what it is, whatever its name."""

from pathlib import Path

from imu_allan.errors import ImuAllanError, printable
from imu_allan.recordings.recording import Recording


def open_recording(path: Path | str, *, rate_hz: float | None = None) -> Recording:
    """
    Open a recording of any kind.

    Parameters
    ----------
    path : path-like
        A rosbag2 directory, a .mcap or .db3 file, a ROS 1 .bag, or a CSV file.
    rate_hz : float, optional
        Sample rate in Hz of a CSV file without a time column.

    Returns
    -------
    Recording
        To be used as a context manager.

    Raises
    ------
    ImuAllanError
        If the file is missing, empty, a git-LFS pointer, or not a recording.
    """
    path = Path(path)
    try:
        if path.is_dir():
            from imu_allan.recordings.bag_directory import BagDirectory
            return BagDirectory(path)
        with path.open('rb') as file:
            head = file.read(64)
    except FileNotFoundError:
        raise ImuAllanError(f'{printable(path)}: no such file or directory') from None
    except OSError as error:
        raise ImuAllanError(f'{printable(path)}: {error.strerror}') from error
    if not head:
        raise ImuAllanError(f'{printable(path)}: the file is empty')
    if head.startswith(b'\x89MCAP'):
        from imu_allan.recordings.mcap_file import McapRecording
        return McapRecording(path)
    if head.startswith(b'SQLite format 3\0'):
        from imu_allan.recordings.sqlite_file import SqliteRecording
        return SqliteRecording(path)
    raise ImuAllanError(f'{printable(path)}: not a recording')
