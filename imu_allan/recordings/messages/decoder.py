# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Decoding of messages of any type to blocks: samples in SI units, stamps and frames.

`imu_allan.recordings.messages.layouts` locates the fields of messages with the same layout, which
are then read as columns. No object is created per message. A record is a serialized message, with
field paths as names of the numbers, or a record in the log of an autopilot. Among several stamps
the clock is chosen.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import accumulate
from typing import Any, Literal

from imu_allan.arrays import Array, Ints, runs
from imu_allan.block import ImuBlock
from imu_allan.cdr import (
    decode_imu_rows,
    MalformedImu,
    MessageBatch,
    OnMalformed,
    rows_like_first,
    Serialization,
)
from imu_allan.errors import shorten
from imu_allan.recordings.messages.definitions import Types
from imu_allan.recordings.messages.imu_fields import Burst, ImuFields, Stamp, Vector
from imu_allan.recordings.messages.layouts import joint_field, Place, RecordLayouts
import numpy as np
from numpy.typing import NDArray

Columns = dict[str, NDArray[Any]]
"""For each sample: 'stamps' (one per column), 'receive_ns', 'samples', 'absent' and, for
bursts, 'message', the index of its message."""
Decoder = Callable[[Iterable[MessageBatch], OnMalformed], list[ImuBlock]]
"""Decodes messages of a topic in order; use a new one for each reading."""


@dataclass(frozen=True)
class ImuMessages:
    """
    Description of how to read the messages of a topic; creates a decoder for each reading.

    Attributes
    ----------
    type_name : str
        Type of the messages.
    serialization : {'cdr', 'ros1'}
        How they are serialized.
    fields : ImuFields or None
        Which fields hold the samples; None for sensor_msgs/Imu itself.
    types : Types
        Fields of all types in the messages; None for sensor_msgs/Imu itself.
    factors : (float, float)
        Factors applied to gyroscope and accelerometer samples.

    """

    type_name: str
    serialization: Serialization = 'cdr'
    fields: ImuFields | None = None
    types: Types | None = None
    factors: tuple[float, float] = (1.0, 1.0)

    def decoder(self) -> Decoder:
        """Return a decoder for one reading."""
        plain = self._decoded if self.fields is None else FieldsDecoder(self)
        if self.factors == (1.0, 1.0):
            return plain
        factors = np.repeat(self.factors, 3)

        def scaled(batches: Iterable[MessageBatch], on_malformed: OnMalformed) -> list[ImuBlock]:
            return [replace(block, samples=block.samples * factors)
                    for block in plain(batches, on_malformed)]

        return scaled

    def _decoded(self, batches: Iterable[MessageBatch], on_malformed: OnMalformed,
                 ) -> list[ImuBlock]:
        """Decode sensor_msgs/Imu itself."""
        return [block for batch in batches for block in decode_imu_rows(
            batch.rows, batch.receive_ns, self.serialization, on_malformed)]

    @property
    def half(self) -> Literal['gyro', 'accel'] | None:
        """Return the only sensor with samples in the messages; None if both have samples."""
        if self.fields is None or (self.fields.gyro and self.fields.accel):
            return None
        return 'gyro' if self.fields.gyro else 'accel'

    def reported(self) -> str:
        """Describe in words how the messages are read."""
        if self.fields is None:
            return self.type_name
        return f'{self.type_name}, {self.fields.what}'


class FieldsDecoder:
    """Decoder for message types whose samples are in arbitrary fields."""

    def __init__(self, messages: ImuMessages) -> None:
        assert messages.fields is not None
        assert messages.types is not None
        self._fields = messages.fields
        self._layouts = RecordLayouts(messages.types, messages.type_name, messages.serialization,
                                      messages.fields)
        self._clock: int | None = None
        self._frames: dict[str, int] = {}

    def __call__(self, batches: Iterable[MessageBatch], on_malformed: OnMalformed,
                 ) -> list[ImuBlock]:
        """Decode messages in order; malformed ones are reported."""
        held = [batch for batch in batches if len(batch.rows)]
        self._frames = {}
        if not held:
            return []
        columns = self._columns(held, on_malformed)
        if columns is None or not len(columns['samples']):
            return []
        header_ns = self._header_ns(columns['stamps'])
        names, frames = list(self._frames), columns['frames']
        changes = np.diff(frames) != 0 if len(names) > 1 else np.zeros(0, np.bool_)
        return [ImuBlock(header_ns[a:b], columns['receive_ns'][a:b], columns['samples'][a:b],
                         columns['absent'][a:b], names[frames[a]])
                for a, b in runs(changes, len(header_ns))]

    # ----------------------------------------------------------------------------------- columns

    def _columns(self, batches: Sequence[MessageBatch], on_malformed: OnMalformed,
                 ) -> Columns | None:
        """Decode batches, grouped by message size."""
        bounds = [0, *accumulate(len(batch.rows) for batch in batches)]
        by_size: dict[int, list[int]] = {}
        for number, batch in enumerate(batches):
            by_size.setdefault(batch.rows.shape[1], []).append(number)
        stamps = self._fields.stamps
        if self._clock is not None:
            stamps = (stamps[self._clock],)
        decoded: list[Columns] = []
        for numbers in by_size.values():
            rows = _joined([batches[number].rows for number in numbers])
            receive_ns = _joined([batches[number].receive_ns for number in numbers])
            index = _joined([np.arange(bounds[n], bounds[n + 1]) for n in numbers])
            for which, layout in self._layouts.groups(rows, on_malformed):
                same = rows[which]
                part = extract(self._fields, stamps, same.view(layout.record)[:, 0],
                               receive_ns[which], on_malformed)
                frames = frames_of(same, layout.frame_id, self._frames)
                of = part.get('message', slice(None))
                part['frames'], part['message'] = frames[of], index[which][of]
                decoded.append(part)
        if len(decoded) < 2:
            return decoded[0] if decoded else None
        order = np.argsort(np.concatenate([part['message'] for part in decoded]), kind='stable')
        return {name: np.concatenate([part[name] for part in decoded])[order]
                for name in decoded[0]}

    # ------------------------------------------------------------------------------------- clock

    def _header_ns(self, stamps: Ints) -> Ints:
        """Return the first valid and mostly distinct stamps; keep the choice once made."""
        if not stamps.shape[1]:
            return np.zeros(len(stamps), np.int64)
        clock = 0
        if self._clock is None:
            clock = next((number for number, times in enumerate(stamps.T) if _advances(times)), 0)
            # Fix the choice of the clock once there are this many messages.
            if len(stamps) >= 16:
                self._clock = clock
        times: Ints = np.maximum(stamps[:, clock], 0)
        return times


def _joined(arrays: list[NDArray[Any]]) -> NDArray[Any]:
    """Join arrays; most often there is one, which is not copied."""
    return np.concatenate(arrays) if len(arrays) > 1 else arrays[0]


def _advances(times: Ints) -> bool:
    """Return whether stamps are valid and at least half of them are distinct."""
    valid = bool((times > 0).all())
    if len(times) == 1:
        return valid and bool(times[0] % 1_000_000_000)
    return valid and 2 * len(np.unique(times)) >= len(times)


def extract(fields: ImuFields, stamps_read: Sequence[Stamp], messages: NDArray[np.void],
            receive_ns: Ints, on_malformed: OnMalformed) -> Columns:
    """Extract samples and stamps of shape (n,) records; which stamps hold is chosen later."""
    count = len(messages)
    stamps = np.empty((len(stamps_read), count), np.int64).T
    for number, stamp in enumerate(stamps_read):
        stamps[:, number] = time_of(messages, stamp)
    if fields.burst is not None:
        return _burst(fields, fields.burst, messages, stamps, receive_ns, on_malformed)
    samples = np.empty((count, 6))
    absent = np.empty((count, 2), np.bool_)
    if fields.gyro is None or fields.accel is None:
        samples.fill(0)
        absent.fill(True)
    for first, vector in fields.vectors():
        _fill(samples[:, first:first + 3], messages, vector)
        missing = absent[:, first // 3]
        if vector.covariance is None:
            missing.fill(False)
        else:
            np.equal(messages[vector.covariance], -1.0, out=missing)
    return {'stamps': stamps, 'receive_ns': np.array(receive_ns, np.int64), 'samples': samples,
            'absent': absent}


def _burst(fields: ImuFields, burst: Burst, messages: NDArray[np.void],
           stamps: Ints, receive_ns: Ints,
           on_malformed: OnMalformed) -> Columns:
    """Expand messages with many samples; the stamp is that of the last sample."""
    [(first, vector)] = fields.vectors()
    width = messages[vector.paths[0]].shape[1]
    filled = messages[burst.samples].astype(np.int64)
    step_ns = messages[burst.step_us].astype(np.float64) * 1e3
    # A burst sampled at less than 1 Hz is not from an IMU, but a damaged number.
    sound = (filled > 0) & (filled <= width) & np.isfinite(step_ns) & (step_ns > 0) & (
        step_ns < 1e9)
    if not sound.all():
        on_malformed(int((~sound).sum()), MalformedImu(
            f'{burst.samples} is not 1 to {width}, or {burst.step_us} is no time'))
    place = np.arange(width)
    before_ns = np.rint(np.where(sound, step_ns, 0)[:, np.newaxis] * (
        filled[:, np.newaxis] - 1 - place)).astype(np.int64)
    message, number = np.nonzero((place < filled[:, np.newaxis]) & sound[:, np.newaxis])
    bursts = np.stack([messages[path] for path in vector.paths], axis=2).astype(np.float64)
    _to_si(bursts, vector, messages)
    samples = np.zeros((len(message), 6))
    samples[:, first:first + 3] = bursts[message, number]
    absent = np.ones((len(message), 2), np.bool_)
    absent[:, first // 3] = False
    before_ns = before_ns[message, number]
    return {'stamps': stamps[message] - before_ns[:, np.newaxis],
            'receive_ns': receive_ns[message] - before_ns, 'samples': samples, 'absent': absent,
            'message': message}


def frames_of(rows: NDArray[np.uint8], place: Place | None, seen: dict[str, int]) -> Ints:
    """Return indices of the frames that messages name; enter new names in `seen`."""
    if place is None:
        return np.full(len(rows), seen.setdefault('', len(seen)))
    size, end = place.count, place.at + place.count
    # In the usual case all messages name one frame.
    named = rows if rows_like_first(rows, [(place.at, end)]) is not None else rows[:1]
    items = named[:, place.at:end].tobytes()
    # With size 0 every slice is the empty text, as it should be.
    frames = [seen.setdefault(_text(items[row * size:(row + 1) * size]), len(seen))
              for row in range(len(named))]
    return np.array(frames).repeat(len(rows) // len(named))


def _fill(out: Array, messages: NDArray[np.void], vector: Vector) -> None:
    """Write the values of a vector, in SI units, to `out` of shape (n, 3)."""
    side_by_side = joint_field(vector)
    if side_by_side not in (messages.dtype.names or ()):
        for axis, path in enumerate(vector.paths):
            out[:, axis] = messages[path]
    elif messages[side_by_side].dtype.kind == 'V':
        out.view('V24')[:, 0] = messages[side_by_side]
    else:
        out[:] = messages[side_by_side]
    _to_si(out, vector, messages)


def _to_si(numbers: Array, vector: Vector, messages: NDArray[np.void]) -> None:
    """Convert numbers of shape (n, 3) or (n, width, 3) to rad/s or m/s^2, in place."""
    def each(path: str) -> Array:
        return messages[path].astype(np.float64).reshape(-1, *(1,) * (numbers.ndim - 1))

    if vector.scale is not None:
        numbers *= each(vector.scale)
    if vector.per is not None:
        seconds = each(vector.per) * 1e-6
        seconds[seconds == 0] = np.nan
        numbers /= seconds
    if vector.factor != 1.0:
        numbers *= vector.factor


def time_of(messages: NDArray[np.void], stamp: Stamp) -> Ints:
    """Return stamps in nanoseconds; -1 for invalid times."""
    if stamp.unit_ns == 0:
        seconds, nanoseconds = stamp.paths
        times: Ints = messages[seconds].astype(np.int64)
        parts = messages[nanoseconds].astype(np.int64)
        times *= 1_000_000_000
        times += parts
        # Negative values are large as unsigned numbers, so one comparison checks both bounds.
        beyond = parts.view(np.uint64) >= 1_000_000_000
        if beyond.any():
            times[beyond] = -1
        return times
    number = messages[stamp.path]
    # Integers are scaled exactly, floating-point numbers as doubles.
    exact = number.dtype.kind in 'iu'
    rough = number.astype(np.float64) * stamp.unit_ns
    # Larger numbers of nanoseconds are not valid times.
    sound = np.isfinite(rough) & (np.abs(rough) < 2**62)
    whole = number.astype(np.int64) * stamp.unit_ns if exact else np.rint(
        np.where(sound, rough, 0)).astype(np.int64)
    return np.where(sound, whole, -1)


@lru_cache(maxsize=256)
def _text(characters: bytes) -> str:
    # CDR strings end with a null byte, those of ROS 1 do not.
    return shorten(characters.removesuffix(b'\0').decode('utf-8', 'replace'))
