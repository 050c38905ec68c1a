# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Conversion of frozen dataclasses to JSON and back, by the annotations of their fields."""

from collections.abc import Mapping
from dataclasses import fields, MISSING
import json
import math
import types
from typing import Annotated, Any, get_args, get_origin, get_type_hints, Literal, Union

from imu_allan.errors import ImuAllanError, shorten

ABOVE_ZERO, NOT_NEGATIVE = 'above zero', 'zero or above'
"""Annotations of numbers whose logarithm or root is taken."""
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


def typed(kind: Any, value: Any, where: str) -> Any:
    """Convert the output of `plain` back to a type; ImuAllanError names the field `where`."""
    if kind is Any:
        return _any(value, where)
    origin = get_origin(kind)
    if origin is Annotated:
        number, bound = get_args(kind)
        value = typed(number, value, where)
        if not (value > 1 / _LARGEST or (value == 0 and bound == NOT_NEGATIVE)):
            raise ImuAllanError(f'{where}: expected {bound}')
        return value
    if origin in (Union, types.UnionType):
        if value is None:
            return None
        return typed(next(arg for arg in get_args(kind) if arg is not type(None)), value, where)
    if origin is Literal:
        if value not in get_args(kind):
            raise ImuAllanError(f'{where}: {shorten(repr(value))} is not one of '
                                f'{", ".join(get_args(kind))}')
        return value
    if origin is tuple:
        args = get_args(kind)
        if not isinstance(value, (list, tuple)):
            raise ImuAllanError(f'{where}: expected a list')
        if args[-1] is Ellipsis:
            args = args[:1] * len(value)
        if len(value) != len(args):
            raise ImuAllanError(f'{where}: expected {len(args)} values')
        return tuple(typed(arg, item, f'{where}[{i}]')
                     for i, (arg, item) in enumerate(zip(args, value, strict=True)))
    is_record = hasattr(kind, '__dataclass_fields__')
    if (is_record or origin is not None) and not isinstance(value, Mapping):
        raise ImuAllanError(f'{where}: expected an object')
    if origin is not None:
        item_kind = get_args(kind)[1]
        return {str(key): typed(item_kind, item, f'{where}.{shorten(str(key))}')
                for key, item in value.items()}
    if is_record:
        given = {name: typed(hint, value[name], f'{where}.{name}')
                 for name, hint in get_type_hints(kind, include_extras=True).items()
                 if name in value}
        missing = [field.name for field in fields(kind) if field.name not in given
                   and field.default is MISSING and field.default_factory is MISSING]
        if missing:
            raise ImuAllanError(f'{where}: missing {", ".join(missing)}')
        return kind(**given)
    if kind is float and isinstance(value, (int, float)) and not isinstance(value, bool):
        if not math.isfinite(value):
            raise ImuAllanError(f'{where}: {value} is not a finite number')
        if abs(value) >= _LARGEST:
            raise ImuAllanError(f'{where}: {value} is beyond {_LARGEST:g}')
        return float(value)
    if isinstance(value, kind) and not (kind is int and isinstance(value, bool)):
        return value
    raise ImuAllanError(f'{where}: expected {kind.__name__}, found {type(value).__name__}')


def _any(value: Any, where: str) -> Any:
    """Return a JSON value of a field that may have any type; its numbers must be finite."""
    if isinstance(value, list):
        return tuple(_any(item, f'{where}[{i}]') for i, item in enumerate(value))
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, float):
        return typed(float, value, where)
    raise ImuAllanError(f'{where}: expected a number, a text or a list')
