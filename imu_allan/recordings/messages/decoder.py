# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Decoding of messages of any type to blocks: samples in SI units, stamps and frames.

One traversal of a message locates all requested fields, by the definition of its type. It also
notes the bytes that determine the positions: byte order, and lengths of strings and sequences.
Messages of equal size that agree in those bytes have the same layout, so one traversal serves a
whole block, which is then read as columns. No object is created per message. A record is a
serialized message, with field paths as names of the numbers, or a record in the log of an
autopilot. Among several stamps the clock is chosen.

References
----------
As for `imu_allan.cdr`: CDR aligns every number to its own size, counted from byte 4; ROS 1 packs.

"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import prod
from typing import Any, Literal

from imu_allan.arrays import Ints, runs
from imu_allan.block import ImuBlock, joined
from imu_allan.cdr import MalformedImu, MessageBatch, OnMalformed, rows_like_first, Serialization
from imu_allan.errors import shorten
from imu_allan.recordings.messages.definitions import Types
from imu_allan.recordings.messages.imu_fields import Burst, ImuFields, split_path, Stamp
import numpy as np
from numpy.typing import NDArray

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
    fields : ImuFields
        Which fields hold the samples.
    types : Types
        Fields of all types in the messages.
    serialization : {'cdr', 'ros1'}
        How they are serialized.

    """

    type_name: str
    fields: ImuFields
    types: Types
    serialization: Serialization = 'cdr'

    def decoder(self) -> Decoder:
        """Return a decoder for one reading."""
        return FieldsDecoder(self)

    @property
    def half(self) -> Literal['gyro', 'accel'] | None:
        """Return the only sensor with samples in the messages; None if both have samples."""
        if self.fields.gyro and self.fields.accel:
            return None
        return 'gyro' if self.fields.gyro else 'accel'

    def reported(self) -> str:
        """Describe in words how the messages are read."""
        return ', '.join(filter(None, (self.type_name, self.fields.what)))


Part = tuple[Ints, Ints, ImuBlock]
"""For the samples of messages of one layout: index of the message, stamps with a column for each
candidate, and a block that has the first of these."""


class FieldsDecoder:
    """Decoder of messages whose samples are in arbitrary fields."""

    def __init__(self, messages: ImuMessages) -> None:
        self._messages, self._fields = messages, messages.fields
        self._wanted = messages.fields.paths()
        self._known: dict[int, list[tuple[bytes, Layout]]] = {}
        # Candidates for the clock; one is left once it is chosen.
        self._stamps = messages.fields.stamps

    # Damaged numbers of any size are rejected later.
    @np.errstate(over='ignore', invalid='ignore')
    def __call__(self, batches: Iterable[MessageBatch], on_malformed: OnMalformed,
                 ) -> list[ImuBlock]:
        """Decode messages in order; malformed ones are reported."""
        # Bursts may all be malformed.
        parts = [part for part in self._parts(batches, on_malformed) if len(part[-1])]
        if not parts:
            return []
        blocks = [block for _, _, block in parts]
        if len(self._stamps) > 1:
            clock = self._choose_clock(_joined([stamps for _, stamps, _ in parts]))
            blocks = [replace(block, header_ns=stamps[:, clock]) for _, stamps, block in parts]
        if len(blocks) == 1:
            return blocks
        order = np.argsort(np.concatenate([message for message, _, _ in parts]), kind='stable')
        names = [*dict.fromkeys(block.frame_id for block in blocks)]
        frames = np.concatenate([np.full(len(block), names.index(block.frame_id))
                                 for block in blocks])[order]
        block = joined(blocks).part(order)
        return [replace(block.part(slice(a, b)), frame_id=names[frames[a]])
                for a, b in runs(frames[1:] != frames[:-1], len(frames))]

    def _parts(self, batches: Iterable[MessageBatch], on_malformed: OnMalformed,
               ) -> Iterator[Part]:
        """Read messages of one layout at a time."""
        by_size: dict[int, list[tuple[NDArray[np.uint8], Ints, Ints]]] = {}
        number = 0
        for batch in batches:
            if count := len(batch.rows):
                by_size.setdefault(batch.rows.shape[1], []).append(
                    (batch.rows, batch.receive_ns, np.arange(number, number + count)))
                number += count
        for same_size in by_size.values():
            rows, receive_ns, index = map(_joined, zip(*same_size, strict=True))
            for layout, which in self._groups(rows, on_malformed):
                yield _extract(self._fields, self._stamps, layout, rows[which], receive_ns[which],
                               index[which], on_malformed)

    def _choose_clock(self, stamps: Ints) -> int:
        """Return the column of the first valid and mostly distinct stamps; keep the choice."""
        clock = next((number for number, times in enumerate(stamps.T) if _advances(times)), 0)
        # Fix the choice of the clock once there are this many messages.
        if len(stamps) >= 16:
            self._stamps = (self._stamps[clock],)
        return clock

    # ----------------------------------------------------------------------------------- layouts

    def _layout_of(self, message: memoryview) -> Layout:
        """Return the layout of a message, from memory or by traversal; may raise MalformedImu."""
        for key, layout in self._known.get(len(message), ()):
            if key == layout.key(message):
                return layout
        layout = Layout(self._messages, message, self._wanted)
        most = 64   # sizes to remember, and layouts of each size
        if len(self._known) < most:
            known = self._known.setdefault(len(message), [])
            if len(known) < most:
                known.append((layout.key(message), layout))
        return layout

    def _groups(self, rows: NDArray[np.uint8], on_malformed: OnMalformed
                ) -> Iterable[tuple[Layout, Ints | slice]]:
        """Group messages of equal size by layout."""
        found: dict[Layout, list[Ints]] = {}
        waiting = [np.arange(len(rows))]
        for left in waiting:
            while len(left):
                try:
                    layout = self._layout_of(rows[left[0]].data)
                except MalformedImu as error:
                    on_malformed(1, error)
                    left = left[1:]
                    continue
                which = slice(None) if len(left) == len(rows) else left
                like = rows_like_first(rows[which], layout.keys)
                if like is None and len(left) == len(rows):
                    return [(layout, which)]
                # To compare each of many layouts with all messages would take quadratic time.
                if like is not None and len(left) > 256:
                    waiting += [left[start:start + 256] for start in range(0, len(left), 256)]
                    break
                found.setdefault(layout, []).append(left if like is None else left[like])
                left = left[:0] if like is None else left[~like]
        return [(layout, _joined(parts)) for layout, parts in found.items()]


def _joined(arrays: Sequence[NDArray[Any]]) -> NDArray[Any]:
    """Join arrays; most often there is one, which is not copied."""
    return np.concatenate(arrays) if len(arrays) > 1 else arrays[0]


def _advances(times: Ints) -> bool:
    """Return whether stamps are valid and at least half of them are distinct."""
    valid = bool((times > 0).all())
    if len(times) == 1:
        return valid and bool(times[0] % 1_000_000_000)
    return valid and 2 * len(np.unique(times)) >= len(times)


# ---------------------------------------------------------------------------- where the fields are

class Layout:
    """
    Where the fields of a message are; raises MalformedImu if it does not have them.

    Attributes
    ----------
    keys : list of (int, int)
        Start and stop of the bytes in which other messages of equal size with this layout, and of
        this frame, agree.
    record : dtype
        A message as a record of the numbers and arrays that are read, by their paths.
    frame_id : str
        The frame that it names, or an empty text.

    """

    def __init__(self, messages: ImuMessages, message: memoryview, wanted: Collection[str],
                 ) -> None:
        self._types, self._message, self._wanted = messages.types, message, wanted
        self._aligned = messages.serialization == 'cdr'
        self._order: Literal['<', '>'] = '<'
        # Type and offset of a number or an array.
        self._places: dict[str, tuple[Any, int]] = {}
        self._texts: dict[str, slice] = {}
        self._at = self._steps = 0
        self.keys: list[tuple[int, int]] = []
        size = len(message)
        if self._aligned:
            if size < 4:
                raise MalformedImu(f'{size} bytes are too few for a message')
            encapsulation = int.from_bytes(message[:2], 'big')
            if encapsulation > 1:
                raise MalformedImu(f'encapsulation 0x{encapsulation:04x} is not plain CDR')
            self._order = '<' if encapsulation else '>'
            self.keys.append((0, 2))
            self._at = 4
        self._visit(messages.type_name, '', 0)
        # Some middleware pads a payload to a multiple of four bytes, older ones to eight.
        if not 0 <= size - self._at <= (7 if self._aligned else 0):
            raise MalformedImu(
                f'{size} bytes are not a message of type {messages.type_name}, which takes '
                f'{self._at}')
        places = {}
        for path in messages.fields.numbers():
            name, element = split_path(path)
            if name not in self._places:
                raise MalformedImu(f'it has no field {name}')
            (kind, shape), at = self._places[name]
            if element >= prod(shape):
                raise MalformedImu(f'{name} has {prod(shape)} elements')
            places[path] = (((kind, shape), at) if path == name else
                            (kind, at + element * np.dtype(kind).itemsize))
        self.record = np.dtype({
            'names': list(places), 'formats': [kind for kind, _ in places.values()],
            'offsets': [at for _, at in places.values()], 'itemsize': size})
        frame = self._texts.get(messages.fields.frame_id or '', slice(0, 0))
        # Bytes after the last requested field do not affect any position.
        end = max(frame.start, *(at for _, at in self._places.values()), 0)
        self.keys = [key for key in self.keys if key[0] < end] + [(frame.start, frame.stop)]
        # It is shown and saved from here on, and a publisher may send megabytes of it. Texts end
        # with a null byte in CDR, not in ROS 1.
        self.frame_id = shorten(
            bytes(message[frame]).removesuffix(b'\0').decode('utf-8', 'replace'))
        del self._message

    def key(self, message: memoryview) -> bytes:
        """Return the bytes of a message in which those of one layout agree."""
        return b''.join(message[start:stop] for start, stop in self.keys)

    def _visit(self, type_name: str, path: str, depth: int) -> None:
        # Messages of ROS reach four levels.
        if depth > 32:
            raise MalformedImu('messages within messages, more than 32 deep')
        if type_name not in self._types:
            raise MalformedImu(f'type {type_name} is not defined')
        fields = self._types[type_name]
        if not fields and self._aligned:
            # ROS 2 serializes a message without fields as one byte.
            self._pass_over(1, 1)
        for field in fields:
            self._step()
            name = f'{path}{field.name}'
            count = self._length() if field.count == 0 else field.count
            if not field.is_message and field.kind != 'string':
                width, shape = int(field.kind[1:]), () if count is None else (count,)
                start = self._pass_over(width * prod(shape), width if count != 0 else 1)
                if name in self._wanted:
                    self._places[name] = (self._order + field.kind, shape), start
                continue
            for number in range(1 if count is None else count):
                self._step()
                element = name if count is None else f'{name}[{number}]'
                if field.is_message:
                    self._visit(field.kind, f'{element}.', depth + 1)
                else:
                    length = self._length()
                    start = self._pass_over(length, 1)
                    if element in self._wanted:
                        self._texts[element] = slice(start, start + length)

    def _step(self) -> None:
        self._steps += 1
        # Messages of a humanoid robot have a thousand fields and elements.
        if self._steps > 20_000:
            raise MalformedImu('more than 20000 fields')

    def _length(self) -> int:
        start = self._pass_over(4, 4)
        self.keys.append((start, start + 4))
        return int.from_bytes(self._message[start:start + 4],
                              'little' if self._order == '<' else 'big')

    def _pass_over(self, size: int, alignment: int) -> int:
        """Skip the next `size` bytes after alignment; return where they begin."""
        start = self._at
        if self._aligned:
            start += (4 - start) % alignment
        self._at = start + size
        if self._at > len(self._message):
            raise MalformedImu(f'{len(self._message)} bytes are too few for its type, which takes '
                               f'{self._at} or more')
        return start


# ------------------------------------------------------------------------------ records as columns

def _extract(fields: ImuFields, candidates: Sequence[Stamp], layout: Layout,
             rows: NDArray[np.uint8], receive_ns: Ints, index: Ints, on_malformed: OnMalformed,
             ) -> Part:
    """Extract samples and stamps of messages; which stamps hold is chosen later."""
    messages = rows.view(layout.record)[:, 0]
    # The message of each sample, and the place of its numbers in arrays.
    message: slice | Ints = slice(None)
    place: Any = message
    before_ns: Ints | Literal[0] = 0
    if fields.burst is not None:
        message, number, before_ns = _samples_of(fields, fields.burst, messages, on_malformed)
        place = message, number
    receive_ns = receive_ns[message] - before_ns
    # Each axis is contiguous, which numpy prefers.
    count = len(receive_ns)
    stamps = np.zeros((max(len(candidates), 1), count), np.int64).T
    samples, absent = np.zeros((6, count)).T, np.ones((2, count), np.bool_).T
    for column, stamp in enumerate(candidates):
        stamps[:, column] = _time_of(messages, stamp)[message] - before_ns
    for first, vector in fields.vectors():
        for axis, path in enumerate(vector.paths, first):
            samples[:, axis] = messages[path][place]
        half = samples[:, first:first + 3]
        if vector.scale is not None:
            half *= messages[vector.scale][message, np.newaxis]
        if vector.per is not None:
            seconds = messages[vector.per][message].astype(np.float64) * 1e-6
            seconds[seconds == 0] = np.nan
            half /= seconds[:, np.newaxis]
        if vector.factor != 1.0:
            half *= vector.factor
        absent[:, first // 3] = (vector.covariance is not None
                                 and messages[vector.covariance][message] == -1.0)
    block = ImuBlock(stamps[:, 0], receive_ns, samples, absent, layout.frame_id)
    return index[message], stamps, block


def _samples_of(fields: ImuFields, burst: Burst, messages: NDArray[np.void],
                on_malformed: OnMalformed) -> tuple[Ints, Ints, Ints]:
    """Return message and place of each sample of bursts, and its time before the last one."""
    [(_, vector)] = fields.vectors()
    width = min(messages[path].shape[1] for path in vector.paths)
    filled = messages[burst.samples].astype(np.int64)
    step_ns = messages[burst.step_us].astype(np.float64) * 1e3
    # A burst sampled at less than 1 Hz is not from an IMU, but a damaged number.
    sound = (filled > 0) & (filled <= width) & np.isfinite(step_ns) & (step_ns > 0) & (
        step_ns < 1e9)
    if not sound.all():
        on_malformed(int((~sound).sum()), MalformedImu(
            f'{burst.samples} is not 1 to {width}, or {burst.step_us} is no time'))
    message, number = np.nonzero((np.arange(width) < filled[:, np.newaxis]) & sound[:, np.newaxis])
    before_ns = np.rint(step_ns[message] * (filled[message] - 1 - number)).astype(np.int64)
    return message, number, before_ns


def _time_of(messages: NDArray[np.void], stamp: Stamp) -> Ints:
    """Return stamps in nanoseconds; -1 for invalid times."""
    if stamp.unit_ns == 0:
        seconds, nanoseconds = stamp.paths
        times: Ints = messages[seconds].astype(np.int64)
        times *= 1_000_000_000
        # A type of the user's own may have any numbers.
        times += messages[nanoseconds].astype(np.int64)
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
