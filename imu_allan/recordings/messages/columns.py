# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Conversion of records to columns: samples in SI units, stamps and frames.

No object is created per message. A record is a serialized message, with field paths as names of
the numbers, or a record in the log of an autopilot.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

from imu_allan.arrays import Array, Ints
from imu_allan.cdr import MalformedImu, OnMalformed, rows_like_first
from imu_allan.errors import shorten
from imu_allan.recordings.messages.imu_fields import Burst, ImuFields, Stamp, Vector
from imu_allan.recordings.messages.layouts import joint_field, Place
import numpy as np
from numpy.typing import NDArray

Columns = dict[str, NDArray[Any]]
"""For each sample: 'stamps' (one per column), 'receive_ns', 'samples', 'absent' and, for
bursts, 'message', the index of its message."""


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
