# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
A sensor that warms up, by one exponential or two, in one module as one search finds both.

A warm-up of a real sensor is thousands of times the noise it hides. Its time constant therefore is
fitted, not picked: the exponential and its derivative by the logarithm of the time constant are
regressors side by side. The second one's coefficient says how far the time constant is off, which
is taken out step by step (Gauss and Newton), and what it keeps uncertain widens everything else.
Which part of the band is fitted is decided anew beside the warm-up: what it leaves in the spectrum
passes for flicker and for a low-pass.

References
----------
D. M. Bates and D. G. Watts, "Nonlinear Regression Analysis and Its Applications", 1988, ch. 2.

"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import log

from imu_allan.noise.chi_square import NORMAL95
from imu_allan.noise.correlated import Process
from imu_allan.noise.courses import (
    best_course,
    has_walk,
    in_each,
    likelihood_ratio,
    Spectrum,
    with_courses,
)
from imu_allan.noise.groups import Groups, WALK
from imu_allan.noise.intervals import amplitude_of, errors_of_courses
from imu_allan.noise.likelihood import maximise, Solution
from imu_allan.noise.mean_in_blocks import Course
from imu_allan.noise.shapes import warming, warming_slower
from imu_allan.noise.trial import Trial
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Choose = Callable[[Groups, Solution], tuple[Trial, Process | None]]
"""Chooses the model and the band for groups, beginning at a solution."""

_WARMING = 15.0
"""
Likelihood ratio above which a warm-up is one. It has two parameters, one of which is searched. Of
records of a weak random walk, of three standard errors, 2 in 100 pass for one all the same.
"""
_INSTEAD = 9.0
"""The same against a walk: by so much a warm-up alone has to be more likely than a walk alone."""
_UNKNOWN_FLOOR = 0.05
"""What is left of a warm-up that is over, where no floor says when: three time constants."""
_TIME_CONSTANTS = 9
"""A factor of 1.5 apart: near enough for steps to the best. A judgment, for each costs time."""
_SHORTEST_WARMING = 1 / 60
"""Over (three of it) within a twentieth of the record: what is over sooner is like no walk."""
_LONGEST_WARMING = 1 / 2
"""Time constants that are tried, in lengths of the record: a longer one looks like a ramp ..."""
_LONGEST_FITTED = 8.0
"""... but may be found from there, where it is strong: beyond, its bend alone is left."""
_SHORTEST_FITTED = 1 / 500
"""Time constants below are not followed: the course then rests on a few coarse means."""
_ANOTHER = 15.0
"""
Likelihood ratio above which there is another exponential beside the first, with an amplitude and a
time constant of its own that is searched.
"""
_TOLD_APART = 0.7
"""Most that the logarithms of two time constants may be in error: a factor of two. A judgment."""
_PAIR = 0.01
"""Of the logarithms of two time constants, and of a likelihood ratio: the steps do the rest."""
_MOST = 2
"""Exponentials: of a third, what noise there is leaves little that could be told."""
_UNKNOWN_TIME = 5.0
"""Most of the logarithm of the factor that a time constant is known to: a factor of 150."""
_EXACT = 1e-9
"""Of the logarithm of a time constant: no step is smaller, however little noise there is."""
_STEPS = 12
"""Most steps to a time constant: three or four are the rule, more where two are alike."""
_LONGEST_STEP = 0.5
"""Of its logarithm: beyond, the derivative no longer says where the best lies."""
_NEAR = 0.02
"""A step in standard errors from which on no other is worth its time."""


@dataclass(frozen=True)
class Warming:
    """
    An exponential approach to a steady value.

    Attributes
    ----------
    amplitude, low, high : float
        At the beginning of the record, with its 95 % interval, in the unit of a sample; signed.
    time_constant_s, shortest_s, longest_s : float
        With its 95 % interval.

    """

    amplitude: float
    low: float
    high: float
    time_constant_s: float
    shortest_s: float = 0.0
    longest_s: float = float('inf')

    def steady_after_s(self, floor: float) -> float:
        """
        Seconds from the beginning until what is left is no more than a third of the flicker floor.

        Where the floor is not known (zero), until a twentieth of the amplitude is left.

        Examples
        --------
        >>> round(Warming(3.0, 2.9, 3.1, 100.0).steady_after_s(0.1))
        450

        """
        left = max(floor / 3 / abs(self.amplitude), _UNKNOWN_FLOOR if floor <= 0 else 1e-6)
        return self.time_constant_s * max(log(1 / left), 0.0)


@dataclass(frozen=True)
class WarmUp:
    """
    A warm-up that was found, and the fit beside it.

    Attributes
    ----------
    trial : Trial
    process : Process or None
        A Gauss-Markov process that is part of the trial.
    record : RecordSpectrum or JointSpectrum
        With the warm-up among its courses, and without what it leaves in blocks.
    warmings : tuple of Warming
        The largest first.
    courses : tuple of Course
        Those of the warm-up, the last of the record.

    """

    trial: Trial
    process: Process | None
    record: Spectrum
    warmings: tuple[Warming, ...]
    courses: tuple[Course, ...]

    def beside(self, record: Spectrum) -> Spectrum:
        """Lay the same warm-up to another spectrum of the record."""
        return record.settled(self.courses, _trend(self.trial), _noise(self.trial)).beside(
            self.courses)


def warm_up(trial: Trial, record: Spectrum, still: Solution, choose: Choose) -> WarmUp | None:
    """
    Look for a warm-up.

    Parameters
    ----------
    trial : Trial
        A fit with the ramp alone.
    record : RecordSpectrum or JointSpectrum
        That it was fitted to.
    still : Solution
        The same without a random walk.
    choose : callable
        Chooses the model anew beside it.

    Returns
    -------
    WarmUp or None

    """
    time = _found(trial, record, still)
    if time is None:
        return None
    process: Process | None = None
    warm, times = _refined(trial, record, [time])
    for _ in range(_MOST):
        fewer = len(times)
        warm, times = _with_another(warm, record, times)
        courses = _courses(times)
        calm = record.settled(courses, _trend(warm), _noise(warm))
        chosen, process = choose(calm.beside(courses).groups(), warm.solution)
        warm, times = _refined(chosen, calm, times)
        if len(times) == fewer:
            break
    courses = _courses(times)
    return WarmUp(warm, process, calm.beside(courses), _told(warm, times), tuple(courses))


def likeliest_warming(trial: Trial, record: Spectrum, still: Solution) -> tuple[float, float]:
    """Return the time constant that explains most under noise without a walk, and how much."""
    times = record.duration_s * np.geomspace(_SHORTEST_WARMING, _LONGEST_WARMING, _TIME_CONSTANTS)
    tried: list[float] = times.tolist()
    return best_course(trial, record, still, tried, lambda value: [warming(value)])


def _found(trial: Trial, record: Spectrum, still: Solution) -> float | None:
    """Return the time constant, of some, of a warm-up that explains what a walk does not."""
    records = len(record.records)
    warms, instead = in_each(_WARMING, 1, records), in_each(_INSTEAD, 1, records)
    time, gain = likeliest_warming(trial, record, still)
    if gain < warms:
        return None
    warm = with_courses(trial, record, [warming(time)])
    if likelihood_ratio(trial, warm) >= warms:
        return time
    if not has_walk(warm) and _instead(trial, warm) >= instead:
        return time
    return None


def _instead(walking: Trial, warm: Trial) -> float:
    """Likelihood ratio of a warm-up without a walk against a walk without a warm-up."""
    walk = maximise(walking.groups, walking.solution, fixed=walking.fixed, trend='likely',
                    tolerance=1e-3)
    rest = maximise(warm.groups, warm.solution, fixed={**warm.fixed, WALK: 0.0}, trend='likely',
                    tolerance=1e-3)
    return 2 * (walk.loss - rest.loss) / walking.dispersion


def _with_another(warm: Trial, record: Spectrum, times: list[float]
                  ) -> tuple[Trial, list[float]]:
    """Add another exponential where what is left asks for one, die and housing, say."""
    if len(times) == _MOST:
        return warm, times
    from scipy.optimize import minimize  # seldom needed, and slow to import

    another = in_each(_ANOTHER, 1, len(record.records))
    still = maximise(warm.groups, warm.solution, fixed={**warm.fixed, WALK: 0.0},
                     trend='restricted')
    tried = record.duration_s * np.geomspace(_SHORTEST_WARMING / 2, _LONGEST_WARMING,
                                             _TIME_CONSTANTS + 2)
    _, gain = best_course(warm, record.beside(_courses(times)), still, tried.tolist(),
                          lambda value: [warming(value)])
    if gain < another:
        return warm, times
    # Two that are one to begin with lie to either side of it.
    pairs = list(combinations(tried.tolist(), 2))
    best, _ = best_course(warm, record, still, pairs, lambda pair: list(map(warming, pair)))

    def missed(logarithms: Array) -> float:
        pair: list[float] = np.exp(logarithms).tolist()
        return -best_course(warm, record, still, [pair], lambda pair: list(map(warming, pair)))[1]

    # From a point of the grid the steps may lead astray: of two courses either may give way.
    nearer = minimize(missed, np.log(best), method='Nelder-Mead',
                      options={'xatol': _PAIR, 'fatol': _PAIR})
    both, found = _refined(warm, record, np.exp(nearer.x).tolist())
    steps, errors = _steps(both, len(found))
    # Of two that are one, or of a walk, the time constants run away from one another.
    known = (np.abs(steps) < errors).all() and (errors < _TOLD_APART).all()
    return (both, found) if known and likelihood_ratio(warm, both) >= another else (warm, times)


def _refined(trial: Trial, record: Spectrum, times: list[float]) -> tuple[Trial, list[float]]:
    """Fit time constants, in the band and with the columns of a trial."""
    bounds = record.duration_s * _SHORTEST_FITTED, record.duration_s * _LONGEST_FITTED
    reached = times
    for _ in range(_STEPS):
        beside = with_courses(trial, record, _courses(reached))
        steps, errors = _steps(beside, len(times))
        if (np.abs(steps) < np.maximum(_NEAR * errors, _EXACT)).all():
            return beside, reached
        limited = np.clip(steps, -_LONGEST_STEP, _LONGEST_STEP)
        reached = np.clip(reached * np.exp(limited), *bounds).tolist()
    if (np.abs(steps) < errors).all():
        return beside, reached
    return with_courses(trial, record, _courses(times)), times


def _steps(beside: Trial, count: int) -> tuple[Array, Array]:
    """How far the logarithms of the time constants are off, and their standard errors."""
    trend, errors = np.atleast_2d(_trend(beside)), errors_of_courses(beside)
    amplitude, slower = trend[:, -2 * count::2], trend[:, 1 - 2 * count::2]
    weight = np.maximum(errors[:, 1 - 2 * count::2], 1e-300)**-2.0
    known = np.maximum(np.sum(weight * amplitude**2, axis=0), 1e-300)
    return np.sum(weight * amplitude * slower, axis=0) / known, known**-0.5


def _told(warm: Trial, times: Sequence[float]) -> tuple[Warming, ...]:
    """Return amplitudes and time constants with their intervals, the largest amplitude first."""
    _, errors = _steps(warm, len(times))
    found = []
    for number, (time, error) in enumerate(zip(times, errors.tolist(), strict=True)):
        # A time constant that is not known at all is known to a factor of any size.
        factor = float(np.exp(min(NORMAL95 * error, _UNKNOWN_TIME)))
        found.append(Warming(*amplitude_of(warm, 2 * (number - len(times))), time, time / factor,
                             time * factor))
    return tuple(sorted(found, key=lambda one: -abs(one.amplitude)))


def _courses(times: Sequence[float]) -> list[Course]:
    return [course for time in times for course in (warming(time), warming_slower(time))]


def _trend(trial: Trial) -> Array:
    assert trial.solution.trend is not None
    return trial.solution.trend


def _noise(trial: Trial) -> Array:
    """Squared coefficients of the four terms; the column of a roll-off is none of them."""
    theta = trial.solution.theta[:4].copy()
    if trial.rolling:
        theta[0] = 0.0
    return theta
