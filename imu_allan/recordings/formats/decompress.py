# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Decompression with bounds on memory and on the work that a file may cause.

No buffer exceeds its declared size. Six kilobytes of zstd can hold 64 MiB of zeros, and a file can
hold thousands of such chunks, so all of them have one bound. Files that rosbag2 compressed as a
whole are unpacked into a temporary folder while in use.
"""

import bz2
from collections.abc import Callable, Iterable, Iterator
from io import BytesIO
from itertools import groupby, islice
from pathlib import Path
import shutil
import threading
from typing import BinaryIO

from imu_allan.cdr import batches_of, MessageBatch
from imu_allan.errors import error_about, printable
from imu_allan.recordings.options import RecordingOptions
from imu_allan.recordings.recording import make_folder, Recording
import lz4.frame  # type: ignore[import-untyped]
import numpy as np
import zstandard

PLAIN_BYTES, MOST_RATIO = 1 << 28, 1000
"""Any file may expand to this many bytes, plus this many times its size. Real recordings reach
a ratio of 20."""

LARGEST_CHUNK = 1 << 28
"""Largest size in bytes, compressed or not; recorders write 768 kB by default."""


class DamagedData(ValueError):
    """Data that contradicts its declaration; the message gives the reason."""


def _declared_size(head: bytes) -> int:
    """Return the size declared by a zstd frame that begins with `head`; 0 if undeclared."""
    try:
        return max(zstandard.frame_content_size(head), 0)
    except zstandard.ZstdError:
        return 0


class _Local(threading.local):
    """One decompressor per thread, as it must not be shared."""

    def __init__(self) -> None:
        self.zstd = zstandard.ZstdDecompressor(max_window_size=1 << 27)


_LOCAL = _Local()


def _unzstd(data: bytes, size: int) -> bytes:
    # The library allocates the declared size of the frame, ignoring the given maximum.
    declared = zstandard.frame_content_size(data)
    if declared > size:
        raise DamagedData(f'a frame of {declared} bytes instead of the declared {size}')
    return _LOCAL.zstd.decompress(data, max_output_size=size)


_DECOMPRESSORS: dict[str, Callable[[bytes, int], bytes]] = {
    '': lambda data, _: data, 'none': lambda data, _: data, 'zstd': _unzstd,
    'lz4': lambda data, size: lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size),
    'bz2': lambda data, size: bz2.BZ2Decompressor().decompress(data, max_length=size)}


STREAMS: dict[str, Callable[[BinaryIO], BinaryIO]] = {
    'zstd': lambda file: _LOCAL.zstd.stream_reader(file, read_across_frames=True),
    'lz4': lz4.frame.LZ4FrameFile}


class ReadingLimits:
    """The decompressed bytes that are left while the file at `path` is read."""

    def __init__(self, path: Path) -> None:
        self._bytes = PLAIN_BYTES + MOST_RATIO * path.stat().st_size

    def expand(self, size: int) -> None:
        """Count decompressed bytes; raise DamagedData if there are too many."""
        if size > self._bytes:
            raise DamagedData(f'the file expands to more than {MOST_RATIO} times its size')
        self._bytes -= size


def expanded(file: BinaryIO, compression: str, stored: int, size: int, limits: ReadingLimits,
             ) -> bytes:
    """Decompress the next `stored` bytes of a file, a chunk of `size` bytes, within `limits`."""
    if max(size, stored) > LARGEST_CHUNK:
        raise DamagedData(f'{max(size, stored)} bytes are more than a chunk may have')
    if compression not in ('', 'none'):
        limits.expand(size)
    data = file.read(stored)
    try:
        plain = _DECOMPRESSORS[compression](data, size)
        if len(plain) < size and compression in STREAMS:
            # The data may consist of several frames, of which that was the first.
            plain = STREAMS[compression](BytesIO(data)).read(size)
    except KeyError:
        raise DamagedData(f'compression {compression[:20]!r} is not supported') from None
    # lz4 raises RuntimeError, bz2 OSError, and all raise MemoryError for absurd sizes.
    except (zstandard.ZstdError, RuntimeError, OSError, EOFError, ValueError,
            MemoryError) as error:
        raise DamagedData(f'{compression}: {error}') from error
    if len(plain) != size:
        raise DamagedData(f'{len(plain)} bytes instead of the declared {size}')
    return plain


def unpacked(batches: Iterable[MessageBatch], limits: ReadingLimits) -> Iterator[MessageBatch]:
    """Decompress those messages of `batches` that are compressed."""
    # Serialized messages never begin with the zstd magic number: CDR begins with a zero.
    for compressed, group in groupby(
            batches, lambda batch: batch.rows[0, :4].tobytes() == b'\x28\xb5\x2f\xfd'):
        if not compressed:
            yield from group
            continue
        rows = ((row.tobytes(), stamp) for batch in group
                for row, stamp in zip(batch.rows, batch.receive_ns.tolist(), strict=True))
        # Decompress 256 messages into one batch, whatever their size.
        while some := list(islice(rows, 256)):
            messages, stamps = zip(*some, strict=True)
            yield from batches_of([_unpacked_message(message, limits) for message in messages],
                                  np.array(stamps, np.int64))


def _unpacked_message(message: bytes, limits: ReadingLimits) -> bytes:
    """Decompress one message; return b'', which is not a valid message, on failure."""
    # 200 times the size of an Imu, which has 324 bytes plus frame_id; this also bounds hostile
    # data.
    most = 1 << 16
    try:
        limits.expand(_declared_size(message) or most)
        return _unzstd(message, most)
    except (DamagedData, zstandard.ZstdError, MemoryError):
        return b''


def open_compressed(
    path: Path, open_stored: Callable[[Path, Path, RecordingOptions], Recording],
    options: RecordingOptions,
) -> Recording:
    """Unpack a zstd-compressed file and open it; raise ImuAllanError if there is no room."""
    folder, room = make_folder()
    try:
        stored = folder / 'recording'
        damage = _unpack(path, stored, room)
        recording = open_stored(path, stored, options)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    recording.folders.append(folder)
    if damage:
        recording.remark('truncated_recording', fault='compressed', reason=damage)
    return recording


def _unpack(path: Path, stored: Path, room: int) -> str:
    """Unpack a file as far as possible into `room` bytes; return what is damaged, or ''."""
    size, written, damage = path.stat().st_size, 0, ''
    with path.open('rb') as file, stored.open('wb') as out:
        # Magic number and frame header of zstd have at most 4 + 14 bytes (RFC 8878, 3.1.1.1).
        declared = _declared_size(file.read(18))
        file.seek(0)
        stream = STREAMS['zstd'](file)
        try:
            # Bytes decompressed at a time, so that an exceeded bound is noticed early.
            while data := stream.read(1 << 22):
                written += len(data)
                if written > PLAIN_BYTES + MOST_RATIO * size:
                    raise error_about(path, f'expands to more than {MOST_RATIO} times its size, '
                                      'as no recording of an IMU does; if it is one, unpack it '
                                      'with: zstd -d')
                if written > room:
                    raise error_about(path, 'no room to decompress it in '
                                      f'{printable(stored.parents[1])}; name a larger folder with '
                                      'TMPDIR')
                out.write(data)
        except (zstandard.ZstdError, MemoryError) as error:
            damage = printable(error)
    if written < declared:
        # The library reports no error for a truncated frame.
        damage = damage or f'{declared - written} of {declared} bytes are missing'
    if written == 0:
        raise error_about(path, f'a damaged compressed file ({damage or "empty"}); nothing can be '
                          'read of it')
    return damage
