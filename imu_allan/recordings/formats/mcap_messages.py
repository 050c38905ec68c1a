# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Gathering of the messages of one topic from a buffer of MCAP records, as arrays.

Records of an Imu topic nearly always have equal size and equal spacing in the buffer. Runs of
equal records are therefore detected, verified in one comparison, and returned as a view of the
buffer. Where topics alternate, the message index locates the records; it is trusted only if they
fill the buffer without a gap. Without an index, records are read one by one. Opcode, length and
channel of every record are always checked.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Set as AbstractSet
from itertools import chain
from struct import Struct
from typing import Any

from imu_allan.arrays import Ints, runs
from imu_allan.cdr import MessageBatch, rows_like_first
from mcap.opcode import Opcode
import numpy as np
from numpy.typing import NDArray

RECORD_HEAD = 9
"""Bytes of opcode and length before each record."""

_HEAD = np.dtype([('opcode', 'u1'), ('length', '<u8'), ('channel', '<u2'), ('number', '<u4'),
                  ('log_ns', '<i8'), ('publish_ns', '<i8')])
"""What precedes the data of a message (MCAP, op 0x05)."""
_KEY = RECORD_HEAD + 2
"""Bytes of opcode, length and channel, which equal records share."""
OPCODE_LENGTH = Struct('<BQ')
_MESSAGE = int(Opcode.MESSAGE)
_DESCRIPTIONS = frozenset({int(Opcode.SCHEMA), int(Opcode.CHANNEL), *range(0x80, 0x100)})
"""Records beside messages: descriptions, and private ones of a program, to be passed over."""


def gather(
    buffer: bytes, wanted: AbstractSet[int], describe: Callable[[int, bytes], object],
    index: Callable[[], Ints] | None,
) -> tuple[Iterator[MessageBatch], int]:
    """
    Gather the messages of the channels `wanted`; also return the bytes of complete records.

    `describe` is called with opcode and body of each record that is no message, and may add to
    `wanted`. `index` returns the offsets of all messages, as the file declares them, in any order.
    Messages are copied only when a batch is requested.
    """
    batches: list[Iterable[MessageBatch]] = []
    scattered: list[int] = []
    at, end = 0, len(buffer)
    # Use the message index after this many records that are not in a run.
    steps_left = 32
    while end - at >= RECORD_HEAD:
        opcode, length = OPCODE_LENGTH.unpack_from(buffer, at)
        stride = RECORD_HEAD + length
        if stride > end - at:
            break
        if opcode == _MESSAGE:
            if stride < _HEAD.itemsize:
                break
            key = buffer[at:at + _KEY]
            # Two probes are cheap; comparing a whole run is not.
            run = (buffer[at + stride:at + stride + _KEY] == key
                   and buffer[at + 8 * stride:at + 8 * stride + _KEY] == key)
            count = equal_records(buffer, at, stride) if run else 1
            if not run and index is not None:
                steps_left -= 1
                if steps_left == 0:
                    places = _verified(buffer, at, index(), describe)
                    if places is not None:
                        channels = anywhere(buffer, _HEAD)['channel'][places]
                        # All 65,536 may be wanted, but a chunk contains only a few.
                        chosen = np.isin(channels, [*wanted & {*np.unique(channels).tolist()}])
                        batches += [_collected(buffer, scattered),
                                    _collected(buffer, places[chosen])]
                        return chain.from_iterable(batches), end
            if int.from_bytes(key[RECORD_HEAD:], 'little') in wanted:
                if run:
                    if scattered:
                        batches.append(_collected(buffer, scattered))
                        scattered = []
                    batches.append([_batch(np.ndarray(
                        (count, stride), np.uint8, buffer, at, (stride, 1)))])
                else:
                    scattered.append(at)
            at += count * stride
        elif opcode in _DESCRIPTIONS:
            describe(opcode, buffer[at + RECORD_HEAD:at + stride])
            at += stride
        else:
            break
    batches.append(_collected(buffer, scattered))
    return chain.from_iterable(batches), at


def in_lists(batches: Iterable[MessageBatch]) -> Iterator[list[MessageBatch]]:
    """Group batches into lists of 16 MiB, as there may be millions of batches."""
    held: list[MessageBatch] = []
    # 20 chunks of rosbag2, as one chunk may be far larger
    batch_bytes = 1 << 24
    left = batch_bytes
    for batch in batches:
        held.append(batch)
        # Allow 1 kB for the overhead of a batch.
        left -= batch.rows.nbytes + 1024
        if left < 0:
            yield held
            held, left = [], batch_bytes
    yield held


def equal_records(buffer: bytes, at: int, stride: int) -> int:
    """Count records from `at` on, spaced by `stride`, of equal opcode, length and channel."""
    most = (len(buffer) - at) // stride
    end = at + (most - 1) * stride
    # If the last one is equal, most likely all are.
    count, more = 1, most if buffer[end:end + _KEY] == buffer[at:at + _KEY] else 64
    while count < most:
        more = min(more, most - count)
        last = at + (count - 1) * stride
        rows = np.ndarray((more + 1, stride), np.uint8, buffer, last)
        like = rows_like_first(rows, [(0, _KEY)])
        if like is not None:
            return count - 1 + int(np.argmin(like))
        count += more
        more *= 16
    return count


def anywhere(buffer: bytes, kind: np.dtype[Any] | str) -> NDArray[Any]:
    """View what begins at each byte of a buffer as an item of this type."""
    kind = np.dtype(kind)
    return np.ndarray((max(len(buffer) - kind.itemsize + 1, 0),), kind, buffer, 0, (1,))


def collect(buffer: bytes, offsets: Ints, size: int) -> NDArray[np.uint8]:
    """Copy `size` bytes at each of `offsets`; return shape (len(offsets), size)."""
    return anywhere(buffer, f'V{size}')[offsets].view(np.uint8).reshape(-1, size)


def _verified(
    buffer: bytes, at: int, places: Ints,
    describe: Callable[[int, bytes], object],
) -> Ints | None:
    """Sort `places` from `at` on; return None unless their records fill the rest of the buffer."""
    places = np.unique(places[places >= at])
    heads = anywhere(buffer, _HEAD)
    if len(places) == 0 or places[-1] >= len(heads):
        return None
    lengths = heads['length'][places].astype(np.int64)
    if ((heads['opcode'][places] != _MESSAGE).any()
            or lengths.min() < _HEAD.itemsize - RECORD_HEAD or lengths.max() > len(buffer)):
        return None
    starts, stops = np.append(places, len(buffer)), np.append(at, places + RECORD_HEAD + lengths)
    gaps = np.flatnonzero(starts != stops)
    if all(_only_descriptions(buffer, stop, start, describe)
           for stop, start in zip(stops[gaps].tolist(), starts[gaps].tolist(), strict=True)):
        return places
    return None


def _only_descriptions(
    buffer: bytes, at: int, stop: int, describe: Callable[[int, bytes], object],
) -> bool:
    """Return whether only whole records lie between two messages."""
    while at < stop:
        opcode, length = OPCODE_LENGTH.unpack_from(buffer, at) if stop - at > 8 else (0, 0)
        if opcode not in _DESCRIPTIONS:
            return False
        describe(opcode, buffer[at + RECORD_HEAD:at + RECORD_HEAD + length])
        at += RECORD_HEAD + length
    return at == stop


def _collected(buffer: bytes, offsets: list[int] | Ints) -> Iterator[MessageBatch]:
    """Copy the message records at `offsets`, in order, into arrays of equal record size."""
    places = np.array(offsets, np.int64)
    lengths = anywhere(buffer, _HEAD)['length'][places]
    for start, stop in runs(np.diff(lengths) != 0, len(places)):
        yield _batch(collect(buffer, places[start:stop], RECORD_HEAD + int(lengths[start])))


def _batch(records: NDArray[np.uint8]) -> MessageBatch:
    heads = records[:, :_HEAD.itemsize].view(_HEAD)[:, 0]
    return MessageBatch(records[:, _HEAD.itemsize:], heads['log_ns'])
