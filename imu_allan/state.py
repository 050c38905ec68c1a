# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Records that change as messages arrive, and how they are copied, saved and restored.

A record is a dataclass of numbers, text, arrays, other dataclasses, and lists, tuples and dicts of
these. Its state is a flat dict that holds JSON text for each field, and the arrays by path.
"""

from collections.abc import Mapping
from copy import copy as shallow_copy
from dataclasses import fields, is_dataclass
from functools import cache
import json
from types import NoneType, UnionType
from typing import Any, cast, get_args, get_origin, get_type_hints, TypeVar, Union

import numpy as np
from numpy.typing import NDArray

Kind = TypeVar('Kind')
State = dict[str, NDArray[Any]]


class Record:
    """Base class of records that change as messages arrive."""

    def copy(self: Kind) -> Kind:
        """Return an independent copy."""
        return cast(Kind, _copied(self, {}))

    def complete(self) -> None:
        """Add what a state leaves out; called after the fields are restored."""


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
    arrays: State = {}
    plain = _plain(record, '', arrays)
    return {name: np.array(json.dumps(value)) for name, value in plain.items()
            if value is not None or name not in arrays} | arrays


def _plain(value: Any, path: str, arrays: State) -> Any:
    """Return the part of a value that JSON stores; put its arrays into `arrays`."""
    if isinstance(value, np.ndarray):
        # Copied, because another thread saves it later.
        arrays[path] = value.copy()
        return None
    within = f'{path}/' if path else ''
    if is_dataclass(value):
        return {part.name: _plain(getattr(value, part.name), within + part.name, arrays)
                for part in fields(value)}
    if isinstance(value, (list, tuple)):
        return [_plain(part, f'{within}{at}', arrays) for at, part in enumerate(value)]
    if isinstance(value, dict):
        return {key: _plain(part, f'{within}{key}', arrays) for key, part in value.items()}
    return value


def part_of(state: Mapping[str, NDArray[Any]], name: str) -> State:
    """Return the part of a state under a name."""
    return {key[len(name) + 1:]: value for key, value in state.items()
            if key.startswith(f'{name}/')}


def restored(kind: type[Kind], state: Mapping[str, NDArray[Any]]) -> Kind:
    """Restore a record from what `state_of` returned; KeyError if a part is missing."""
    arrays = {name: array for name, array in state.items() if array.dtype.kind != 'U'}
    plain = {name: None if name in arrays else json.loads(str(state[name]))
             for name in _hints(cast(Any, kind))}
    return cast(Kind, _built(kind, plain, arrays, ''))


@cache
def _hints(kind: type) -> dict[str, Any]:
    hints = get_type_hints(kind)
    return {part.name: hints[part.name] for part in fields(cast(Any, kind))}


def _built(kind: Any, plain: Any, arrays: State, path: str) -> Any:
    """Build a value of a type from its saved parts."""
    origin, parts = get_origin(kind), get_args(kind)
    within = f'{path}/' if path else ''
    if origin in (Union, UnionType):
        if plain is None and path not in arrays:
            return None
        kind = next(part for part in parts if part is not NoneType)
        return _built(kind, plain, arrays, path)
    if origin is np.ndarray:
        return arrays[path].copy()
    if is_dataclass(kind):
        built = {name: _built(hint, plain[name], arrays, within + name)
                 for name, hint in _hints(cast(Any, kind)).items()}
        make: Any = kind
        record = make(**{part.name: built.pop(part.name) for part in fields(kind) if part.init})
        vars(record).update(built)
        if isinstance(record, Record):
            record.complete()
        return record
    if origin is list:
        return [_built(parts[0], part, arrays, f'{within}{at}') for at, part in enumerate(plain)]
    if origin is tuple:
        each = parts[:1] * len(plain) if parts[-1] is Ellipsis else parts
        return tuple(_built(part, value, arrays, f'{within}{at}') for at, (part, value)
                     in enumerate(zip(each, plain, strict=True)))
    if origin is dict:
        return {parts[0](key): _built(parts[1], value, arrays, f'{within}{key}')
                for key, value in plain.items()}
    return plain
