# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The mean of an axis in words: with the digits that its error leaves."""

from imu_allan.characterization.mean import error_of_mean
from imu_allan.noise.chi_square import NORMAL95
from imu_allan.result import AxisResult
from imu_allan.sensor.units import convert
from imu_allan.wording import measured


def written_mean(axis: AxisResult, mean: float, duration_s: float, unit: str
                 ) -> tuple[str, str, str]:
    """
    Return a mean and its 95 % interval, which the fitted terms give it, as text.

    Parameters
    ----------
    axis : AxisResult
        Whose mean; one that shows no term has no interval, and four digits.
    mean : float
        Over all of the record or a part of it, in the unit of a sample.
    duration_s : float
        Of the record or the part.
    unit : str
        To write it in.

    Returns
    -------
    value, low, high : str

    """
    half = NORMAL95 * error_of_mean(axis, duration_s)
    return measured(*(convert(value, axis.unit, unit)
                      for value in (mean, mean - half, mean + half)))
