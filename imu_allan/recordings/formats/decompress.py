# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Decompression that never allocates more than was promised, and how much work a file may make.

Six kilobytes of zstd can hold two million records without a byte in them, or 64 MiB of zeros, and
a file can hold thousands of such chunks. Valid records take bytes of the file.
"""

import bz2
from collections.abc import Callable, Iterable, Iterator
from itertools import groupby, islice
from pathlib import Path
import threading
from typing import BinaryIO

from imu_allan.cdr import batches_of, MessageBatch
import lz4.frame  # type: ignore[import-untyped]
import numpy as np
import zstandard

try:
    # An order of magnitude faster, where it is installed.
    from isal.isal_zlib import crc32
except ImportError:
    from zlib import crc32

__all__ = [
    'DamagedData', 'Effort', 'crc32', 'declared_size', 'decompress', 'decompressing', 'unpacked']

PLAIN_BYTES, MOST_RATIO = 1 << 28, 1000
"""Bytes that any file may expand to, and times its size beyond that: real recordings reach 20."""


class DamagedData(ValueError):
    """Data that cannot be what it is declared to be; the message says why."""


def decompress(compression: str, data: bytes, size: int) -> bytes:
    """Decompress a buffer that must give `size` bytes; raises DamagedData."""
    try:
        plain = _DECOMPRESSORS[compression](data, size)
    except KeyError:
        raise DamagedData(f'compression {compression[:20]!r} is not supported') from None
    # lz4 raises RuntimeError, bz2 OSError, all of them MemoryError for absurd sizes.
    except (zstandard.ZstdError, RuntimeError, OSError, ValueError, MemoryError) as error:
        raise DamagedData(f'{compression}: {error}') from error
    if len(plain) != size:
        raise DamagedData(f'{len(plain)} bytes instead of the declared {size}')
    return plain


def declared_size(head: bytes) -> int:
    """Return the size that a zstd frame beginning with `head` declares; 0 where it does not."""
    try:
        return max(zstandard.frame_content_size(head), 0)
    except zstandard.ZstdError:
        return 0


def decompressing(file: BinaryIO) -> Callable[[int], bytes]:
    """Return what reads plain bytes of a zstd file; it raises DamagedData."""
    stream = _LOCAL.zstd.stream_reader(file, read_across_frames=True)

    def read(size: int) -> bytes:
        try:
            return stream.read(size)
        except (zstandard.ZstdError, MemoryError) as error:
            raise DamagedData(str(error)) from error

    return read


class _Local(threading.local):
    """A decompressor for each thread: one must not serve two."""

    def __init__(self) -> None:
        self.zstd = zstandard.ZstdDecompressor(max_window_size=1 << 27)


_LOCAL = _Local()


def _unzstd(data: bytes, size: int) -> bytes:
    # The library allocates what the frame declares, whatever maximum it is given.
    declared = zstandard.frame_content_size(data)
    if declared > size:
        raise DamagedData(f'a frame of {declared} bytes instead of the declared {size}')
    return _LOCAL.zstd.decompress(data, max_output_size=size)


_DECOMPRESSORS: dict[str, Callable[[bytes, int], bytes]] = {
    '': lambda data, _: data, 'none': lambda data, _: data, 'zstd': _unzstd,
    'lz4': lambda data, size: lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size),
    'bz2': lambda data, size: bz2.BZ2Decompressor().decompress(data, max_length=size)}


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
        # Ten chunks, of any size, may take all the steps that one may; the smallest record,
        # compressed, takes more than four bytes of the file.
        self._steps = 10 * at_least + size // 4
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


def unpacked(batches: Iterable[MessageBatch], effort: Effort) -> Iterator[MessageBatch]:
    """Decompress the messages of `batches`, where they are compressed."""
    # No message begins as zstd does: CDR begins with a zero.
    for compressed, group in groupby(
            batches, lambda batch: batch.rows[0, :4].tobytes() == b'\x28\xb5\x2f\xfd'):
        if not compressed:
            yield from group
            continue
        rows = ((row.tobytes(), stamp) for batch in group
                for row, stamp in zip(batch.rows, batch.receive_ns.tolist(), strict=True))
        # However large they are, 256 messages are decompressed into one batch.
        while some := list(islice(rows, 256)):
            messages, stamps = zip(*some, strict=True)
            yield from batches_of([_unpacked_message(message, effort) for message in messages],
                                  np.array(stamps, np.int64))


def _unpacked_message(message: bytes, effort: Effort) -> bytes:
    """Decompress one message; nothing, which is no message, where that is not possible."""
    # An Imu has 324 bytes and its frame_id: 200 times as much; a bomb expands to no more.
    most = 1 << 16
    try:
        effort.expand(declared_size(message) or most)
        return _unzstd(message, most)
    except (DamagedData, zstandard.ZstdError, MemoryError):
        return b''
