# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
How messages are taken apart: which of them have their fields in the same places, and where.

One walk through a message (`imu_allan.recordings.messages.layout`) serves all that are like it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from imu_allan.cdr import MalformedImu, rows_like_first, Serialization
from imu_allan.recordings.messages.definitions import Types
from imu_allan.recordings.messages.imu_fields import ImuFields, split_path, Vector
from imu_allan.recordings.messages.layout import MessageLayout, Place
import numpy as np
from numpy.typing import NDArray

OnMalformed = Callable[[int, MalformedImu], None]
Spans = tuple[tuple[int, int], ...]

_REMEMBERED = 64
"""Layouts of each of as many sizes that are kept."""
_WINDOW = 256
"""Messages that are compared at a time where there are more forms than that."""


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
