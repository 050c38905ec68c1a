# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Messages of one form to columns: samples, stamps and frames, without an object a message."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from imu_allan.cdr import MalformedImu
from imu_allan.errors import shorten
from imu_allan.recordings.messages.forms import Form, OnMalformed, together
from imu_allan.recordings.messages.imu_fields import Burst, ImuFields, Stamp, Vector
from imu_allan.recordings.messages.layout import Place
from imu_allan.recordings.messages.values import to_si, unrolled, unsound
import numpy as np
from numpy.typing import NDArray

_NANOSECONDS = 1_000_000_000  # in a second
_LATEST = 2**62
"""Stamps in nanoseconds beyond this are no time."""


@dataclass
class Columns:
    """
    What was taken out of messages.

    `stamps` has a row for each of the stamps there may be, `frames` the numbers of names, or the
    one of all; without `kept`, every sample is.
    """

    stamps: NDArray[np.int64]
    receive_ns: NDArray[np.int64]
    samples: NDArray[np.float64]
    absent: NDArray[np.bool_]
    kept: NDArray[np.bool_] | None = None
    frames: NDArray[np.int64] | int = 0


def taken(
    fields: ImuFields, stamps_read: Sequence[Stamp], frames_seen: dict[str, int],
    rows: NDArray[np.uint8], receive_ns: NDArray[np.int64], form: Form,
    on_malformed: OnMalformed | None, *, one_frame: bool = False,
) -> Columns:
    """
    Take samples, stamps and frame_id out of rows of one form.

    Parameters
    ----------
    fields : ImuFields
        What is read of them.
    stamps_read : sequence of Stamp
        The stamps among which one is chosen later.
    frames_seen : dict of str to int
        Numbers of the names of frames; new ones are entered.
    rows : ndarray of uint8, shape (n, size)
        The messages.
    receive_ns : ndarray of int64, shape (n,)
        Their receive stamps.
    form : Form
        Where the fields stand.
    on_malformed : callable, optional
        Told of bursts that are none; without it they raise MalformedImu.
    one_frame : bool, optional
        Where it is known that all name the same frame.

    """
    count = len(rows)
    messages = rows.view(form.record)[:, 0]
    stamps = np.empty((len(stamps_read), count), np.int64)
    for number, stamp in enumerate(stamps_read):
        stamps[number] = _time(messages, stamp)
    frames: NDArray[np.int64] | int = 0
    if form.frame_id is not None:
        numbers = [frames_seen.setdefault(text, len(frames_seen)) for text in _texts(
            rows[:1] if one_frame else rows, form.frame_id)]
        frames = numbers[0] if one_frame else np.array(numbers)
    if fields.burst is not None:
        return _burst(fields, fields.burst, messages, stamps, receive_ns, frames, on_malformed)
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
    return Columns(stamps, np.array(receive_ns, np.int64), samples, absent, frames=frames)


def _burst(fields: ImuFields, burst: Burst, messages: NDArray[np.void],
           stamps: NDArray[np.int64], receive_ns: NDArray[np.int64],
           frames: NDArray[np.int64] | int, on_malformed: OnMalformed | None) -> Columns:
    """Unroll messages of many samples, each at its own time; the stamp is that of the last."""
    [(first, vector)] = fields.vectors()
    width = messages[vector.paths[0]].shape[1]
    before, kept, sound = unrolled(burst, width, messages.__getitem__)
    if not sound.all():
        error = MalformedImu(unsound(burst, width))
        if on_malformed is None:
            raise error
        on_malformed(int((~sound).sum()), error)
    samples = np.zeros((len(messages), width, 6))
    for axis, path in enumerate(vector.paths):
        samples[:, :, first + axis] = messages[path]
    to_si(samples[:, :, first:first + 3], vector, messages.__getitem__)
    absent = np.ones((len(messages) * width, 2), np.bool_)
    absent[:, first // 3] = False
    return Columns(
        (stamps[:, :, np.newaxis] - before).reshape(len(stamps), -1),
        (receive_ns[:, np.newaxis] - before).reshape(-1), samples.reshape(-1, 6), absent,
        kept.reshape(-1), frames if isinstance(frames, int) else np.repeat(frames, width))


def in_order(decoded: Sequence[tuple[NDArray[np.intp], Columns]]) -> Columns:
    """
    Put what was decoded in groups into the order of the messages.

    Parameters
    ----------
    decoded : sequence of (ndarray of int, Columns)
        Of each sample the number of its message, and the samples.

    """
    if len(decoded) == 1:
        return decoded[0][1]
    if not decoded:
        empty = np.zeros(0)
        return Columns(empty.reshape(0, 0).astype(np.int64), empty.astype(np.int64),
                       empty.reshape(0, 6), np.zeros((0, 2), np.bool_))
    order = np.argsort(np.concatenate([index for index, _ in decoded]), kind='stable')
    parts = [columns for _, columns in decoded]

    def joined(name: str) -> NDArray[Any]:
        return np.concatenate([getattr(part, name) for part in parts])

    def each(of: Callable[[Columns], Any]) -> NDArray[Any]:
        return np.concatenate([np.broadcast_to(of(part), len(part.samples)) for part in parts])

    return chosen(Columns(
        np.concatenate([part.stamps for part in parts], axis=1),
        joined('receive_ns'), joined('samples'), joined('absent'),
        each(lambda part: True if part.kept is None else part.kept),
        each(lambda part: part.frames)), order)


def chosen(columns: Columns, index: NDArray[np.intp] | NDArray[np.bool_]) -> Columns:
    """Take some samples, or all in another order."""
    kept, frames = columns.kept, columns.frames
    return Columns(
        columns.stamps[:, index], columns.receive_ns[index], columns.samples[index],
        columns.absent[index], None if kept is None else kept[index],
        frames if isinstance(frames, int) else frames[index])


def _fill(out: NDArray[np.float64], messages: NDArray[np.void], vector: Vector) -> None:
    """Write the numbers of a vector, in SI units, into `out` of shape (n, 3)."""
    side_by_side = together(vector)
    if side_by_side not in (messages.dtype.names or ()):
        for axis, path in enumerate(vector.paths):
            out[:, axis] = messages[path]
    elif messages[side_by_side].dtype.kind == 'V':
        out.view('V24')[:, 0] = messages[side_by_side]
    else:
        out[:] = messages[side_by_side]
    to_si(out, vector, messages.__getitem__)


def _time(messages: NDArray[np.void], stamp: Stamp) -> NDArray[np.int64]:
    """Return stamps in nanoseconds; -1 for what is no time."""
    if stamp.unit_ns == 0:
        seconds, nanoseconds = stamp.paths
        times: NDArray[np.int64] = messages[seconds].astype(np.int64)
        parts = messages[nanoseconds].astype(np.int64)
        times *= _NANOSECONDS
        times += parts
        # Those below zero are large without a sign.
        beyond = parts.view(np.uint64) >= _NANOSECONDS
        if beyond.any():
            times[beyond] = -1
        return times
    number = messages[stamp.path]
    # Through doubles where the field is one, else exactly.
    exact = number.dtype.kind in 'iu'
    rough = number.astype(np.float64) * stamp.unit_ns
    sound = np.isfinite(rough) & (np.abs(rough) < _LATEST)
    whole = number.astype(np.int64) * stamp.unit_ns if exact else np.rint(
        np.where(sound, rough, 0)).astype(np.int64)
    return np.where(sound, whole, -1)


def _texts(rows: NDArray[np.uint8], place: Place) -> Iterator[str]:
    """Read a text in every row."""
    items = rows[:, place.at:place.at + place.count].tobytes()
    # Without characters, the text ends after no byte of any row.
    for row in range(len(rows)):
        yield _text(items[row * place.count:(row + 1) * place.count])


@lru_cache(maxsize=256)
def _text(characters: bytes) -> str:
    # Of CDR alone, the last one is a zero; it is none in any text.
    return shorten(characters.removesuffix(b'\0').decode('utf-8', 'replace'))
