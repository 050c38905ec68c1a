# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Files that rosbag2 compressed as a whole; unpacked into a temporary folder while in use."""

from collections.abc import Callable, Iterator
from pathlib import Path

from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError, printable
from imu_allan.recordings.formats.decompress import (
    DamagedData,
    declared_size,
    decompressing,
    MOST_RATIO,
    PLAIN_BYTES,
)
from imu_allan.recordings.formats.temporary_folder import make_folder, remove_folder, room_in
from imu_allan.recordings.options import RecordingOptions
from imu_allan.recordings.recording import Recording


class CompressedRecording(Recording):
    """A zstd-compressed file; raises ImuAllanError if there is no room to unpack it."""

    def __init__(
        self, path: Path, open_stored: Callable[[Path, Path, RecordingOptions], Recording],
        options: RecordingOptions,
    ) -> None:
        super().__init__(path, options)
        self.size_bytes = path.stat().st_size
        self._folder = make_folder()
        try:
            stored = self._folder / 'recording'
            self._unpack(stored)
            self._inner = open_stored(path, stored, options)
        except BaseException:
            self.close()
            raise
        for name in ('topics', 'thermometers', 'other_topics', 'reasons', 'preferred',
                     'preferred_for', 'untimed', 'ends_ns'):
            setattr(self, name, getattr(self._inner, name))
        self.remarks += self._inner.remarks

    def close(self) -> None:
        """Remove the unpacked file."""
        remove_folder(self._folder)

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read blocks, each with its share of the compressed bytes."""
        share = self.size_bytes / max(self._inner.size_bytes, 1)
        with self._inner.for_another_topic() as inner:
            try:
                for block, position in inner.decoded(topic):
                    yield block, int(position * share)
            finally:
                self.keep_remarks_of(inner)

    def _unpack(self, stored: Path) -> None:
        room = room_in(self._folder)
        written = 0
        reason = ''
        with self.path.open('rb') as file, stored.open('wb') as out:
            # Magic number and frame header of zstd have at most 4 + 14 bytes (RFC 8878, 3.1.1.1).
            declared = declared_size(file.read(18))
            file.seek(0)
            read = decompressing(file)
            try:
                # Bytes decompressed at a time, so that an exceeded bound is noticed early.
                while data := read(1 << 22):
                    written += len(data)
                    if written > PLAIN_BYTES + MOST_RATIO * self.size_bytes:
                        raise ImuAllanError(
                            f'{printable(self.path)}: expands to more than {MOST_RATIO} times '
                            'its size, as no recording of an IMU does; if it is one, unpack it '
                            'with: zstd -d')
                    if written > room:
                        raise ImuAllanError(
                            f'{printable(self.path)}: no room to decompress it in '
                            f'{printable(self._folder.parent)}; name a larger folder with TMPDIR')
                    out.write(data)
            except DamagedData as error:
                reason = printable(error)
        if written < declared:
            # The library reports no error for a truncated frame.
            reason = reason or f'{declared - written} of {declared} bytes are missing'
        if written == 0:
            raise ImuAllanError(
                f'{printable(self.path)}: a damaged compressed file ({reason or "empty"}); '
                'nothing can be read of it')
        if reason:
            self.remark('truncated_recording', fault='compressed', reason=reason)
