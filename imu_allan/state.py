# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Records that change as messages arrive, and how they are copied, saved and restored.

A record is a dataclass of numbers, text, arrays, other dataclasses, and lists, tuples and dicts of
these. Its state is a flat dict that holds JSON text for each field, and the arrays by number.
"""

from collections.abc import Mapping
from copy import copy as shallow_copy
from dataclasses import fields
import json
from typing import Any, cast, TypeVar

from imu_allan.json_of_dataclasses import hints_of, plain, typed
import numpy as np
from numpy.typing import NDArray

Kind = TypeVar('Kind')
State = dict[str, NDArray[Any]]


class Record:
    """Base class of records that change as messages arrive."""

    def copy(self: Kind) -> Kind:
        """Return an independent copy."""
        return cast(Kind, _copied(self, {}))


def _copied(value: Any, seen: dict[int, Any]) -> Any:
    """Copy arrays, lists, dicts and, each once, records; other values in records never change."""
    if isinstance(value, Record):
        if id(value) not in seen:
            twin = seen[id(value)] = shallow_copy(value)
            for name, part in vars(value).items():
                setattr(twin, name, _copied(part, seen))
        return seen[id(value)]
    if isinstance(value, np.ndarray):
        return value.copy()
    if isinstance(value, list):
        return [_copied(part, seen) for part in value]
    if isinstance(value, dict):
        return {key: _copied(part, seen) for key, part in value.items()}
    return value


def state_of(record: Any) -> State:
    """Return the state of a dataclass, with everything that it holds."""
    arrays: list[NDArray[Any]] = []

    def put_aside(array: Any) -> dict[str, int]:
        assert isinstance(array, np.ndarray)
        # Copied, because another thread saves it later.
        arrays.append(array.copy())
        return {'array': len(arrays) - 1}

    texts = {part.name: json.dumps(plain(getattr(record, part.name)), default=put_aside)
             for part in fields(record)}
    return {name: np.array(text) for name, text in texts.items()} | {
        str(number): array for number, array in enumerate(arrays)}


def restored(kind: type[Kind], state: Mapping[str, NDArray[Any]]) -> Kind:
    """Restore a record from what `state_of` returned; KeyError if a part is missing."""
    def with_array(found: dict[str, Any]) -> Any:
        return state[str(found['array'])].copy() if [*found] == ['array'] else found

    fields_of = {name: json.loads(str(state[name]), object_hook=with_array)
                 for name in hints_of(cast(Any, kind))}
    return cast(Kind, typed(kind, fields_of, kind.__name__, lambda _, value, __: value))
