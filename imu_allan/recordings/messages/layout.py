# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Where the fields of a serialized message stand, by the definition of its type.

A walk through one message finds the places of all fields that are asked for. It also notes which
bytes the places depend on: the byte order, and the lengths of strings and sequences. Messages of
equal size that agree in those bytes have their fields in the same places, so one walk serves a
whole block of them.

References
----------
As for `imu_allan.cdr`: CDR aligns every number to its own size, counted from byte 4; ROS 1 packs.

"""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal

from imu_allan.cdr import MalformedImu, Serialization
from imu_allan.recordings.messages.definitions import Types

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
