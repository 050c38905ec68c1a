# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Serialized sensor_msgs/Imu to arrays and back.

Messages of equal size are decoded together as rows of one array, without a Python object per
message. The same decoder serves the topic and every container.

There are two serializations. ROS 2 writes CDR: four bytes of encapsulation whose second byte is
the byte order, then the fields, aligned to their own size counted from byte 4. ROS 1 writes the
fields packed, little endian. In both, header.stamp is at byte 4, the length of header.frame_id at
byte 12 and its text at byte 16. 37 doubles follow: orientation (4), its covariance (9),
angular_velocity (3), covariance (9), linear_acceleration (3), covariance (9).

References
----------
OMG Data Distribution Service Interoperability Wire Protocol (DDSI-RTPS) 2.5, section 10;
Common Object Request Broker Architecture 3.3, part 2, section 9.3 (CDR transfer syntax).

"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from struct import unpack_from
from typing import Any, Literal

from imu_allan.arrays import Bools, Ints, runs
from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError, shorten
import numpy as np
from numpy.typing import NDArray

Serialization = Literal['cdr', 'ros1']
IMU_TYPE = 'sensor_msgs/msg/Imu'

_TEXT_LENGTH_AT = 12  # after encapsulation, sec and nanosec, of 4 bytes each
_TEXT_AT = 16         # after its length, a uint32
_DOUBLES = 37         # 4 + 9 + 3 + 9 + 3 + 9: a quaternion, two vectors, three covariances


class MalformedImu(ImuAllanError):
    """Bytes that are not a sensor_msgs/Imu message."""


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


@dataclass(frozen=True)
class ImuLayout:
    """
    Positions of the fields in Imu messages of one size, frame and byte order.

    Attributes
    ----------
    keys : list of (int, int)
        Start and stop of the bytes in which they agree.
    record : dtype
        A message as a record of named fields.
    frame_id : str
        header.frame_id.

    """

    keys: Sequence[tuple[int, int]]
    record: np.dtype[np.void]
    frame_id: str


def byte_order_of(message: bytes | memoryview) -> Literal['<', '>']:
    """Return the byte order of a message in CDR; raise MalformedImu for another encapsulation."""
    encapsulation = int.from_bytes(message[:2], 'big')
    if encapsulation > 1:
        raise MalformedImu(f'encapsulation 0x{encapsulation:04x} is not plain CDR')
    return '<' if encapsulation else '>'


def imu_layout(message: bytes | memoryview, serialization: Serialization = 'cdr') -> ImuLayout:
    """Find the fields of one message from its encapsulation, frame_id and length."""
    size = len(message)
    if size < _TEXT_AT + 8 * _DOUBLES:
        raise MalformedImu(
            f'{size} bytes are too few for a sensor_msgs/Imu message '
            f'({_TEXT_AT + 8 * _DOUBLES} at least)')
    is_cdr = serialization == 'cdr'
    byte_order = byte_order_of(message) if is_cdr else '<'
    [length] = unpack_from(byte_order + 'I', message, _TEXT_LENGTH_AT)
    text_end = _TEXT_AT + length
    doubles_at = _doubles_at(text_end, serialization)
    extra = size - doubles_at - 8 * _DOUBLES
    # Some middleware pads a payload to a multiple of four bytes.
    if not 0 <= extra <= (3 if is_cdr else 0):
        raise MalformedImu(
            f'{size} bytes are not a sensor_msgs/Imu message whose frame_id has {length} bytes')
    text = bytes(message[_TEXT_AT:text_end])
    if is_cdr:
        text = text.removesuffix(b'\0')
    named = (_TEXT_LENGTH_AT, text_end)
    return ImuLayout(
        [(0, 2), named] if is_cdr else [named],
        _imu_record(byte_order, doubles_at, size, serialization),
        # It is shown and saved from here on, and a publisher may send megabytes of it.
        shorten(text.decode('utf-8', 'replace')))


def decode_imu_rows(
    rows: NDArray[np.uint8], receive_ns: Ints, serialization: Serialization,
    on_malformed: OnMalformed,
) -> list[ImuBlock]:
    """
    Decode messages of equal size at once, one in each row of bytes, which need not adjoin.

    Another frame_id or byte order begins another block.
    """
    if not len(rows):
        return []
    # In the usual case the layout of the first is that of all.
    with suppress(MalformedImu):
        layout = imu_layout(rows[0].data, serialization)
        if rows_like_first(rows, layout.keys) is None:
            return [_decode_run(rows, receive_ns, layout)]
    # The padding after the text may hold anything, so a key ends with its text.
    keys = np.array([_key(row, serialization) for row in rows], object)
    blocks: list[ImuBlock] = []
    for start, stop in runs(keys[1:] != keys[:-1], len(keys)):
        run = rows[start:stop]
        try:
            layout = imu_layout(run[0].data, serialization)
        except MalformedImu as error:
            on_malformed(stop - start, error)
            continue
        blocks.append(_decode_run(run, receive_ns[start:stop], layout))
    return blocks


def blocks_from_messages(messages: Sequence[bytes], receive_ns: Ints,
                         on_malformed: OnMalformed) -> list[ImuBlock]:
    """Decode messages in CDR, of any size, in order."""
    return [block for batch in batches_of(messages, receive_ns)
            for block in decode_imu_rows(batch.rows, batch.receive_ns, 'cdr', on_malformed)]


def batches_of(messages: Sequence[bytes], receive_ns: Ints) -> Iterator[MessageBatch]:
    """Group consecutive messages of equal size into batches, one message per row."""
    sizes = np.fromiter(map(len, messages), np.int64, len(messages))
    for start, stop in runs(sizes[1:] != sizes[:-1], len(sizes)):
        rows = np.frombuffer(b''.join(messages[start:stop]), np.uint8)
        yield MessageBatch(rows.reshape(stop - start, int(sizes[start])), receive_ns[start:stop])


def encode_imu_rows(
    block: ImuBlock, serialization: Serialization = 'cdr', byte_order: Literal['<', '>'] = '<',
) -> NDArray[np.uint8]:
    """Encode the messages of a block, one in each row; the inverse of `decode_imu_rows`."""
    seconds = block.header_ns // 1_000_000_000
    if serialization == 'cdr' and len(seconds) and not (
            -1 << 31 <= seconds.min() <= seconds.max() < 1 << 31):
        raise ImuAllanError('header stamps before 1901 or after 2038 cannot be written: '
                            'builtin_interfaces/Time has 32 bits for the seconds')
    text = block.frame_id.encode()
    if serialization == 'cdr':
        text += b'\0'
    text_end = _TEXT_AT + len(text)
    doubles_at = _doubles_at(text_end, serialization)
    rows = np.zeros((len(block), doubles_at + 8 * _DOUBLES), np.uint8)
    if serialization == 'cdr':
        rows[:, 1] = byte_order == '<'
    rows[:, _TEXT_AT:text_end] = np.frombuffer(text, np.uint8)
    fields = rows.view(_imu_record(byte_order, doubles_at, rows.shape[1], serialization))[:, 0]
    fields['text_length'] = len(text)
    fields['sec'] = seconds
    fields['nanosec'] = block.header_ns % 1_000_000_000
    fields['orientation_w'] = 1.0
    fields['orientation_covariance'] = -1.0
    fields['gyro'] = block.samples[:, :3]
    fields['accel'] = block.samples[:, 3:]
    fields['gyro_covariance'] = np.where(block.absent[:, 0], -1.0, 0.0)
    fields['accel_covariance'] = np.where(block.absent[:, 1], -1.0, 0.0)
    return rows


def _doubles_at(text_end: int, serialization: Serialization) -> int:
    return 4 + (text_end - 4 + 7) // 8 * 8 if serialization == 'cdr' else text_end


@lru_cache(maxsize=256)
def _imu_record(
    byte_order: Literal['<', '>'], doubles_at: int, size: int, serialization: Serialization,
) -> np.dtype[np.void]:
    """Describe one message of `size` bytes as a record of named fields."""
    places = {
        # In ROS 1, seconds are unsigned.
        'sec': ('i4' if serialization == 'cdr' else 'u4', 4), 'nanosec': ('u4', 8),
        'text_length': ('u4', _TEXT_LENGTH_AT),
        'orientation_w': ('f8', doubles_at + 8 * 3),
        'orientation_covariance': ('f8', doubles_at + 8 * 4),
        'gyro': ('3f8', doubles_at + 8 * 13), 'gyro_covariance': ('f8', doubles_at + 8 * 16),
        'accel': ('3f8', doubles_at + 8 * 25), 'accel_covariance': ('f8', doubles_at + 8 * 28)}
    return record_of({name: (byte_order + kind, at) for name, (kind, at) in places.items()}, size)


def record_of(fields: Mapping[str, tuple[Any, int]], size: int) -> np.dtype[np.void]:
    """Describe `size` bytes as a record of fields, given by type and offset."""
    return np.dtype({
        'names': list(fields), 'formats': [kind for kind, _ in fields.values()],
        'offsets': [at for _, at in fields.values()], 'itemsize': size})


def _decode_run(rows: NDArray[np.uint8], receive_ns: Ints, layout: ImuLayout) -> ImuBlock:
    fields = rows.view(layout.record)[:, 0]
    samples = np.empty((6, len(rows))).T
    samples[:, :3] = fields['gyro']
    samples[:, 3:] = fields['accel']
    header_ns = fields['sec'].astype(np.int64)
    header_ns *= 1_000_000_000
    header_ns += fields['nanosec']
    absent = np.empty((len(rows), 2), np.bool_)
    np.equal(fields['gyro_covariance'], -1.0, out=absent[:, 0])
    np.equal(fields['accel_covariance'], -1.0, out=absent[:, 1])
    return ImuBlock(header_ns, np.array(receive_ns, np.int64), samples, absent, layout.frame_id)


def _key(row: NDArray[np.uint8], serialization: Serialization) -> bytes:
    try:
        layout = imu_layout(row.data, serialization)
    except MalformedImu as error:
        return b'malformed ' + str(error).encode()
    return b''.join(row[start:stop].tobytes() for start, stop in layout.keys)


def rows_like_first(rows: NDArray[np.uint8], spans: Iterable[tuple[int, int]]) -> Bools | None:
    """Return which rows have the bytes of the first in these spans; None if all have."""
    like: Bools | None = None
    for start, stop in spans:
        # Five copies of numbers cost as much as one of a text.
        short = stop - start <= 32
        parts = _as_numbers(start, stop) if short else [(slice(start, stop), f'V{stop - start}')]
        for place, kind in parts:
            items = rows[:, place].view(kind)[:, 0]
            if items.tobytes() != items[:1].tobytes() * len(rows):
                same = items == items[0] if short else (
                    rows[:, place] == rows[0, place]).all(axis=1)
                like = same if like is None else like & same
    return like


@lru_cache(maxsize=256)
def _as_numbers(start: int, stop: int) -> list[tuple[slice, str]]:
    """Cover a few bytes by numbers, which can be compared several times faster."""
    if start >= stop:
        return []
    width = next(width for width in (8, 4, 2, 1) if width <= stop - start)
    # The last number may overlap the previous one.
    return [(slice(at, at + width), f'u{width}')
            for at in (*range(start, stop - width, width), stop - width)]
