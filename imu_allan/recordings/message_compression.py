# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Messages that rosbag2 compressed one by one, recognized by their first bytes."""

from collections.abc import Callable

from imu_allan.block import ImuBlock
from imu_allan.cdr import blocks_from_messages, decode_imu_rows, MalformedImu, Serialization
from imu_allan.recordings.decompress import DamagedData, decompress_frame
import numpy as np
from numpy.typing import NDArray

_ZSTD = b'\x28\xb5\x2f\xfd'
"""No message begins like this: CDR begins with a zero."""
_LARGEST_MESSAGE = 1 << 16


def decode_stored_rows(
    rows: NDArray[np.uint8],
    receive_ns: NDArray[np.int64],
    serialization: Serialization,
    on_malformed: Callable[[int, MalformedImu], None],
) -> list[ImuBlock]:
    """Decode messages of equal stored size, compressed or not; see `decode_imu_rows`."""
    if serialization != 'cdr' or len(rows) == 0 or rows[0, :4].tobytes() != _ZSTD:
        return decode_imu_rows(rows, receive_ns, serialization, on_malformed)
    return blocks_from_messages(
        [_unpacked(row.tobytes()) for row in rows], receive_ns, serialization, on_malformed)


def _unpacked(data: bytes) -> bytes:
    """Decompress one message; nothing, which is no message, where that is not possible."""
    try:
        return decompress_frame(data, _LARGEST_MESSAGE)
    except DamagedData:
        return b''
