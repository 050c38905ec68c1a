# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Base classes of the parts of the estimator, and metadata of their fields."""

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, TypeVar

from imu_allan.state import Record
import numpy as np

AXES = -1
"""Stands for the number of axes in the shape of an array."""
AXES_FIRST = {'axes': (0,)}
"""Metadata of a field: which dimensions of its arrays are those of the axes."""
_EMPTY: dict[np.ufunc, float] = {np.add: 0.0, np.minimum: np.inf, np.maximum: -np.inf}
"""Sum, minimum and maximum of no numbers."""

Kind = TypeVar('Kind', bound='MultiAxis')


def begun(begin: Callable[[int], Any], *dimensions: int, **more: Any) -> dict[str, Any]:
    """Describe a field that begins as `begin(axes)`; `dimensions` of arrays are of the axes."""
    return {'begin': begin, 'axes': dimensions, **more}


def numbers(*shape: int, dtype: type = np.float64, merge: np.ufunc = np.add) -> dict[str, Any]:
    """Describe an array of sums or extremes, of no numbers yet; `EqualParts` merge them so."""
    return begun(lambda axes: np.full([axes if n == AXES else n for n in shape], _EMPTY[merge],
                                      dtype),
                 *(at for at, n in enumerate(shape) if n == AXES), merge=merge)


@dataclass(eq=False)
class MultiAxis(Record):
    """Statistics of several axes that are processed together."""

    axes: int    # number of axes

    def __post_init__(self) -> None:
        """Initialize to empty, even if a state will be restored afterwards."""
        # More than any sensor has.
        if not 1 <= self.axes <= 1024:
            raise ValueError(f'axes must be 1 to 1024, not {self.axes}')
        for one in fields(self):
            if 'begin' in one.metadata:
                setattr(self, one.name, one.metadata['begin'](self.axes))

    def select(self: Kind, axes: Sequence[int]) -> Kind:
        """
        Return an independent copy with some of the axes.

        Parameters
        ----------
        axes : sequence of int
            Indices of the axes.

        Examples
        --------
        >>> from imu_allan import Estimator
        >>> both = Estimator(axes=2)
        >>> both.update(np.arange(8.0).reshape(4, 2))
        >>> both.select([1]).mean
        array([4.])

        """
        selected: Kind = _selected(self.copy(), list(axes), ())
        return selected


@dataclass(eq=False)
class EqualParts(MultiAxis):
    """Statistics of equal parts of a record; all arrays have the parts beside the axes."""

    width: int = 1    # places in a part

    def widen(self) -> None:
        """Merge neighbours in pairs, so that half of the parts become free."""
        for one in fields(self):
            if merge := one.metadata.get('merge'):
                values, at = getattr(self, one.name), len(one.metadata['axes'])
                shape = values.shape
                pairs = merge.reduce(values.reshape(*shape[:at], -1, 2, *shape[at + 1:]), at + 1)
                setattr(self, one.name, np.concatenate(
                    (pairs, np.full_like(pairs, _EMPTY[merge])), axis=at))
        self.width *= 2


def _selected(part: Any, axes: list[int], dimensions: Sequence[int]) -> Any:
    """Return a part of a record with the given axes only."""
    if isinstance(part, np.ndarray):
        for dimension in dimensions:
            part = part.take(axes, dimension)
        return part
    if isinstance(part, list):
        return [_selected(one, axes, dimensions) for one in part]
    if isinstance(part, dict):
        return {key: _selected(one, axes, dimensions) for key, one in part.items()}
    if not is_dataclass(part):
        return part
    twin = copy(part)
    for one in fields(part):
        vars(twin)[one.name] = _selected(
            getattr(part, one.name), axes, one.metadata.get('axes', ()))
    if isinstance(twin, MultiAxis):
        twin.axes = len(axes)
    return twin
