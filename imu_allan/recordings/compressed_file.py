# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Files that rosbag2 compressed as a whole: unpacked into a temporary folder while in use."""

from collections.abc import Iterator
from pathlib import Path
import shutil
import tempfile

from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError, printable
from imu_allan.recordings.decompress import (
    Bounded,
    DamagedData,
    declared_size,
    decompressing,
)
from imu_allan.recordings.open_recording import open_stored
from imu_allan.recordings.recording import Recording

_PIECE = 1 << 22
_LONGEST_FRAME_HEAD = 18
_SPARED_DISK = 1 << 28
"""Bytes of the temporary folder's disk that are never filled."""


class CompressedRecording(Recording):
    """
    A zstd-compressed file.

    Raises
    ------
    ImuAllanError
        If the temporary folder has no room for it, or it holds no recording.

    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.size_bytes = path.stat().st_size
        self._folder = Path(tempfile.mkdtemp(prefix='imu_allan_'))
        try:
            stored = self._folder / 'recording'
            self._unpack(stored)
            self._inner = open_stored(path, stored)
        except BaseException:
            self.close()
            raise
        self.topics = self._inner.topics
        self.other_topics = self._inner.other_topics
        self.carriers = self._inner.carriers
        self._inner.remarks[:0] = self.remarks
        self.remarks = self._inner.remarks

    def close(self) -> None:
        """Remove the unpacked file."""
        shutil.rmtree(self._folder, ignore_errors=True)

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read blocks, each with its share of the compressed bytes."""
        share = self.size_bytes / max(self._inner.size_bytes, 1)
        for block, position in self._inner.decoded(topic):
            yield block, int(position * share)

    def _unpack(self, stored: Path) -> None:
        room = shutil.disk_usage(self._folder).free - _SPARED_DISK
        written = 0
        reason = ''
        with self.path.open('rb') as file, stored.open('wb') as out:
            declared = declared_size(file.read(_LONGEST_FRAME_HEAD))
            file.seek(0)
            plain = decompressing('zstd', Bounded(file, self.size_bytes))
            try:
                while data := plain.read(_PIECE):
                    written += len(data)
                    if written > room:
                        raise ImuAllanError(
                            f'{printable(self.path)}: no room to decompress it in '
                            f'{printable(self._folder.parent)}; name a larger folder with TMPDIR')
                    out.write(data)
            except DamagedData as error:
                reason = printable(error)
        if written < declared:
            # The library ends a frame that is cut short without a word.
            reason = reason or f'{declared - written} of {declared} bytes are missing'
        if written == 0:
            raise ImuAllanError(
                f'{printable(self.path)}: a damaged compressed file ({reason or "empty"}); '
                'nothing can be read of it')
        if reason:
            self.remark(
                'truncated_recording',
                f'the compressed file is damaged or cut short ({reason}); what comes before was '
                'read')
