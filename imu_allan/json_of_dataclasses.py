# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Conversion of dataclasses to JSON and back, by the annotations of their fields."""

from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass, MISSING
from functools import cache
import json
import types
from typing import Annotated, Any, get_args, get_origin, get_type_hints, Literal, Union

from imu_allan.errors import ImuAllanError, shorten

ABOVE_ZERO, NOT_NEGATIVE = 'above zero', 'zero or above'
"""Annotations of numbers whose logarithm or root is taken."""
_CONTAINERS = {Union, types.UnionType, tuple, list, dict, Mapping}
_LARGEST = 1e60
"""Far above anything measured; squares and sums of smaller numbers stay finite."""


def json_text(value: Any, line: str = '\n') -> str:
    """
    Write JSON like `json.dumps` with an indent of 2, but with arrays of numbers on one line.

    A node does this every period; `json` with an indent takes five times as long. `line` is the
    line break and indentation of the value.

    Examples
    --------
    >>> print(json_text({'tau_s': [0.01, 0.02], 'trend': None}))
    {
      "tau_s": [0.01, 0.02],
      "trend": null
    }

    """
    inner = f'{line}  '
    if isinstance(value, dict) and value:
        items = [f'{json.dumps(key)}: {json_text(item, inner)}' for key, item in value.items()]
        return f'{{{inner}{f",{inner}".join(items)}{line}}}'
    if isinstance(value, list) and any(isinstance(item, (str, dict, bool)) for item in value):
        return f'[{inner}{f",{inner}".join(json_text(item, inner) for item in value)}{line}]'
    return json.dumps(value, allow_nan=False)


def plain(value: Any) -> Any:
    """Return a dataclass and everything in it as dictionaries, lists and numbers."""
    if value is None or isinstance(value, (float, str, int)):
        return value
    if hasattr(value, '__dataclass_fields__'):
        return {name: plain(getattr(value, name)) for name in value.__dataclass_fields__}
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, (tuple, list)):
        return [plain(item) for item in value]
    return value


def checked(kind: Any, value: Any, where: str) -> Any:
    """Return a number, text or choice of a type from JSON; its numbers must be finite."""
    origin = get_origin(kind)
    if kind is Any:
        if isinstance(value, list):
            return tuple(checked(Any, item, f'{where}[{i}]') for i, item in enumerate(value))
        if value is None or isinstance(value, (bool, int, str)):
            return value
        if not isinstance(value, float):
            raise ImuAllanError(f'{where}: expected a number, a text or a list')
        kind = float
    if origin is Annotated:
        number, bound = get_args(kind)
        value = checked(number, value, where)
        # Other annotations are units.
        if bound in (ABOVE_ZERO, NOT_NEGATIVE) and not (
                value > 1 / _LARGEST or (value == 0 and bound == NOT_NEGATIVE)):
            raise ImuAllanError(f'{where}: expected {bound}')
        return value
    if origin is Literal:
        if value not in get_args(kind):
            raise ImuAllanError(f'{where}: {shorten(repr(value))} is not one of '
                                f'{", ".join(get_args(kind))}')
        return value
    if kind in (float, int) and isinstance(value, (int, kind)) and not isinstance(value, bool):
        # Of NaN, too.
        if not abs(value) < _LARGEST:
            raise ImuAllanError(f'{where}: {shorten(str(value), 20)} is not below {_LARGEST:g}')
        return kind(value)
    if kind is not int and isinstance(value, kind):
        return value
    raise ImuAllanError(f'{where}: expected {kind.__name__}, found {type(value).__name__}')


def typed(kind: Any, value: Any, where: str,
          leaf: Callable[[Any, Any, str], Any] = checked) -> Any:
    """
    Convert the output of `plain` back to a type; ImuAllanError names the field `where`.

    `leaf` converts what holds nothing else.
    """
    origin = get_origin(kind)
    if origin not in _CONTAINERS and not (origin is None and is_dataclass(kind)):
        return leaf(kind, value, where)
    args = get_args(kind)
    if origin in (Union, types.UnionType):
        known = next(arg for arg in args if arg is not types.NoneType)
        return None if value is None else typed(known, value, where, leaf)
    if origin in (tuple, list):
        if not isinstance(value, (list, tuple)):
            raise ImuAllanError(f'{where}: expected a list')
        kinds = args if origin is tuple and args[-1] is not Ellipsis else args[:1] * len(value)
        if len(value) != len(kinds):
            raise ImuAllanError(f'{where}: expected {len(kinds)} values')
        return origin(typed(each, item, f'{where}[{i}]', leaf)
                      for i, (each, item) in enumerate(zip(kinds, value, strict=True)))
    if not isinstance(value, Mapping):
        raise ImuAllanError(f'{where}: expected an object')
    if origin is not None:
        return {args[0](key): typed(args[1], item, f'{where}.{shorten(str(key))}', leaf)
                for key, item in value.items()}
    given = {name: typed(hint, value[name], f'{where}.{name}', leaf)
             for name, hint in hints_of(kind).items() if name in value}
    missing = [part.name for part in fields(kind) if part.name not in given
               and part.default is MISSING and part.default_factory is MISSING]
    if missing:
        raise ImuAllanError(f'{where}: missing {", ".join(missing)}')
    record = kind(**{part.name: given.pop(part.name) for part in fields(kind)
                     if part.init and part.name in given})
    vars(record).update(given)
    return record


@cache
def hints_of(kind: Any) -> dict[str, Any]:
    """Return the types of the fields of a dataclass."""
    hints = get_type_hints(kind, include_extras=True)
    return {part.name: hints[part.name] for part in fields(kind)}
