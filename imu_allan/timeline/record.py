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
            value = getattr(record, name)
            kinds: tuple[type, ...] = (type(default),)
            if default is None:
                kinds = (type(None), int, float, str, list)
            elif isinstance(default, float):
                kinds = (float, int)
            if not isinstance(value, kinds):
                raise TypeError(f'{name} is {value!r}')
        return record
