# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Messages that rosbag2 compressed one by one, recognized by their first bytes."""

from collections.abc import Iterable, Iterator
from itertools import groupby, islice

from imu_allan.cdr import batches_of, MessageBatch
from imu_allan.recordings.formats.decompress import (
    DamagedData,
    declared_size,
    decompress_frame,
)
from imu_allan.recordings.formats.effort import Effort
import numpy as np

_ZSTD = b'\x28\xb5\x2f\xfd'
"""No message begins like this: CDR begins with a zero."""
_LARGEST_MESSAGE = 1 << 16
"""An Imu has 324 bytes and its frame_id: 200 times as much; a bomb expands to no more."""


def unpacked(batches: Iterable[MessageBatch], effort: Effort) -> Iterator[MessageBatch]:
    """Decompress the messages of `batches`, where they are compressed."""
    for compressed, group in groupby(batches, _is_compressed):
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


def _is_compressed(batch: MessageBatch) -> bool:
    return batch.rows[0, :len(_ZSTD)].tobytes() == _ZSTD


def _unpacked_message(message: bytes, effort: Effort) -> bytes:
    """Decompress one message; nothing, which is no message, where that is not possible."""
    try:
        effort.expand(declared_size(message) or _LARGEST_MESSAGE)
        return decompress_frame(message, _LARGEST_MESSAGE)
    except DamagedData:
        return b''
