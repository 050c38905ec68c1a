# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What the parts of a timeline remember: plain numbers and text, which JSON keeps."""

from collections.abc import Mapping
from copy import copy as shallow_copy
from typing import Any, TypeVar

Kind = TypeVar('Kind', bound='Record')


class Record:
    """Base of dataclasses whose fields all have defaults and are plain numbers and text."""

    def copy(self: Kind) -> Kind:
        """Give an independent copy."""
        twin = shallow_copy(self)
        for name, value in vars(self).items():
            if isinstance(value, (list, dict)):
                setattr(twin, name, value.copy())
        return twin

    def to_plain(self) -> dict[str, Any]:
        """Give the fields for JSON."""
        return vars(self)

    @classmethod
    def from_plain(cls: type[Kind], plain: Mapping[str, Any]) -> Kind:
        """
        Take the fields as JSON gives them.

        Raises
        ------
        TypeError
            If a field is unknown or of another type.

        """
        record = cls(**plain)
        for name, default in vars(cls()).items():
            if not _fits(getattr(record, name), default):
                raise TypeError(f'{name} is {getattr(record, name)!r}')
        return record


def _fits(value: Any, default: Any) -> bool:
    """Whether a value that was saved is of the kind of a field's default."""
    if default is None:
        return value is None or isinstance(value, (int, float, str, list))
    if isinstance(default, float):
        return isinstance(value, (float, int))
    if isinstance(default, list) and default:
        # What is not empty at first has a number for each axis, never more or fewer.
        return (isinstance(value, list) and len(value) == len(default)
                and all(isinstance(number, (int, float)) for number in value))
    return isinstance(value, type(default))
