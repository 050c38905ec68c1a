# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Base class of all parts of the estimator."""

from copy import copy
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

from imu_allan.state import Record
import numpy as np
from numpy.typing import NDArray

AXES_FIRST, AXES_SECOND, AXES_TWICE = ({'axes': at} for at in ((0,), (1,), (0, 1)))
"""Field metadata: which dimensions of an array are those of the axes."""


@dataclass(eq=False)
class MultiAxis(Record):
    """Statistics of several axes that are processed together."""

    axes: int    # number of axes

    def __post_init__(self) -> None:
        """Initialize to empty, even if a state will be restored afterwards."""
        # More than any sensor has.
        if not 1 <= self.axes <= 1024:
            raise ValueError(f'axes must be 1 to 1024, not {self.axes}')
        self.begin()

    def begin(self) -> None:
        """Initialize the fields that are not arguments."""
        raise NotImplementedError

    def keep(self, axes: list[int]) -> None:
        """Keep only the given axes, in this order."""
        vars(self).update(vars(_kept(self, axes, ())))


def in_pairs(values: NDArray[Any], axis: int, merge: np.ufunc = np.add, room: float = 0
             ) -> NDArray[Any]:
    """Merge neighbours along an axis in pairs, and fill the half that becomes free with `room`."""
    shape = values.shape
    pairs = merge.reduce(values.reshape(*shape[:axis], shape[axis] // 2, 2, *shape[axis + 1:]),
                         axis=axis + 1)
    return np.concatenate((pairs, np.full_like(pairs, room)), axis=axis)


def _kept(part: Any, axes: list[int], dimensions: tuple[int, ...]) -> Any:
    """Return a part of a record with the given axes only."""
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
    if isinstance(twin, MultiAxis):
        twin.axes = len(axes)
    return twin
