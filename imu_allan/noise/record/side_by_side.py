# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What every part of the estimator has in common."""

from copy import copy
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

from imu_allan.state import Record
import numpy as np

AXES_FIRST, AXES_SECOND, AXES_TWICE = ({'axes': at} for at in ((0,), (1,), (0, 1)))
"""Of the field of an array: which of its dimensions is that of the axes."""
_MOST = 1024
"""Far beyond what a sensor has: bounds what a damaged state may declare."""


@dataclass(eq=False)
class SideBySide(Record):
    """What is kept of several axes."""

    axes: int    # how many they are

    def __post_init__(self) -> None:
        """Begin with nothing, also where a state is about to be put in its place."""
        if not 1 <= self.axes <= _MOST:
            raise ValueError(f'axes must be 1 to {_MOST}, not {self.axes}')
        self.begin()

    def begin(self) -> None:
        """Set what is not given."""
        raise NotImplementedError

    def keep(self, axes: list[int]) -> None:
        """Let go of all other axes; those that stay have the order of their numbers here."""
        vars(self).update(vars(_kept(self, axes, ())))


def _kept(part: Any, axes: list[int], dimensions: tuple[int, ...]) -> Any:
    """Return what stays of a part of a record."""
    if isinstance(part, np.ndarray):
        for dimension in dimensions:
            part = part.take(axes, dimension)
        return part
    if isinstance(part, list):
        return [_kept(one, axes, dimensions) for one in part]
    if isinstance(part, dict):
        return {key: _kept(one, axes, dimensions) for key, one in part.items()}
    if not is_dataclass(part):
        return part
    twin = copy(part)
    for one in fields(part):
        vars(twin)[one.name] = _kept(getattr(part, one.name), axes, one.metadata.get('axes', ()))
    if isinstance(twin, SideBySide):
        twin.axes = len(axes)
    return twin
