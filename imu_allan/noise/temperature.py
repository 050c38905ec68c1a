# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
How the mean of an axis depends on temperature.

The temperature over the record is a regressor beside the ramp, its square a second one where the
data asks for it. Whether an axis depends on it is asked with all noise terms in the fit: a random
walk resembles any slow course a little, and so much has to be exceeded.

A thermometer in a case follows the sensor minutes later, and a sensor in a case the thermometer.
Either is a body of one time constant behind the other, which is fitted, not picked: beside the
temperature as the sensor has it, its derivative by the lag is a regressor whose size says how far
the lag is off (Gauss and Newton).

References
----------
D. M. Bates and D. G. Watts, "Nonlinear Regression Analysis and Its Applications", 1988, ch. 2.

"""

from dataclasses import dataclass, replace

from imu_allan.noise import chi_square
from imu_allan.noise.chi_square import NORMAL95
from imu_allan.noise.courses import (
    best_course,
    has_walk,
    in_each,
    likelihood_ratio,
    Spectrum,
    with_courses,
)
from imu_allan.noise.groups import FLICKER, WALK
from imu_allan.noise.intervals import amplitude_of, errors_of_courses, Estimate, estimate
from imu_allan.noise.mean_in_blocks import Course
from imu_allan.noise.temperature_course import AnyTemperature
from imu_allan.noise.trends import EachCourse
from imu_allan.noise.trial import Trial
from imu_allan.noise.walk_in_parts import either, without_walk
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_DEPENDS = 10.83
"""
Likelihood ratio of the temperature, and of its square (0.1 %). Of 600 records of two hours with an
unrelated temperature (settling, swinging or walking; with and without a random walk) 2 reached it.
"""
_LAGS = 12.0
"""The same of a lag, which is searched, against none, ..."""
_INSTEAD = 6.0
"""... and where a walk shows without it alone."""
_BY_CHANCE = 0.01
"""
Probability of the likelihood ratio of several lags from which on a walk may be theirs: of walking
temperatures 400 s behind, from which a walk was made, they had 69 to 89, unrelated ones up to 14.
"""
_LAGS_TRIED_S = (20.0, 40.0, 80.0, 160.0, 320.0, 640.0, 1280.0)
"""Behind or ahead: below, both are one; beyond, the whole building is between them."""
_LONGEST_LAG = 1 / 8
"""Of the record: a longer one is not told from the ramp."""
_STEPS = 8
"""Most steps to a lag: two or three are the rule."""
_NEAR = 0.05
"""A step in standard errors from which on no other is worth its time."""
_EXACT_S = 0.1
"""No step is smaller, however little noise there is."""


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
    lag_s : float or None
        Time constant by which the thermometer follows the sensor, where it shows; negative where
        the sensor follows the thermometer.
    lag_ci95 : (float, float) or None

    """

    per_kelvin: float
    low: float
    high: float
    per_kelvin_squared: float | None
    lowest_c: float
    highest_c: float
    before: dict[str, float]
    lag_s: float | None = None
    lag_ci95: tuple[float, float] | None = None


@dataclass(frozen=True)
class Following:
    """
    How a mean follows the temperature.

    Attributes
    ----------
    courses : tuple of Course
        The temperature, where `bent` its square, and where there is a lag the derivative by it.
    bent : bool
    lag_s : float

    """

    courses: tuple[Course | EachCourse, ...]
    bent: bool = False
    lag_s: float = 0.0


def follows(trial: Trial, record: Spectrum, temperature: AnyTemperature) -> Following | None:
    """
    Ask by (7) whether the mean follows the temperature, with which lag, and whether in proportion.

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
    Following or None

    """
    records = len(record.records)
    depends, lags, instead = (in_each(level, 1, records)
                              for level in (_DEPENDS, _LAGS, _INSTEAD))
    linear, square = temperature.courses
    straight = with_courses(trial, record, [linear])
    ratio = likelihood_ratio(trial, straight)
    late = _lagging(trial, record, temperature)
    if late is not None:
        lag_s, beside, courses = late
        gain = likelihood_ratio(straight, beside)
        certain = gain >= lags or (gain >= instead and has_walk(straight)
                                   and not has_walk(beside))
        if certain and ratio + gain >= depends + lags:
            square = temperature.of_sensor(lag_s).courses[1]
            bent = with_courses(trial, record, [courses[0], square, courses[1]])
            if likelihood_ratio(beside, bent) >= depends:
                return Following((courses[0], square, courses[1]), True, lag_s)
            return Following(courses, False, lag_s)
    bent = with_courses(trial, record, [linear, square])
    if likelihood_ratio(straight, bent) >= depends:
        return Following((linear, square), True)
    return Following((linear,)) if ratio >= depends else None


def _lagging(trial: Trial, record: Spectrum, temperature: AnyTemperature
             ) -> tuple[float, Trial, tuple[Course | EachCourse, ...]] | None:
    """Fit the lag by which the mean follows the temperature best."""
    longest = _LONGEST_LAG * temperature.duration_s
    tried = [0.0, *(sign * lag for lag in _LAGS_TRIED_S if lag < longest for sign in (1, -1))]
    lag_s, _ = best_course(trial, record, trial.solution, tried,
                           lambda lag: [temperature.of_sensor(lag).courses[0]])
    for _ in range(_STEPS):
        courses = (temperature.of_sensor(lag_s).courses[0], temperature.per_second_of_lag(lag_s))
        beside = with_courses(trial, record, courses)
        step, error = _off(beside, -2, -1)
        if abs(step) < max(_NEAR * error, _EXACT_S):
            return lag_s, beside, courses
        lag_s += float(np.clip(step, -_longest_step(lag_s), _longest_step(lag_s)))
        if abs(lag_s) > longest:
            return None
    return (lag_s, beside, courses) if abs(step) < error else None


def _longest_step(lag_s: float) -> float:
    """Half of a lag, or of the shortest that is tried."""
    return max(abs(lag_s), _LAGS_TRIED_S[0]) / 2


def _off(trial: Trial, slope: int, slower: int) -> tuple[float, float]:
    """How far the lag is off, the size of one regressor over another's, and its error."""
    assert trial.solution.trend is not None
    trend = np.atleast_2d(trial.solution.trend)
    weight = np.maximum(errors_of_courses(trial)[:, slower], 1e-300)**-2.0
    known = max(float(np.sum(weight * trend[:, slope]**2)), 1e-300)
    return float(np.sum(weight * trend[:, slope] * trend[:, slower])) / known, known**-0.5


def beside_any_lag(trial: Trial, record: Spectrum, temperature: AnyTemperature, walk: Estimate,
                   flicker: Estimate) -> tuple[Estimate, Estimate]:
    """
    Hold slow noise against the temperature with lags of all lengths at once.

    Their sum stands for what no single lag describes: a case of several bodies, readings too
    coarse to tell the lag, or a dependence that was not named as the walk hides it.

    Parameters
    ----------
    trial : Trial
        A fit with a walk, or with the temperature.
    record : RecordSpectrum or JointSpectrum
        That it was fitted to.
    temperature : TemperatureCourse or JointTemperature
        Over the same record or records.
    walk, flicker : Estimate
        As the trial has them.

    Returns
    -------
    walk, flicker : Estimate
        With what is true of them either way, and where no walk is left a bound of it; as they
        were where these lags explain no more than chance does.

    """
    longest = _LONGEST_LAG * temperature.duration_s
    courses = [temperature.of_sensor(sign * lag).courses[0]
               for lag in _LAGS_TRIED_S[::2] if lag < longest for sign in (1, -1)]
    if not courses:
        return walk, flicker
    beside = with_courses(trial, record, courses)
    amplitudes = len(courses) * len(record.records)
    if likelihood_ratio(trial, beside) < chi_square.upper(_BY_CHANCE, amplitudes):
        return walk, flicker
    left = estimate(beside, WALK)
    still = beside if left.observable else without_walk(beside)
    return either(walk, left), either(flicker, estimate(still, FLICKER))


def dependence(trial: Trial, temperature: AnyTemperature, following: Following,
               before: dict[str, float]) -> Dependence:
    """
    Read the dependence off a fit: the coefficients of the regressors of (7).

    Parameters
    ----------
    trial : Trial
        With the courses of the temperature directly behind the ramp.
    temperature : TemperatureCourse or JointTemperature
        Over the same record or records; of several, the slope is their weighted mean.
    following : Following
        Which courses it has.
    before : dict
        By key, what was observable without them.

    Returns
    -------
    Dependence

    """
    slope, low, high = amplitude_of(trial, 1, common=True)
    square = amplitude_of(trial, 2, common=True)[0] if following.bent else None
    found = Dependence(slope, low, high, square, temperature.lowest, temperature.highest, before)
    if following.lag_s == 0:
        return found
    off, error = _off(trial, 1, len(following.courses))
    lag_s, half = following.lag_s + off, NORMAL95 * error
    return replace(found, lag_s=lag_s, lag_ci95=(lag_s - half, lag_s + half))
