# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Files that rosbag2 compressed as a whole; unpacked into a temporary folder while in use."""

from collections.abc import Callable
from pathlib import Path

from imu_allan.errors import ImuAllanError, printable
from imu_allan.recordings.formats.decompress import declared_size, MOST_RATIO, PLAIN_BYTES, STREAMS
from imu_allan.recordings.formats.temporary_folder import make_folder, remove_folder, room_in
from imu_allan.recordings.options import RecordingOptions
from imu_allan.recordings.recording import Recording
import zstandard


def open_compressed(
    path: Path, open_stored: Callable[[Path, Path, RecordingOptions], Recording],
    options: RecordingOptions,
) -> Recording:
    """Unpack a zstd-compressed file and open it; raise ImuAllanError if there is no room."""
    folder = make_folder()
    try:
        stored = folder / 'recording'
        damage = _unpack(path, stored)
        recording = open_stored(path, stored, options)
    except BaseException:
        remove_folder(folder)
        raise
    recording.folders.append(folder)
    if damage:
        recording.remark('truncated_recording', fault='compressed', reason=damage)
    return recording


def _unpack(path: Path, stored: Path) -> str:
    """Unpack a file as far as possible; return what is damaged, or ''."""
    room, size = room_in(stored.parent), path.stat().st_size
    written = 0
    damage = ''
    with path.open('rb') as file, stored.open('wb') as out:
        # Magic number and frame header of zstd have at most 4 + 14 bytes (RFC 8878, 3.1.1.1).
        declared = declared_size(file.read(18))
        file.seek(0)
        stream = STREAMS['zstd'](file)
        try:
            # Bytes decompressed at a time, so that an exceeded bound is noticed early.
            while data := stream.read(1 << 22):
                written += len(data)
                if written > PLAIN_BYTES + MOST_RATIO * size:
                    raise ImuAllanError(
                        f'{printable(path)}: expands to more than {MOST_RATIO} times its size, as '
                        'no recording of an IMU does; if it is one, unpack it with: zstd -d')
                if written > room:
                    raise ImuAllanError(
                        f'{printable(path)}: no room to decompress it in '
                        f'{printable(stored.parents[1])}; name a larger folder with TMPDIR')
                out.write(data)
        except (zstandard.ZstdError, MemoryError) as error:
            damage = printable(error)
    if written < declared:
        # The library reports no error for a truncated frame.
        damage = damage or f'{declared - written} of {declared} bytes are missing'
    if written == 0:
        raise ImuAllanError(
            f'{printable(path)}: a damaged compressed file ({damage or "empty"}); nothing can be '
            'read of it')
    return damage
