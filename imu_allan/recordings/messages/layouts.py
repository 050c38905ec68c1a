# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Layouts of messages: which messages have their fields at the same positions, and where.

One traversal of a message locates all requested fields, by the definition of its type. It also
notes the bytes that determine the positions: byte order, and lengths of strings and sequences.
Messages of equal size that agree in those bytes have the same layout, so one traversal serves a
whole block.

References
----------
As for `imu_allan.cdr`: CDR aligns every number to its own size, counted from byte 4; ROS 1 packs.

"""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, Literal

from imu_allan.cdr import (
    byte_order_of,
    MalformedImu,
    OnMalformed,
    record_of,
    rows_like_first,
    Serialization,
)
from imu_allan.recordings.messages.definitions import Types
from imu_allan.recordings.messages.imu_fields import ImuFields, split_path, Vector
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Place:
    """
    Position of a field in a message.

    Attributes
    ----------
    at : int
        Offset of the first byte.
    kind : str
        Type code of a number such as 'f8', without byte order, or 'string'.
    count : int
        Length of an array or sequence, or of a string in bytes; 1 for a single number.

    """

    at: int
    kind: str
    count: int


class MessageLayout:
    """
    Positions of the fields `wanted` in a message; raises MalformedImu if it does not fit.

    Attributes
    ----------
    size : int
        Its length in bytes.
    byte_order : {'<', '>'}
        Little-endian or big-endian.
    places : dict of str to Place
        Positions by field path, such as ``imu.angular_velocity.x``.
    keys : list of (int, int)
        Start and stop of the bytes that determine the layout of messages of equal size.

    """

    def __init__(self, types: Types, type_name: str, message: bytes | memoryview,
                 serialization: Serialization, wanted: Collection[str]) -> None:
        self._types = types
        self._message = message
        self._aligned = serialization == 'cdr'
        self._wanted = wanted
        self.places: dict[str, Place] = {}
        self.keys: list[tuple[int, int]] = []
        self.byte_order: Literal['<', '>'] = '<'
        self._at = self._steps = 0
        self.size = len(message)
        if self._aligned:
            if self.size < 4:
                raise MalformedImu(f'{self.size} bytes are too few for a message')
            self.byte_order = byte_order_of(message)
            self.keys.append((0, 2))
            self._at = 4
        self._visit(type_name, '', 0)
        # Some middleware pads a payload to a multiple of four bytes, older ones to eight.
        if not 0 <= self.size - self._at <= (7 if self._aligned else 0):
            raise MalformedImu(f'{self.size} bytes are not a message of type {type_name}, which '
                               f'takes {self._at}')
        # Bytes after the last requested field do not affect any position.
        end = max((place.at for place in self.places.values()), default=0)
        self.keys = [key for key in self.keys if key[0] < end]

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
                self._read(name, field.kind, 1 if count is None else count, int(field.kind[1:]))
                continue
            for number in range(1 if count is None else count):
                self._step()
                element = name if count is None else f'{name}[{number}]'
                if field.is_message:
                    self._visit(field.kind, f'{element}.', depth + 1)
                else:
                    self._read(element, 'string', self._length(), 1)

    def _read(self, name: str, kind: str, count: int, width: int) -> None:
        """Note the place of a field of `count` numbers or characters."""
        start = self._pass_over(count * width, width if count else 1)
        if name in self._wanted:
            self.places[name] = Place(start, kind, count)

    def _step(self) -> None:
        self._steps += 1
        # Messages of a humanoid robot have a thousand fields and elements.
        if self._steps > 20_000:
            raise MalformedImu('more than 20000 fields')

    def _length(self) -> int:
        start = self._pass_over(4, 4)
        self.keys.append((start, start + 4))
        return int.from_bytes(self._message[start:start + 4],
                              'little' if self.byte_order == '<' else 'big')

    def _pass_over(self, size: int, alignment: int) -> int:
        """Skip the next `size` bytes after alignment; return where they begin."""
        start = self._at
        if self._aligned:
            start += (4 - start) % alignment
        self._at = start + size
        if self._at > self.size:
            raise MalformedImu(f'{self.size} bytes are too few for its type, which takes '
                               f'{self._at} or more')
        return start


@dataclass(frozen=True)
class RecordLayout:
    """
    Layout shared by messages that have their fields at the same positions.

    Attributes
    ----------
    keys : list of (int, int)
        Start and stop of the bytes in which messages of equal size with this layout agree.
    record : dtype
        A message as a record, with the paths of the numbers and arrays to read as names. Three
        adjacent numbers form one more field, named by all three paths.
    frame_id : Place or None
        Position of the frame name.

    """

    keys: list[tuple[int, int]]
    record: np.dtype[np.void]
    frame_id: Place | None


class RecordLayouts:
    """The layouts that occur among messages of one type."""

    def __init__(self, types: Types, type_name: str, serialization: Serialization,
                 fields: ImuFields) -> None:
        self._types, self._type_name = types, type_name
        self._serialization: Serialization = serialization
        self._fields = fields
        self._wanted = fields.paths()
        self._known: dict[int, list[tuple[bytes, RecordLayout]]] = {}

    def of(self, message: memoryview) -> RecordLayout:
        """Return the layout of a message, from memory or by traversal; may raise MalformedImu."""
        for key, layout in self._known.get(len(message), ()):
            if key == _key(message, layout):
                return layout
        layout = self._described(MessageLayout(
            self._types, self._type_name, message, self._serialization, self._wanted))
        most = 64   # sizes to remember, and layouts of each size
        if len(self._known) < most:
            known = self._known.setdefault(len(message), [])
            if len(known) < most:
                known.append((_key(message, layout), layout))
        return layout

    def groups(self, rows: NDArray[np.uint8], on_malformed: OnMalformed,
               ) -> list[tuple[NDArray[np.intp] | slice, RecordLayout]]:
        """Group rows, messages of equal size, by layout."""
        found: list[tuple[NDArray[np.intp] | slice, RecordLayout]] = []
        left = np.arange(len(rows))
        # With many layouts, compare only some messages at a time.
        at_a_time = 256
        while len(left):
            first = rows[left[0]]
            try:
                layout = self.of(first.data)
            except MalformedImu as error:
                on_malformed(1, error)
                left = left[1:]
                continue
            which = slice(None) if len(left) == len(rows) else left
            like = rows_like_first(rows[which], layout.keys)
            if like is None:
                found.append((which, layout))
                break
            found.append((left[like], layout))
            left = left[~like]
            # If this layout covers less than a sixteenth of the rest, there may be many of them.
            if len(rows) > at_a_time and np.count_nonzero(like) < len(left) // 16:
                # Comparing each of many with all other messages would take quadratic time.
                for start in range(0, len(left), at_a_time):
                    part = left[start:start + at_a_time]
                    found += [(part[chosen], layout) for chosen, layout in self.groups(
                        rows[part], on_malformed)]
                break
        return found

    def _described(self, parsed: MessageLayout) -> RecordLayout:
        """Create a record type from the field positions; raise MalformedImu if one is missing."""
        for path in self._wanted - parsed.places.keys():
            raise MalformedImu(f'it has no field {path}')
        fields: dict[str, tuple[Any, int]] = {}
        for path in self._fields.numbers():
            field, element = split_path(path)
            place = parsed.places[field]
            if element >= place.count:
                raise MalformedImu(f'{field} has {place.count} elements')
            number = np.dtype(parsed.byte_order + place.kind)
            fields[path] = (number, place.at + element * number.itemsize)
        for _, vector in self._fields.vectors():
            first, at = fields[vector.paths[0]]
            if self._fields.burst is not None:
                for path in vector.paths:
                    fields[path] = ((fields[path][0], parsed.places[path].count), fields[path][1])
            elif [fields[path] for path in vector.paths] == [
                    (first, at + axis * first.itemsize) for axis in range(3)]:
                # Copying three doubles as one opaque item is several times faster.
                fields[joint_field(vector)] = ('V24' if first == np.float64 else (first, 3), at)
        frame_id = self._fields.frame_id
        frame = None if frame_id is None else parsed.places[frame_id]
        return RecordLayout(parsed.keys, record_of(fields, parsed.size), frame)


def _key(message: memoryview, layout: RecordLayout) -> bytes:
    return b''.join(message[start:stop] for start, stop in layout.keys)


def joint_field(vector: Vector) -> str:
    """Return the field name for three adjacent numbers; paths themselves contain no blank."""
    return ' '.join(vector.paths)
