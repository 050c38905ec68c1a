# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
How the mean of an axis depends on temperature.

The temperature over the record is a regressor beside the ramp, its square a second one where the
data asks for it. Whether an axis depends on it is asked with all noise terms in the fit: a random
walk resembles any slow course a little, and so much has to be exceeded.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from imu_allan.noise.courses import in_each, likelihood_ratio, with_courses
from imu_allan.noise.intervals import amplitude_of
from imu_allan.noise.leaks import Course
from imu_allan.noise.trends import EachCourse, JointSpectrum, RecordSpectrum
from imu_allan.noise.trial import Trial
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_DEPENDS = 10.83
"""
Likelihood ratio of the temperature, and of its square (0.1 %). Of 600 records of two hours with an
unrelated temperature (settling, swinging or walking; with and without a random walk) 2 reached it.
"""


@dataclass(frozen=True)
class TemperatureCourse:
    """
    The temperature over a record.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Seconds from its beginning, runs laid end to end.
    celsius : ndarray, shape (n,)

    """

    time: Array
    celsius: Array

    @property
    def lowest(self) -> float:
        """Lowest temperature, in degrees Celsius."""
        return float(self.celsius.min())

    @property
    def highest(self) -> float:
        """Highest temperature, in degrees Celsius."""
        return float(self.celsius.max())

    @property
    def courses(self) -> tuple[Course, Course]:
        """Return the temperature about its mean, in kelvin, and the square of that."""
        about = self.celsius - self.celsius.mean()

        def linear(time: Array) -> Array:
            return np.asarray(np.interp(time, self.time, about))

        return linear, lambda time: linear(time)**2


@dataclass(frozen=True)
class JointTemperature:
    """The temperature over each of several records."""

    records: tuple[TemperatureCourse, ...]

    @property
    def lowest(self) -> float:
        """Lowest temperature, in degrees Celsius."""
        return min(record.lowest for record in self.records)

    @property
    def highest(self) -> float:
        """Highest temperature, in degrees Celsius."""
        return max(record.highest for record in self.records)

    @property
    def courses(self) -> tuple[EachCourse, EachCourse]:
        """Return those of every record."""
        linear, square = zip(*(record.courses for record in self.records), strict=True)
        return EachCourse(linear), EachCourse(square)


@dataclass(frozen=True)
class Dependence:
    """
    Change of the mean with temperature.

    Attributes
    ----------
    per_kelvin, low, high : float
        Slope at the mean temperature of the record with its 95 % interval, unit of a sample.
    per_kelvin_squared : float or None
        Coefficient of the square of the distance from the mean temperature, where it shows.
    lowest_c, highest_c : float
        The range it was seen over.
    before : dict
        By key, the coefficients that were observable without the temperature.

    """

    per_kelvin: float
    low: float
    high: float
    per_kelvin_squared: float | None
    lowest_c: float
    highest_c: float
    before: dict[str, float]


def asked_for(trial: Trial, record: RecordSpectrum | JointSpectrum,
              temperature: TemperatureCourse | JointTemperature) -> Sequence[Course | EachCourse]:
    """
    Return what the data asks for by (7): nothing, the temperature, or its square as well.

    Parameters
    ----------
    trial : Trial
        A fit without temperature.
    record : RecordSpectrum or JointSpectrum
        That it was fitted to.
    temperature : TemperatureCourse or JointTemperature
        Over the same record or records.

    Returns
    -------
    sequence of Course

    """
    depends = in_each(_DEPENDS, 1, len(record.records))
    linear, square = temperature.courses
    straight = with_courses(trial, record, [linear])
    bent = with_courses(trial, record, [linear, square])
    if likelihood_ratio(straight, bent) >= depends:
        return [linear, square]
    return [linear] if likelihood_ratio(trial, straight) >= depends else []


def dependence(trial: Trial, temperature: TemperatureCourse | JointTemperature, courses: int,
               before: dict[str, float]) -> Dependence:
    """
    Read the dependence off a fit: the coefficients of the regressors of (7).

    Parameters
    ----------
    trial : Trial
        With the courses of the temperature directly behind the ramp.
    temperature : TemperatureCourse or JointTemperature
        Over the same record or records; of several, the slope is their weighted mean.
    courses : int
        How many of the courses it has.
    before : dict
        By key, what was observable without them.

    Returns
    -------
    Dependence

    """
    slope, low, high = amplitude_of(trial, 1, common=True)
    square = amplitude_of(trial, 2, common=True)[0] if courses > 1 else None
    return Dependence(slope, low, high, square, temperature.lowest, temperature.highest, before)
