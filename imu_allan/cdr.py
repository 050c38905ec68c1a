# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Serialized messages as rows of bytes, and sensor_msgs/Imu written as such.

Messages of equal size are the rows of one array, without a Python object per message. Topics and
all containers yield them so; `imu_allan.recordings.messages` decodes them.

There are two serializations. ROS 2 writes CDR: four bytes of encapsulation whose second byte is
the byte order, then the fields, aligned to their own size counted from byte 4. ROS 1 writes the
fields packed, little endian.

References
----------
OMG Data Distribution Service Interoperability Wire Protocol (DDSI-RTPS) 2.5, section 10;
Common Object Request Broker Architecture 3.3, part 2, section 9.3 (CDR transfer syntax).

"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from imu_allan.arrays import Bools, Ints, runs
from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError
import numpy as np
from numpy.typing import NDArray

Serialization = Literal['cdr', 'ros1']
IMU_TYPE = 'sensor_msgs/msg/Imu'


class MalformedImu(ImuAllanError):
    """Bytes that are not a message of their type."""


OnMalformed = Callable[[int, MalformedImu], None]
"""Called with the number of messages left out and the reason for the first of them."""


@dataclass(frozen=True)
class MessageBatch:
    """
    Serialized messages of equal size, in order.

    Attributes
    ----------
    rows : ndarray of uint8, shape (n, size)
        The messages; may be a view of a buffer.
    receive_ns : ndarray of int64, shape (n,)
        Their receive stamps in nanoseconds.

    """

    rows: NDArray[np.uint8]
    receive_ns: Ints


def batches_of(messages: Sequence[bytes], receive_ns: Ints) -> Iterator[MessageBatch]:
    """Group consecutive messages of equal size into batches, one message per row."""
    sizes = np.fromiter(map(len, messages), np.int64, len(messages))
    for start, stop in runs(sizes[1:] != sizes[:-1], len(sizes)):
        rows = np.frombuffer(b''.join(messages[start:stop]), np.uint8)
        yield MessageBatch(rows.reshape(stop - start, int(sizes[start])), receive_ns[start:stop])


def anywhere(buffer: bytes | NDArray[np.uint8], kind: np.dtype[Any] | str) -> NDArray[Any]:
    """View what begins at each byte of a buffer as an item of this type."""
    kind = np.dtype(kind)
    return np.ndarray((max(len(buffer) - kind.itemsize + 1, 0),), kind, buffer, 0, (1,))


def collect(buffer: bytes | NDArray[np.uint8], offsets: Ints, size: int) -> NDArray[np.uint8]:
    """Copy `size` bytes at each of `offsets`; return shape (len(offsets), size)."""
    return anywhere(buffer, f'V{size}')[offsets].view(np.uint8).reshape(-1, size)


def encode_imu_rows(block: ImuBlock) -> NDArray[np.uint8]:
    """Encode the messages of a block as sensor_msgs/Imu in CDR, one in each row."""
    seconds = block.header_ns // 1_000_000_000
    if len(seconds) and not -1 << 31 <= seconds.min() <= seconds.max() < 1 << 31:
        raise ImuAllanError('header stamps before 1901 or after 2038 cannot be written: '
                            'builtin_interfaces/Time has 32 bits for the seconds')
    text = block.frame_id.encode() + b'\0'
    rows = np.zeros(len(block), [
        ('encapsulation', 'u1', 4), ('sec', '<i4'), ('nanosec', '<u4'), ('text_length', '<u4'),
        # Doubles are aligned to 8 bytes, counted from byte 4.
        ('frame_id', f'S{len(text) + (4 - len(text)) % 8}'),
        ('orientation', '<f8', 4), ('orientation_covariance', '<f8', 9),
        ('gyro', '<f8', 3), ('gyro_covariance', '<f8', 9),
        ('accel', '<f8', 3), ('accel_covariance', '<f8', 9)])
    rows['encapsulation'] = 0, 1, 0, 0
    rows['sec'], rows['nanosec'] = seconds, block.header_ns % 1_000_000_000
    rows['text_length'], rows['frame_id'] = len(text), text
    rows['orientation'] = 0.0, 0.0, 0.0, 1.0
    rows['orientation_covariance'][:, 0] = -1.0
    for half, first in (('gyro', 0), ('accel', 3)):
        rows[half] = block.samples[:, first:first + 3]
        rows[f'{half}_covariance'][block.absent[:, first // 3], 0] = -1.0
    return rows.view(np.uint8).reshape(len(block), rows.itemsize)


def rows_like_first(rows: NDArray[np.uint8], spans: Iterable[tuple[int, int]]) -> Bools | None:
    """Return which rows have the bytes of the first in these spans; None if all have."""
    like: Bools | None = None
    for start, stop in spans:
        if start < stop:
            items = rows[:, start:stop].view(f'V{stop - start}')[:, 0]
            # To compare all at once is several times faster than each with the first.
            if items.tobytes() != items[:1].tobytes() * len(rows):
                same = (rows[:, start:stop] == rows[0, start:stop]).all(axis=1)
                like = same if like is None else like & same
    return like
