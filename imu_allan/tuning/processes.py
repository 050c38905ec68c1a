# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What tuning takes of the result of an axis: its drift model, and what its lines leave."""

from imu_allan.errors import ImuAllanError
from imu_allan.noise.terms import frequencies_of_lines
from imu_allan.result import AxisResult, DriftModel, Tone
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def drift_model_of(axis: AxisResult) -> DriftModel:
    """
    Return the drift model of an axis.

    Raises
    ------
    ImuAllanError
        If the axis has none.
    TypeError
        If it is none, such as a whole result.

    """
    if not isinstance(axis, AxisResult):
        raise TypeError(f"expected an axis of a result, such as result.axes['gyro_x'], not "
                        f'{type(axis).__name__}')
    if axis.drift_model is None:
        raise ImuAllanError('this axis has no drift model (it is constant, too short, or from a '
                            'result of an older version): analyze the recording again')
    return axis.drift_model


def line_power(tones: tuple[Tone, ...], interval_s: ArrayLike) -> Array:
    """Variance that lines of random phase leave in the mean over an interval."""
    interval = np.asarray(interval_s, dtype=np.float64)
    total = np.zeros(interval.shape)
    for tone in tones:
        turns = np.multiply.outer(frequencies_of_lines(tone.frequency_hz, tone.lines), interval)
        total = total + tone.amplitude**2 / 2 * np.mean(np.sinc(turns) ** 2, axis=0)
    return total
