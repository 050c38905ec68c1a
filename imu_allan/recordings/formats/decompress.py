# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Decompression that never allocates more than was promised and checked."""

import bz2
from collections.abc import Callable
import threading
from typing import BinaryIO

import lz4.frame  # type: ignore[import-untyped]
import zstandard

try:
    # An order of magnitude faster, where it is installed.
    from isal.isal_zlib import crc32
except ImportError:
    from zlib import crc32

__all__ = [
    'DamagedData', 'crc32', 'declared_size', 'decompress', 'decompress_frame', 'decompressing']


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


def decompress_frame(data: bytes, most: int) -> bytes:
    """Decompress one zstd frame of at most `most` bytes; raises DamagedData."""
    try:
        return _unzstd(data, most)
    except (zstandard.ZstdError, MemoryError) as error:
        raise DamagedData(str(error)) from error


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


def _store(data: bytes, _size: int) -> bytes:
    return data


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


def _unlz4(data: bytes, size: int) -> bytes:
    plain: bytes = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size)
    return plain


def _unbz2(data: bytes, size: int) -> bytes:
    return bz2.BZ2Decompressor().decompress(data, max_length=size)


_DECOMPRESSORS: dict[str, Callable[[bytes, int], bytes]] = {
    '': _store, 'none': _store, 'zstd': _unzstd, 'lz4': _unlz4,
    'bz2': _unbz2}
