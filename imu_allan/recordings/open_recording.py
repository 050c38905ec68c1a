# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Opening a recording by what it is, whatever its name."""

from pathlib import Path

from imu_allan.errors import ImuAllanError, printable
from imu_allan.recordings.recording import Recording

_HEAD = 64


def open_recording(path: Path | str, *, rate_hz: float | None = None) -> Recording:
    """
    Open a recording of any kind.

    Parameters
    ----------
    path : path-like
        A rosbag2 directory, a .mcap or .db3 file (also compressed as a whole with zstd), a ROS 1
        .bag, or a CSV file.
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
        head = read_head(path)
        if head.startswith(b'\x28\xb5\x2f\xfd'):
            from imu_allan.recordings.compressed_file import CompressedRecording
            return CompressedRecording(path)
        return open_stored(path, path, rate_hz)
    except OSError as error:
        raise ImuAllanError(f'{printable(path)}: {error.strerror or printable(error)}') from error
    except ValueError as error:
        if isinstance(error, ImuAllanError):
            raise
        # A path with a null byte.
        raise ImuAllanError(f'{printable(path)}: {printable(error)}') from error


def read_head(path: Path) -> bytes:
    """
    Read the first bytes of a file.

    Raises
    ------
    ImuAllanError
        If there is no such file, or it is empty, not a regular file, or a git-LFS pointer.

    """
    if not path.exists():
        raise ImuAllanError(f'{printable(path)}: no such file or directory')
    if not path.is_file():
        raise ImuAllanError(f'{printable(path)}: not a file')
    with path.open('rb') as file:
        head = file.read(_HEAD)
    if not head:
        raise ImuAllanError(f'{printable(path)}: the file is empty')
    if head.startswith(b'version https://git-lfs.github.com/spec/'):
        raise ImuAllanError(
            f'{printable(path)}: a git-LFS pointer, not the recording itself; fetch it with: '
            'git lfs pull')
    return head


def open_stored(path: Path, stored: Path, rate_hz: float | None = None) -> Recording:
    """
    Open a file by its first bytes.

    Parameters
    ----------
    path : Path
        The recording as the user knows it.
    stored : Path
        Where its bytes are; another file where `path` is compressed.
    rate_hz : float, optional
        As for `open_recording`.

    Raises
    ------
    ImuAllanError
        As for `open_recording`.

    """
    head = read_head(stored)
    if head.startswith(b'\x89MCAP'):
        from imu_allan.recordings.mcap_file import McapRecording
        return McapRecording(path, stored)
    if head.startswith(b'SQLite format 3\0'):
        from imu_allan.recordings.sqlite_file import SqliteRecording
        return SqliteRecording(path, stored)
    if head.startswith(b'#ROSBAG V'):
        from imu_allan.recordings.ros1_bag import Ros1Recording
        return Ros1Recording(path, stored)
    if path.suffix.lower() in ('.csv', '.txt') or (head.isascii() and b',' in head):
        from imu_allan.recordings.csv_file import CsvRecording
        return CsvRecording(path, stored, rate_hz)
    raise ImuAllanError(
        f'{printable(path)}: neither a rosbag2 directory, .mcap, .db3, ROS 1 .bag nor CSV file')
