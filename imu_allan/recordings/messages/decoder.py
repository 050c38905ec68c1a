# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Messages of any type to blocks of samples, in one module because one pass does it all.

The fields are found by one walk through a message (`imu_allan.recordings.messages.layout`) and
then taken out of all messages of the same layout as columns, without a Python object a message.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal, Protocol

from imu_allan.block import ImuBlock
from imu_allan.cdr import decode_imu_rows, MalformedImu, Serialization
from imu_allan.errors import shorten
from imu_allan.recordings.messages.definitions import Types
from imu_allan.recordings.messages.imu_fields import ImuFields, split_path, Stamp, Vector
from imu_allan.recordings.messages.layout import Layout, Place, walk
from imu_allan.recordings.messages.piece import Piece
import numpy as np
from numpy.typing import NDArray

OnMalformed = Callable[[int, MalformedImu], None]

_NANOSECONDS = 1_000_000_000  # in a second
_ENOUGH = 16
"""Messages from which on it is decided which of several stamps is used."""
_REMEMBERED = 64
"""Layouts of each of as many sizes that are kept."""
_LATEST = 2**62
"""Stamps in nanoseconds beyond this are no time."""


class Decoder(Protocol):
    """What turns the messages of a topic into blocks; one for each reading of the topic."""

    def __call__(self, pieces: Iterable[Piece], on_malformed: OnMalformed | None = None,
                 ) -> list[ImuBlock]:
        """Decode messages in their order; malformed ones raise MalformedImu, or are told."""


@dataclass(frozen=True)
class ImuMessages:
    """
    How the messages of a topic are read; makes a decoder for each reading.

    Attributes
    ----------
    type_name : str
        Their type.
    serialization : {'cdr', 'ros1'}
        How they are serialized.
    fields : ImuFields or None
        Where the samples stand; None for sensor_msgs/Imu itself.
    types : Types
        Fields of the types in them; empty for sensor_msgs/Imu itself.
    factors : (float, float)
        What gyroscope and accelerometer are multiplied by.

    """

    type_name: str
    serialization: Serialization = 'cdr'
    fields: ImuFields | None = None
    types: Types | None = None
    factors: tuple[float, float] = (1.0, 1.0)

    def decoder(self) -> Decoder:
        """Return a decoder for one reading."""
        plain = (_BareImu(self.serialization) if self.fields is None
                 else FieldsDecoder(self))
        return plain if self.factors == (1.0, 1.0) else _Scaled(plain, self.factors)

    @property
    def half(self) -> Literal['gyro', 'accel'] | None:
        """Return the sensor whose samples they are where it is one alone, else None."""
        if self.fields is None or (self.fields.gyro and self.fields.accel):
            return None
        return 'gyro' if self.fields.gyro else 'accel'

    def told(self) -> str:
        """Say in words how they are read."""
        if self.fields is None:
            return self.type_name
        return f'{self.type_name}, {self.fields.what}'


BARE_IMU = ImuMessages('sensor_msgs/msg/Imu')


class _BareImu:
    def __init__(self, serialization: Serialization) -> None:
        self._serialization = serialization

    def __call__(self, pieces: Iterable[Piece], on_malformed: OnMalformed | None = None,
                 ) -> list[ImuBlock]:
        return [block for piece in pieces for block in decode_imu_rows(
            piece.rows, piece.receive_ns, self._serialization, on_malformed)]


class _Scaled:
    def __init__(self, plain: Decoder, factors: tuple[float, float]) -> None:
        self._plain = plain
        self._factors = np.repeat(factors, 3)

    def __call__(self, pieces: Iterable[Piece], on_malformed: OnMalformed | None = None,
                 ) -> list[ImuBlock]:
        return [replace(block, samples=block.samples * self._factors)
                for block in self._plain(pieces, on_malformed)]


@dataclass
class _Columns:
    """
    What was taken out of messages.

    `stamps` has a row for each of the stamps there may be, `frames` numbers of names.
    """

    stamps: NDArray[np.int64]
    receive_ns: NDArray[np.int64]
    samples: NDArray[np.float64]
    absent: NDArray[np.bool_]
    kept: NDArray[np.bool_]
    frames: NDArray[np.int64]


class FieldsDecoder:
    """
    Decodes messages whose samples stand in the fields of some type.

    Parameters
    ----------
    messages : ImuMessages
        With `fields` and `types`.

    """

    def __init__(self, messages: ImuMessages) -> None:
        assert messages.fields is not None
        assert messages.types is not None
        self._messages = messages
        self._fields = messages.fields
        self._types = messages.types
        self._wanted = messages.fields.paths()
        self._clock: int | None = None
        self._frames: dict[str, int] = {'': 0}
        self._step_ns = 0.0
        self._layouts: dict[int, list[tuple[bytes, Layout]]] = {}

    def __call__(self, pieces: Iterable[Piece], on_malformed: OnMalformed | None = None,
                 ) -> list[ImuBlock]:
        """Decode messages in their order; malformed ones raise MalformedImu, or are told."""
        held = [piece for piece in pieces if len(piece.rows)]
        self._frames = {'': 0}
        if not held:
            return []
        columns = self._columns(held, on_malformed)
        if not columns.kept.any():
            return []
        if not columns.kept.all():
            columns = _Columns(*(
                values[..., columns.kept] if name == 'stamps' else values[columns.kept]
                for name, values in vars(columns).items()))
        header_ns = self._header_ns(columns.stamps)
        self._spread_increments(columns.samples, header_ns, columns.receive_ns)
        names = list(self._frames)
        bounds = [0, *(np.flatnonzero(np.diff(columns.frames)) + 1).tolist(), len(header_ns)]
        return [ImuBlock(header_ns[a:b], columns.receive_ns[a:b], columns.samples[a:b],
                         columns.absent[a:b], names[columns.frames[a]])
                for a, b in pairwise(bounds)]

    # ----------------------------------------------------------------------------------- columns

    def _columns(self, pieces: Sequence[Piece], on_malformed: OnMalformed | None) -> _Columns:
        """Decode the pieces, those of equal size together."""
        bounds = np.cumsum([0, *(len(piece.rows) for piece in pieces)])
        by_size: dict[int, list[int]] = {}
        for number, piece in enumerate(pieces):
            by_size.setdefault(piece.rows.shape[1], []).append(number)
        decoded: list[tuple[NDArray[np.intp], _Columns]] = []
        for numbers in by_size.values():
            if len(numbers) == 1:
                rows, receive_ns = pieces[numbers[0]].rows, pieces[numbers[0]].receive_ns
                groups = self._alike(rows, on_malformed)
                if len(pieces) == len(groups) == 1 and len(groups[0][0]) == len(rows):
                    # By far the most frequent case: nothing needs to be put in order.
                    return self._taken(rows, receive_ns, groups[0][1], on_malformed)
            else:
                rows = np.concatenate([pieces[number].rows for number in numbers])
                receive_ns = np.concatenate([pieces[number].receive_ns for number in numbers])
                groups = self._alike(rows, on_malformed)
            index = np.concatenate([np.arange(bounds[n], bounds[n + 1]) for n in numbers])
            for chosen, layout in groups:
                same = rows if len(chosen) == len(rows) else rows[chosen]
                taken = self._taken(same, receive_ns[chosen], layout, on_malformed)
                times = len(taken.kept) // max(len(chosen), 1)
                decoded.append((np.repeat(index[chosen], times), taken))
        return _in_order(decoded)

    def _alike(self, rows: NDArray[np.uint8], on_malformed: OnMalformed | None,
               ) -> list[tuple[NDArray[np.intp], Layout]]:
        """Find which rows have their fields in the same places, and where these are."""
        found: list[tuple[NDArray[np.intp], Layout]] = []
        left = np.arange(len(rows))
        while len(left):
            first = rows[left[0]]
            try:
                layout = self._layout(first.data)
            except MalformedImu as error:
                if on_malformed is None:
                    raise
                on_malformed(1, error)
                left = left[1:]
                continue
            same = _same_keys(rows if len(left) == len(rows) else rows[left], layout.keys)
            if same is None:
                found.append((left, layout))
                break
            found.append((left[same], layout))
            left = left[~same]
        return found

    def _layout(self, message: memoryview) -> Layout:
        """Find the fields of a message; those like one before it need no further walk."""
        for key, layout in self._layouts.get(len(message), ()):
            if key == b''.join(message[start:stop] for start, stop in layout.keys):
                return layout
        layout = walk(self._types, self._messages.type_name, message,
                      self._messages.serialization, self._wanted)
        self._require_all(layout)
        if len(self._layouts) < _REMEMBERED:
            known = self._layouts.setdefault(len(message), [])
            if len(known) < _REMEMBERED:
                known.append((b''.join(message[start:stop] for start, stop in layout.keys),
                              layout))
        return layout

    def _require_all(self, layout: Layout) -> None:
        for path in self._wanted - layout.places.keys():
            raise MalformedImu(f'it has no field {path}')
        for _, vector in self._fields.vectors():
            for path in vector.paths:
                field, number = split_path(path)
                if number >= layout.places[field].count:
                    raise MalformedImu(f'{field} has {layout.places[field].count} elements')

    def _taken(self, rows: NDArray[np.uint8], receive_ns: NDArray[np.int64], layout: Layout,
               on_malformed: OnMalformed | None) -> _Columns:
        """Take samples, stamps and frame_id out of rows of one layout."""
        fields, count = self._fields, len(rows)
        clocks = fields.stamps if self._clock is None else [fields.stamps[self._clock]]
        stamps = np.empty((len(clocks), count), np.int64)
        for number, stamp in enumerate(clocks):
            stamps[number] = _time(rows, layout, stamp)
        absent = np.ones((count, 2), np.bool_)
        kept = np.ones(count, np.bool_)
        frames = np.zeros(count, np.int64)
        if fields.frame_id is not None:
            frames[:] = [self._frames.setdefault(text, len(self._frames)) for text in _texts(
                rows, layout.places[fields.frame_id], self._messages.serialization)]
        if fields.burst is not None:
            return self._burst(rows, layout, stamps, receive_ns, frames, on_malformed)
        samples = np.empty((count, 6))
        if fields.gyro is None or fields.accel is None:
            samples.fill(0)
        for first, vector in fields.vectors():
            _fill(samples[:, first:first + 3], rows, layout, vector)
            absent[:, first // 3] = (False if vector.covariance is None else
                                     _numbers(rows, layout, vector.covariance) == -1)
        return _Columns(stamps, np.array(receive_ns, np.int64), samples, absent, kept, frames)

    def _burst(self, rows: NDArray[np.uint8], layout: Layout, stamps: NDArray[np.int64],
               receive_ns: NDArray[np.int64], frames: NDArray[np.int64],
               on_malformed: OnMalformed | None) -> _Columns:
        """Unroll messages of many samples, each at its own time; the stamp is that of the last."""
        burst = self._fields.burst
        assert burst is not None
        filled = _numbers(rows, layout, burst.samples).astype(np.int64)
        step_ns = _numbers(rows, layout, burst.step_us).astype(np.float64) * 1e3
        [(first, vector)] = self._fields.vectors()
        width = layout.places[vector.paths[0]].count
        sound = (filled > 0) & (filled <= width) & np.isfinite(step_ns) & (step_ns > 0) & (
            step_ns < _NANOSECONDS)
        if not sound.all():
            error = MalformedImu(
                f'{burst.samples} is not 1 to {width}, or {burst.step_us} is no time')
            if on_malformed is None:
                raise error
            on_malformed(int((~sound).sum()), error)
        number = np.arange(width)
        before = np.where(sound, step_ns, 0)[:, np.newaxis] * (
            filled[:, np.newaxis] - 1 - number)
        offset = np.rint(before).astype(np.int64)
        samples = np.zeros((len(rows), width, 6))
        for axis, path in enumerate(vector.paths):
            samples[:, :, first + axis] = _array(rows, layout, path)
        if vector.scale is not None:
            samples *= _numbers(rows, layout, vector.scale).astype(np.float64)[:, None, None]
        if vector.factor != 1.0:
            samples *= vector.factor
        absent = np.ones((len(rows) * width, 2), np.bool_)
        absent[:, first // 3] = False
        kept = (number < filled[:, np.newaxis]) & sound[:, np.newaxis]
        return _Columns(
            (stamps[:, :, np.newaxis] - offset).reshape(len(stamps), -1),
            (receive_ns[:, np.newaxis] - offset).reshape(-1), samples.reshape(-1, 6), absent,
            kept.reshape(-1), np.repeat(frames, width))

    # ------------------------------------------------------------------------------------- clock

    def _header_ns(self, stamps: NDArray[np.int64]) -> NDArray[np.int64]:
        """Choose the first stamps that are valid and advance finely, for the whole reading."""
        if not len(stamps):
            return np.zeros(stamps.shape[1], np.int64)
        clock = 0
        if self._clock is None:
            clock = next((number for number, times in enumerate(stamps) if _advances(times)), 0)
            if stamps.shape[1] >= _ENOUGH:
                self._clock = clock
        return np.where(stamps[clock] < 0, 0, stamps[clock])

    def _spread_increments(self, samples: NDArray[np.float64], header_ns: NDArray[np.int64],
                           receive_ns: NDArray[np.int64]) -> None:
        """Divide increments whose duration no field tells by the step of the stamps."""
        for first, vector in self._fields.vectors():
            if vector.per == '':
                if not self._step_ns:
                    clock = header_ns if _advances(header_ns) else receive_ns
                    steps = np.diff(clock)
                    self._step_ns = float(np.median(steps)) if len(steps) else 0.0
                samples[:, first:first + 3] *= (
                    _NANOSECONDS / self._step_ns if self._step_ns > 0 else np.nan)


def _advances(times: NDArray[np.int64]) -> bool:
    """Whether stamps are valid, and at least every other one is new."""
    valid = bool((times > 0).all())
    if len(times) == 1:
        return valid and bool(times[0] % _NANOSECONDS)
    return valid and 2 * len(np.unique(times)) >= len(times)


def _in_order(decoded: Sequence[tuple[NDArray[np.intp], _Columns]]) -> _Columns:
    """Put what was decoded in groups into the order of the messages."""
    if len(decoded) == 1:
        return decoded[0][1]
    if not decoded:
        empty = np.zeros(0)
        return _Columns(empty.reshape(0, 0).astype(np.int64), empty.astype(np.int64),
                        empty.reshape(0, 6), np.zeros((0, 2), np.bool_), empty.astype(np.bool_),
                        empty.astype(np.int64))
    order = np.argsort(np.concatenate([index for index, _ in decoded]), kind='stable')
    parts = [columns for _, columns in decoded]
    return _Columns(
        np.concatenate([part.stamps for part in parts], axis=1)[:, order],
        *(np.concatenate([getattr(part, name) for part in parts])[order]
          for name in ('receive_ns', 'samples', 'absent', 'kept', 'frames')))


def _same_keys(rows: NDArray[np.uint8], keys: Sequence[tuple[int, int]],
               ) -> NDArray[np.bool_] | None:
    """Tell which rows agree with the first in all of `keys`; None where all do."""
    same: NDArray[np.bool_] | None = None
    for start, stop in keys:
        items = rows[:, start:stop].view(f'u{stop - start}')[:, 0]
        equal = items == items[0]
        if not equal.all():
            same = equal if same is None else same & equal
    return same


def _array(rows: NDArray[np.uint8], layout: Layout, path: str) -> NDArray[np.generic]:
    """View an array of numbers in every row; shape (n, numbers)."""
    place = layout.places[path]
    code = np.dtype(layout.byte_order + place.kind)
    return rows[:, place.at:place.at + place.count * code.itemsize].view(code)


def _numbers(rows: NDArray[np.uint8], layout: Layout, path: str) -> NDArray[np.generic]:
    """View a number, or one of an array of numbers, in every row; shape (n,)."""
    field, number = split_path(path)
    return _array(rows, layout, field)[:, number]


def _fill(out: NDArray[np.float64], rows: NDArray[np.uint8], layout: Layout, vector: Vector,
          ) -> None:
    """Write the numbers of a vector, in SI units, into `out` of shape (n, 3)."""
    places = []
    for path in vector.paths:
        field, number = split_path(path)
        place = layout.places[field]
        places.append((place.kind, place.at + number * int(place.kind[1:])))
    start = places[0][1]
    if places == [('f8', start), ('f8', start + 8), ('f8', start + 16)] and (
            layout.byte_order == '<'):
        # Copying three doubles as one opaque item is several times faster than as numbers.
        out.view('V24')[:, 0] = rows[:, start:start + 24].view('V24')[:, 0]
    else:
        for axis, path in enumerate(vector.paths):
            out[:, axis] = _numbers(rows, layout, path)
    if vector.scale is not None:
        out *= _numbers(rows, layout, vector.scale).astype(np.float64)[:, np.newaxis]
    if vector.per:
        seconds = _numbers(rows, layout, vector.per).astype(np.float64) * 1e-6
        seconds[seconds == 0] = np.nan
        out /= seconds[:, np.newaxis]
    if vector.factor != 1.0:
        out *= vector.factor


def _time(rows: NDArray[np.uint8], layout: Layout, stamp: Stamp) -> NDArray[np.int64]:
    """Return stamps in nanoseconds; -1 for what is no time."""
    if stamp.unit_ns == 0:
        seconds, nanoseconds = (
            _numbers(rows, layout, path).astype(np.int64) for path in stamp.paths)
        times = seconds * _NANOSECONDS + nanoseconds
        times[(nanoseconds < 0) | (nanoseconds >= _NANOSECONDS)] = -1
        return times
    number = _numbers(rows, layout, stamp.path)
    # Through doubles where the field is one, else exactly.
    exact = number.dtype.kind in 'iu'
    rough = number.astype(np.float64) * stamp.unit_ns
    sound = np.isfinite(rough) & (np.abs(rough) < _LATEST)
    whole = number.astype(np.int64) * stamp.unit_ns if exact else np.rint(
        np.where(sound, rough, 0)).astype(np.int64)
    return np.where(sound, whole, -1)


def _texts(rows: NDArray[np.uint8], place: Place, serialization: Serialization) -> list[str]:
    """Read a text in every row; one alone where all are the same."""
    items = rows[:, place.at:place.at + place.count].tobytes()
    size = place.count
    texts = ([items[:size]] if items == items[:size] * len(rows)
             else [items[at:at + size] for at in range(0, len(items), size)])
    if serialization == 'cdr':
        texts = [text.removesuffix(b'\0') for text in texts]
    return [shorten(text.decode('utf-8', 'replace')) for text in texts]
