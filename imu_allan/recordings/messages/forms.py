# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
How messages are taken apart: which of them have their fields in the same places, and where.

A walk through one message finds the places of all fields that are asked for, by the definition of
its type. It also notes which bytes the places depend on: the byte order, and the lengths of
strings and sequences. Messages of equal size that agree in those bytes have their fields in the
same places, so one walk serves a whole block of them.

References
----------
As for `imu_allan.cdr`: CDR aligns every number to its own size, counted from byte 4; ROS 1 packs.

"""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any, Literal

from imu_allan.cdr import MalformedImu, rows_like_first, Serialization
from imu_allan.recordings.messages.definitions import Types
from imu_allan.recordings.messages.imu_fields import ImuFields, split_path, Vector
import numpy as np
from numpy.typing import NDArray

OnMalformed = Callable[[int, MalformedImu], None]
Spans = tuple[tuple[int, int], ...]

_REMEMBERED = 64
"""Layouts of each of as many sizes that are kept."""
_WINDOW = 256
"""Messages that are compared at a time where there are more forms than that."""
_DEEPEST = 32
"""Messages within messages; those of ROS go four deep."""
_MOST_STEPS = 20_000
"""Fields and elements of a walk: the messages of a humanoid robot have a thousand."""


@dataclass(frozen=True)
class Place:
    """
    Place of a field in a message.

    Attributes
    ----------
    at : int
        Its first byte.
    kind : str
        Code of a number such as 'f8' in native notation, or 'string'.
    count : int
        Numbers of an array or sequence, bytes of a string; 1 for a single number.

    """

    at: int
    kind: str
    count: int


class MessageLayout:
    """
    Places of the fields `wanted`, such as ``imu.angular_velocity.x``; raises MalformedImu.

    Attributes
    ----------
    byte_order : {'<', '>'}
        Little or big endian.
    places : dict of str to Place
        By the path of the field.
    keys : list of (int, int)
        Start and stop of the bytes that messages of equal size must have in common.

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
        size = len(message)
        if self._aligned:
            if size < 4:
                raise MalformedImu(f'{size} bytes are too few for a message')
            encapsulation = int.from_bytes(message[:2], 'big')
            if encapsulation > 1:
                raise MalformedImu(f'encapsulation 0x{encapsulation:04x} is not plain CDR')
            self.byte_order = '<' if encapsulation else '>'
            self.keys.append((0, 2))
            self._at = 4
        self._visit(type_name, '', 0)
        # Some middleware pads a payload to a multiple of four bytes, older ones of eight.
        extra = size - self._at
        if not 0 <= extra <= (7 if self._aligned else 0):
            raise MalformedImu(f'{size} bytes are not a message of type {type_name}, which takes '
                               f'{self._at}')
        # What comes behind the last field that is asked for moves none of them.
        end = max((place.at for place in self.places.values()), default=0)
        self.keys = [key for key in self.keys if key[0] < end]

    def _visit(self, type_name: str, path: str, depth: int) -> None:
        if depth > _DEEPEST:
            raise MalformedImu(f'messages within messages, more than {_DEEPEST} deep')
        if type_name not in self._types:
            raise MalformedImu(f'type {type_name} is not defined')
        fields = self._types[type_name]
        if not fields and self._aligned:
            # ROS 2 gives a message without fields one byte.
            self._pass_over(1, 1)
        for field in fields:
            self._step()
            name = f'{path}{field.name}'
            count = self._length() if field.count == 0 else field.count
            if field.is_message:
                if count is None:
                    self._visit(field.kind, f'{name}.', depth + 1)
                for number in range(count or 0):
                    self._step()
                    self._visit(field.kind, f'{name}[{number}].', depth + 1)
            elif field.kind == 'string':
                for number in range(1 if count is None else count):
                    self._step()
                    length = self._length()
                    start = self._pass_over(length, 1)
                    if count is None:
                        self._note(name, start, 'string', length)
                    else:
                        self._note(f'{name}[{number}]', start, 'string', length)
            else:
                width = int(field.kind[1:])
                numbers = 1 if count is None else count
                start = self._pass_over(numbers * width, width if numbers else 1)
                self._note(name, start, field.kind, numbers)

    def _note(self, name: str, at: int, kind: str, count: int) -> None:
        if name in self._wanted:
            self.places[name] = Place(at, kind, count)

    def _step(self) -> None:
        self._steps += 1
        if self._steps > _MOST_STEPS:
            raise MalformedImu(f'more than {_MOST_STEPS} fields')

    def _length(self) -> int:
        start = self._pass_over(4, 4)
        self.keys.append((start, start + 4))
        return int.from_bytes(self._message[start:start + 4],
                              'little' if self.byte_order == '<' else 'big')

    def _pass_over(self, size: int, alignment: int) -> int:
        """Go behind the next `size` bytes; returns where they begin."""
        start = self._at
        if self._aligned:
            start += (4 - start) % alignment
        self._at = start + size
        if self._at > len(self._message):
            raise MalformedImu(f'{len(self._message)} bytes are too few for its type, which takes '
                               f'{self._at} or more')
        return start


@dataclass(frozen=True)
class Form:
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


class Forms:
    """The forms that messages of one type come in."""

    def __init__(self, types: Types, type_name: str, serialization: Serialization,
                 fields: ImuFields) -> None:
        self._types, self._type_name = types, type_name
        self._serialization: Serialization = serialization
        self._fields = fields
        self._wanted = fields.paths()
        self._known: dict[int, list[tuple[bytes, Form]]] = {}

    def of(self, message: memoryview) -> Form:
        """Find the fields of a message, by a walk where none was like it; raises MalformedImu."""
        for key, form in self._known.get(len(message), ()):
            if key == _key(message, form):
                return form
        layout = MessageLayout(
            self._types, self._type_name, message, self._serialization, self._wanted)
        form = self._described(layout, len(message))
        if len(self._known) < _REMEMBERED:
            known = self._known.setdefault(len(message), [])
            if len(known) < _REMEMBERED:
                known.append((_key(message, form), form))
        return form

    def groups(self, rows: NDArray[np.uint8], on_malformed: OnMalformed | None,
               ) -> list[tuple[NDArray[np.intp], Form]]:
        """Find which rows, messages of equal size, have their fields in the same places."""
        found: list[tuple[NDArray[np.intp], Form]] = []
        left = np.arange(len(rows))
        while len(left):
            first = rows[left[0]]
            try:
                form = self.of(first.data)
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
            # Of more forms than sixteen, each is too few to compare all others with it.
            if len(rows) > _WINDOW and np.count_nonzero(like) < len(left) // 16:
                # To compare each of many with all the others would take the square of the time.
                for start in range(0, len(left), _WINDOW):
                    part = left[start:start + _WINDOW]
                    found += [(part[chosen], form) for chosen, form in self.groups(
                        rows[part], on_malformed)]
                break
        return found

    def _described(self, layout: MessageLayout, size: int) -> Form:
        """Make a record of the places of the fields, of which none may lack."""
        for path in self._wanted - layout.places.keys():
            raise MalformedImu(f'it has no field {path}')
        fields: dict[str, tuple[Any, int]] = {}
        for path in self._fields.numbers():
            field, element = split_path(path)
            place = layout.places[field]
            if element >= place.count:
                raise MalformedImu(f'{field} has {place.count} elements')
            number = np.dtype(layout.byte_order + place.kind)
            fields[path] = (number, place.at + element * number.itemsize)
        for _, vector in self._fields.vectors():
            first, at = fields[vector.paths[0]]
            if self._fields.burst is not None:
                for path in vector.paths:
                    fields[path] = ((fields[path][0], layout.places[path].count), fields[path][1])
            elif [fields[path] for path in vector.paths] == [
                    (first, at + axis * first.itemsize) for axis in range(3)]:
                # Copying three doubles as one opaque item is several times faster than as numbers.
                fields[together(vector)] = ('V24' if first == np.float64 else (first, 3), at)
        frame_id = self._fields.frame_id
        frame = None if frame_id is None else layout.places[frame_id]
        keys = tuple(layout.keys)
        return Form(keys, keys if frame is None else _joined(
            keys, (frame.at, frame.at + frame.count)), np.dtype({
                'names': list(fields), 'formats': [kind for kind, _ in fields.values()],
                'offsets': [at for _, at in fields.values()], 'itemsize': size}), frame)


def _key(message: memoryview, form: Form) -> bytes:
    return b''.join(message[start:stop] for start, stop in form.keys)


def _joined(keys: Spans, text: tuple[int, int]) -> Spans:
    """Add a text to the keys, in one with its length."""
    start = next((key[0] for key in keys if key[1] == text[0]), text[0])
    return (*(key for key in keys if key[1] != text[0]), (start, text[1]))


def together(vector: Vector) -> str:
    """Name three numbers that stand side by side; no path has a blank."""
    return ' '.join(vector.paths)
