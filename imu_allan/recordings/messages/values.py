# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Numbers as they stand in messages to samples in SI units; logs of autopilots hold the same.

The columns are given by a function from the path of a field to its numbers, one a message.
"""

from collections.abc import Callable
from typing import Any

from imu_allan.recordings.messages.imu_fields import Burst, Vector
import numpy as np
from numpy.typing import NDArray

Column = Callable[[str], NDArray[Any]]

_LONGEST_STEP_NS = 1e9
"""A second: what samples a burst at a slower rate is no IMU, but a damaged number."""


def to_si(numbers: NDArray[np.float64], vector: Vector, column: Column) -> None:
    """Turn numbers of shape (n, 3) or (n, width, 3) into rad/s or m/s^2, in place."""
    def each(path: str) -> NDArray[np.float64]:
        return column(path).astype(np.float64).reshape(-1, *(1,) * (numbers.ndim - 1))

    if vector.scale is not None:
        numbers *= each(vector.scale)
    if vector.per:
        seconds = each(vector.per) * 1e-6
        seconds[seconds == 0] = np.nan
        numbers /= seconds
    if vector.factor != 1.0:
        numbers *= vector.factor


def unrolled(burst: Burst, width: int, column: Column,
             ) -> tuple[NDArray[np.int64], NDArray[np.bool_], NDArray[np.bool_]]:
    """
    Say when each sample of a burst was taken.

    Parameters
    ----------
    burst : Burst
        Which fields tell.
    width : int
        Samples that fit into a message.
    column : callable
        Gives the numbers of a field, shape (n,).

    Returns
    -------
    before_ns : ndarray of int64, shape (n, width)
        Nanoseconds before the stamp of the message, which is that of the last sample.
    filled : ndarray of bool, shape (n, width)
        Where there is a sample.
    sound : ndarray of bool, shape (n,)
        Messages whose number of samples and time between them are possible; no sample of the
        others is filled.

    """
    count = column(burst.samples).astype(np.int64)
    step_ns = column(burst.step_us).astype(np.float64) * 1e3
    sound = (count > 0) & (count <= width) & np.isfinite(step_ns) & (step_ns > 0) & (
        step_ns < _LONGEST_STEP_NS)
    number = np.arange(width)
    before = np.where(sound, step_ns, 0)[:, np.newaxis] * (count[:, np.newaxis] - 1 - number)
    filled = (number < count[:, np.newaxis]) & sound[:, np.newaxis]
    return np.rint(before).astype(np.int64), filled, sound


def unsound(burst: Burst, width: int) -> str:
    """Say what is wrong with a burst that is not sound."""
    return f'{burst.samples} is not 1 to {width}, or {burst.step_us} is no time'
