# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
How much work a file may make.

Six kilobytes of zstd can hold two million records without a byte in them, or 64 MiB of zeros, and
a file can hold thousands of such chunks. Valid records take bytes of the file.
"""

from pathlib import Path

from imu_allan.recordings.formats.decompress import DamagedData

PLAIN_BYTES, MOST_RATIO = 1 << 28, 1000
"""Bytes that any file may expand to, and times its size beyond that: real recordings reach 20."""
_BYTES_PER_STEP = 4
"""Bytes of the file for one more record in it: the smallest, compressed, takes more."""


class Effort:
    """
    What one reading of a file may still step through one by one, and expand to.

    Parameters
    ----------
    path : Path
        The file as the user has it, before anything of it is unpacked.
    at_least : int
        Steps that any chunk may take, whatever its size.
    bytes_per_step : int, optional
        Bytes of a chunk for one more step in it.

    """

    def __init__(self, path: Path, at_least: int, bytes_per_step: int = 1) -> None:
        size = path.stat().st_size
        self._at_least = at_least
        self._bytes_per_step = bytes_per_step
        self._left = 0
        # Ten chunks, of any size, may take all the steps that one may.
        self._steps = 10 * at_least + size // _BYTES_PER_STEP
        self._bytes = PLAIN_BYTES + MOST_RATIO * size

    def begin(self, stored: int) -> None:
        """Begin a chunk that takes so many bytes of the file."""
        self._steps += max(self._left, 0)
        most = self._at_least + stored // self._bytes_per_step
        self._left = min(self._steps, most)
        self._steps -= self._left

    def step(self) -> None:
        """Count a record; raises DamagedData where there are more than allowed."""
        self._left -= 1
        if self._left < 0:
            raise DamagedData('more records than its bytes can hold')

    def expand(self, size: int) -> None:
        """Count bytes that something compressed expands to; raises DamagedData if too many."""
        if size > self._bytes:
            raise DamagedData(f'the file expands to more than {MOST_RATIO} times its size')
        self._bytes -= size
