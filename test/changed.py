# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Results of which something is another; `begin` chooses axes: 'gyro', 'gyro_x', '' for all."""

from dataclasses import replace
from typing import Any

from imu_allan.result import AxisResult, Result

UNSEEN: dict[str, Any] = {'observable': False, 'value': None, 'ci95': None}
"""What is known of a coefficient that does not show; its bound comes beside it."""


def only(result: Result, begin: str) -> Result:
    """Return a result of some of its axes."""
    return replace(result, axes={name: axis for name, axis in result.axes.items()
                                 if name.startswith(begin)})


def without(result: Result, name: str) -> Result:
    """Return a result that lacks an axis."""
    return replace(result, axes={one: axis for one, axis in result.axes.items() if one != name})


def with_axes(result: Result, begin: str = '', **fields: Any) -> Result:
    """Return a result with other fields of its axes; a function gives the one of each axis."""
    return replace(result, axes=result.axes | {
        name: replace(axis, **{key: value(axis) if callable(value) else value
                               for key, value in fields.items()})
        for name, axis in only(result, begin).axes.items()})


def with_coefficient(result: Result, begin: str, key: str, **fields: Any) -> Result:
    """Return a result with another coefficient."""
    def changed(axis: AxisResult) -> dict[str, Any]:
        return {**axis.coefficients, key: replace(axis.coefficients[key], **fields)}
    return with_axes(result, begin, coefficients=changed)
