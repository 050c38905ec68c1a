# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Messages of any type to blocks of samples, in one module because one pass does it all.

The fields are found by one walk through a message (`imu_allan.recordings.messages.layout`) and
then taken out of all messages of the same layout as columns, without a Python object a message.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any, Literal, Protocol

from imu_allan.block import ImuBlock
from imu_allan.cdr import decode_imu_rows, MalformedImu, rows_like_first, Serialization
from imu_allan.errors import shorten
from imu_allan.recordings.messages.definitions import Types
from imu_allan.recordings.messages.imu_fields import ImuFields, split_path, Stamp, Vector
from imu_allan.recordings.messages.layout import Layout, Place, walk
from imu_allan.recordings.messages.piece import Piece
import numpy as np
from numpy.typing import NDArray

OnMalformed = Callable[[int, MalformedImu], None]
Spans = tuple[tuple[int, int], ...]

_NANOSECONDS = 1_000_000_000  # in a second
_ENOUGH = 16
"""Messages from which on it is decided which of several stamps is used."""
_REMEMBERED = 64
"""Layouts of each of as many sizes that are kept."""
_FORMS = 16
"""So many forms of messages at a time are told apart by comparing all with one after the other."""
_WINDOW = 256
"""Messages that are compared at a time where there are more forms than that."""
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


@dataclass(frozen=True)
class _Form:
    """
    How messages are taken apart that have their fields in the same places.

    Attributes
    ----------
    keys : tuple of (int, int)
        Start and stop of the bytes that messages of equal size then have in common.
    keys_and_frame : tuple of (int, int)
        The same with those of frame_id.
    record : dtype
        A message as a record: the numbers and arrays of numbers that are read, by their paths, and
        three numbers that stand side by side by the paths of all three.
    frame_id : Place or None
        Where the text stands that names the frame.

    """

    keys: Spans
    keys_and_frame: Spans
    record: np.dtype[np.void]
    frame_id: Place | None


@dataclass
class _Columns:
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
        self._forms: dict[int, list[tuple[bytes, _Form]]] = {}

    def __call__(self, pieces: Iterable[Piece], on_malformed: OnMalformed | None = None,
                 ) -> list[ImuBlock]:
        """Decode messages in their order; malformed ones raise MalformedImu, or are told."""
        held = [piece for piece in pieces if len(piece.rows)]
        self._frames = {'': 0}
        if not held:
            return []
        columns = self._columns(held, on_malformed)
        if columns.kept is not None and not columns.kept.all():
            columns = _chosen(columns, columns.kept)
        count = len(columns.samples)
        if not count:
            return []
        header_ns = self._header_ns(columns.stamps)
        self._spread_increments(columns.samples, header_ns, columns.receive_ns)
        names = list(self._frames)
        if isinstance(columns.frames, int):
            return [ImuBlock(header_ns, columns.receive_ns, columns.samples, columns.absent,
                             names[columns.frames])]
        bounds = [0, *(np.flatnonzero(np.diff(columns.frames)) + 1).tolist(), count]
        return [ImuBlock(header_ns[a:b], columns.receive_ns[a:b], columns.samples[a:b],
                         columns.absent[a:b], names[columns.frames[a]])
                for a, b in pairwise(bounds)]

    # ----------------------------------------------------------------------------------- columns

    def _columns(self, pieces: Sequence[Piece], on_malformed: OnMalformed | None) -> _Columns:
        """Decode the pieces, those of equal size together."""
        if len(pieces) == 1:
            # By far the most frequent case is the fastest: nothing needs to be put in order.
            [piece] = pieces
            with suppress(MalformedImu):
                form = self._form(piece.rows[0].data)
                if rows_like_first(piece.rows, form.keys_and_frame) is None:
                    return self._taken(piece.rows, piece.receive_ns, form, on_malformed,
                                       one_frame=True)
        bounds = np.cumsum([0, *(len(piece.rows) for piece in pieces)])
        by_size: dict[int, list[int]] = {}
        for number, piece in enumerate(pieces):
            by_size.setdefault(piece.rows.shape[1], []).append(number)
        decoded: list[tuple[NDArray[np.intp], _Columns]] = []
        for numbers in by_size.values():
            if len(numbers) == 1:
                rows, receive_ns = pieces[numbers[0]].rows, pieces[numbers[0]].receive_ns
            else:
                rows = np.concatenate([pieces[number].rows for number in numbers])
                receive_ns = np.concatenate([pieces[number].receive_ns for number in numbers])
            index = np.concatenate([np.arange(bounds[n], bounds[n + 1]) for n in numbers])
            for chosen, form in self._alike(rows, on_malformed):
                same = rows if len(chosen) == len(rows) else rows[chosen]
                taken = self._taken(same, receive_ns[chosen], form, on_malformed)
                times = len(taken.samples) // max(len(chosen), 1)
                decoded.append((np.repeat(index[chosen], times), taken))
        return _in_order(decoded)

    def _alike(self, rows: NDArray[np.uint8], on_malformed: OnMalformed | None,
               ) -> list[tuple[NDArray[np.intp], _Form]]:
        """Find which rows have their fields in the same places, and where these are."""
        found: list[tuple[NDArray[np.intp], _Form]] = []
        left = np.arange(len(rows))
        while len(left):
            first = rows[left[0]]
            try:
                form = self._form(first.data)
            except MalformedImu as error:
                if on_malformed is None:
                    raise
                on_malformed(1, error)
                left = left[1:]
                continue
            like = rows_like_first(rows if len(left) == len(rows) else rows[left], form.keys)
            if like is None:
                found.append((left, form))
                break
            found.append((left[like], form))
            left = left[~like]
            if len(rows) > _WINDOW and np.count_nonzero(like) < len(left) // _FORMS:
                # To compare each of many with all the others would take the square of the time.
                for start in range(0, len(left), _WINDOW):
                    part = left[start:start + _WINDOW]
                    found += [(part[chosen], form) for chosen, form in self._alike(
                        rows[part], on_malformed)]
                break
        return found

    def _form(self, message: memoryview) -> _Form:
        """Find the fields of a message; those like one before it need no further walk."""
        for key, form in self._forms.get(len(message), ()):
            if key == _key(message, form):
                return form
        layout = walk(self._types, self._messages.type_name, message,
                      self._messages.serialization, self._wanted)
        self._require_all(layout)
        form = self._described(layout, len(message))
        if len(self._forms) < _REMEMBERED:
            known = self._forms.setdefault(len(message), [])
            if len(known) < _REMEMBERED:
                known.append((_key(message, form), form))
        return form

    def _described(self, layout: Layout, size: int) -> _Form:
        """Make a record of the places of the fields."""
        fields: dict[str, tuple[Any, int]] = {}
        for path in self._fields.numbers():
            place = layout.places[split_path(path)[0]]
            number = np.dtype(layout.byte_order + place.kind)
            fields[path] = (number, place.at + split_path(path)[1] * number.itemsize)
        for _, vector in self._fields.vectors():
            first, at = fields[vector.paths[0]]
            if self._fields.burst is not None:
                for path in vector.paths:
                    fields[path] = ((fields[path][0], layout.places[path].count), fields[path][1])
            elif [fields[path] for path in vector.paths] == [
                    (first, at + axis * first.itemsize) for axis in range(3)]:
                # Copying three doubles as one opaque item is several times faster than as numbers.
                fields[_together(vector)] = ('V24' if first == np.float64 else (first, 3), at)
        frame_id = self._fields.frame_id
        frame = None if frame_id is None else layout.places[frame_id]
        return _Form(layout.keys, layout.keys if frame is None else _joined(
            layout.keys, (frame.at, frame.at + frame.count)), np.dtype({
                'names': list(fields), 'formats': [kind for kind, _ in fields.values()],
                'offsets': [at for _, at in fields.values()], 'itemsize': size}), frame)

    def _require_all(self, layout: Layout) -> None:
        for path in self._wanted - layout.places.keys():
            raise MalformedImu(f'it has no field {path}')
        for _, vector in self._fields.vectors():
            for path in vector.paths:
                field, number = split_path(path)
                if number >= layout.places[field].count:
                    raise MalformedImu(f'{field} has {layout.places[field].count} elements')

    def _taken(self, rows: NDArray[np.uint8], receive_ns: NDArray[np.int64], form: _Form,
               on_malformed: OnMalformed | None, *, one_frame: bool = False) -> _Columns:
        """Take samples, stamps and frame_id out of rows of one form."""
        fields, count = self._fields, len(rows)
        messages = rows.view(form.record)[:, 0]
        clocks = fields.stamps if self._clock is None else [fields.stamps[self._clock]]
        stamps = np.empty((len(clocks), count), np.int64)
        for number, stamp in enumerate(clocks):
            stamps[number] = _time(messages, stamp)
        frames: NDArray[np.int64] | int = 0
        if form.frame_id is not None:
            numbers = [self._frames.setdefault(text, len(self._frames)) for text in _texts(
                rows[:1] if one_frame else rows, form.frame_id)]
            frames = numbers[0] if one_frame else np.array(numbers)
        if fields.burst is not None:
            return self._burst(messages, stamps, receive_ns, frames, on_malformed)
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
        return _Columns(stamps, np.array(receive_ns, np.int64), samples, absent, frames=frames)

    def _burst(self, messages: NDArray[np.void], stamps: NDArray[np.int64],
               receive_ns: NDArray[np.int64], frames: NDArray[np.int64] | int,
               on_malformed: OnMalformed | None) -> _Columns:
        """Unroll messages of many samples, each at its own time; the stamp is that of the last."""
        burst = self._fields.burst
        assert burst is not None
        filled = messages[burst.samples].astype(np.int64)
        step_ns = messages[burst.step_us].astype(np.float64) * 1e3
        [(first, vector)] = self._fields.vectors()
        width = messages[vector.paths[0]].shape[1]
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
        samples = np.zeros((len(messages), width, 6))
        for axis, path in enumerate(vector.paths):
            samples[:, :, first + axis] = messages[path]
        if vector.scale is not None:
            samples *= messages[vector.scale].astype(np.float64)[:, None, None]
        if vector.factor != 1.0:
            samples *= vector.factor
        absent = np.ones((len(messages) * width, 2), np.bool_)
        absent[:, first // 3] = False
        kept = (number < filled[:, np.newaxis]) & sound[:, np.newaxis]
        return _Columns(
            (stamps[:, :, np.newaxis] - offset).reshape(len(stamps), -1),
            (receive_ns[:, np.newaxis] - offset).reshape(-1), samples.reshape(-1, 6), absent,
            kept.reshape(-1), frames if isinstance(frames, int) else np.repeat(frames, width))

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
        times: NDArray[np.int64] = np.maximum(stamps[clock], 0)
        return times

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
                        empty.reshape(0, 6), np.zeros((0, 2), np.bool_))
    order = np.argsort(np.concatenate([index for index, _ in decoded]), kind='stable')
    parts = [columns for _, columns in decoded]

    def joined(name: str) -> NDArray[Any]:
        return np.concatenate([getattr(part, name) for part in parts])

    def each(of: Callable[[_Columns], Any]) -> NDArray[Any]:
        return np.concatenate([np.broadcast_to(of(part), len(part.samples)) for part in parts])

    return _chosen(_Columns(
        np.concatenate([part.stamps for part in parts], axis=1),
        joined('receive_ns'), joined('samples'), joined('absent'),
        each(lambda part: True if part.kept is None else part.kept),
        each(lambda part: part.frames)), order)


def _chosen(columns: _Columns, index: NDArray[np.intp] | NDArray[np.bool_]) -> _Columns:
    """Take some samples, or all in another order."""
    kept, frames = columns.kept, columns.frames
    return _Columns(
        columns.stamps[:, index], columns.receive_ns[index], columns.samples[index],
        columns.absent[index], None if kept is None else kept[index],
        frames if isinstance(frames, int) else frames[index])


def _key(message: memoryview, form: _Form) -> bytes:
    return b''.join(message[start:stop] for start, stop in form.keys)


def _joined(keys: Spans, text: tuple[int, int]) -> Spans:
    """Add a text to the keys, in one with its length."""
    start = next((key[0] for key in keys if key[1] == text[0]), text[0])
    return (*(key for key in keys if key[1] != text[0]), (start, text[1]))


def _together(vector: Vector) -> str:
    """Name three numbers that stand side by side; no path has a blank."""
    return ' '.join(vector.paths)


def _fill(out: NDArray[np.float64], messages: NDArray[np.void], vector: Vector) -> None:
    """Write the numbers of a vector, in SI units, into `out` of shape (n, 3)."""
    side_by_side = _together(vector)
    if side_by_side not in (messages.dtype.names or ()):
        for axis, path in enumerate(vector.paths):
            out[:, axis] = messages[path]
    elif messages[side_by_side].dtype.kind == 'V':
        out.view('V24')[:, 0] = messages[side_by_side]
    else:
        out[:] = messages[side_by_side]
    if vector.scale is not None:
        out *= messages[vector.scale].astype(np.float64)[:, np.newaxis]
    if vector.per:
        seconds = messages[vector.per].astype(np.float64) * 1e-6
        seconds[seconds == 0] = np.nan
        out /= seconds[:, np.newaxis]
    if vector.factor != 1.0:
        out *= vector.factor


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
