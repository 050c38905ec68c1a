# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether a random walk is one, or the mean moves in a way that is no noise.

A warm-up, a day's cycle or a bent drift stands in the slowest coefficients, as a random walk does.
Each is laid to the record beside the noise terms; a walk that needs to be there all the same is
one. Parameters of the mean are compared by the likelihood, walks by the restricted likelihood
under the same regressors.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import log

from imu_allan.noise import chi_square
from imu_allan.noise.groups import WALK
from imu_allan.noise.intervals import amplitude_of
from imu_allan.noise.likelihood import maximise, Solution
from imu_allan.noise.trends import (
    Course,
    cycle,
    EachCourse,
    JointSpectrum,
    legendre,
    RecordSpectrum,
    warming,
)
from imu_allan.noise.trial import OBSERVABLE, residuals, Trial
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Spectrum = RecordSpectrum | JointSpectrum

_WARMING = 15.0
"""
Likelihood ratio above which a warm-up is one. It has two parameters, one of which is searched. Of
records of a weak random walk, of three standard errors, 2 in 100 pass for one all the same.
"""
_INSTEAD = 9.0
"""The same against a walk: by so much a warm-up alone has to be more likely than a walk alone."""
_CYCLING = 25.0
"""Likelihood ratio above which a slow cycle is one; its frequency is searched over many."""
_DOUBTFUL_CYCLE = 10.0
"""Above this one, a walk has to be observable beside the cycle too."""
_UNKNOWN_FLOOR = 0.05
"""What is left of a warm-up that is over, where no floor says when: three time constants."""
_TIME_CONSTANTS = 9
"""A factor of 1.5 apart: the best of them is told as it is. A judgment, for each costs time."""
_SHORTEST_WARMING = 1 / 60
"""Over (three of it) within a twentieth of the record: what is over sooner is like no walk."""
_LONGEST_WARMING = 1 / 2
"""Time constants that are tried, in lengths of the record: a longer one looks like a ramp."""
_CYCLES = np.arange(1.0, 16.1, 0.25)
"""Cycles in the record that are tried; of more, each has little to do with a walk."""
_SLOW = 128
"""Coefficients by which candidates are ranked: the faster ones do not see them."""


@dataclass(frozen=True)
class Warming:
    """
    An exponential approach to a steady value.

    Attributes
    ----------
    amplitude, low, high : float
        At the beginning of the record, with its 95 % interval, in the unit of a sample; signed.
    time_constant_s : float

    """

    amplitude: float
    low: float
    high: float
    time_constant_s: float

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
class MovingMean:
    """
    What moves the mean beside a ramp.

    Attributes
    ----------
    trial : Trial
        With the regressors that the record asks for.
    walk : bool
        Whether a random walk has to be there beside any of these courses.
    warming : Warming or None
    cycle_s : float or None
        Period of a slow cycle.
    courses : tuple of Course
        The regressors, without the ramp and those that the record has.

    """

    trial: Trial
    walk: bool
    warming: Warming | None = None
    cycle_s: float | None = None
    courses: tuple[Course, ...] = ()


def moving_mean(trial: Trial, record: Spectrum, walks: bool) -> MovingMean:
    """
    Ask what moves the mean, and what a walk that the fit has found may be instead.

    Parameters
    ----------
    trial : Trial
        A fit with the ramp alone.
    record : RecordSpectrum or JointSpectrum
        That it was fitted to.
    walks : bool
        Whether the walk is observable in it.

    Returns
    -------
    MovingMean

    """
    if record.duration_s == 0:
        # Nothing but runs too short for a spectrum of slow courses.
        return MovingMean(trial, walks)
    records = len(record.records)
    warms, instead = in_each(_WARMING, 1, records), in_each(_INSTEAD, 1, records)
    doubtful, cycles = (in_each(level, 2, records) for level in (_DOUBTFUL_CYCLE, _CYCLING))
    still = maximise(trial.groups, trial.solution, fixed={**trial.fixed, WALK: 0.0},
                     trend='restricted')
    times = record.duration_s * np.geomspace(_SHORTEST_WARMING, _LONGEST_WARMING, _TIME_CONSTANTS)
    time, gain = _best(trial, record, still, times, lambda value: [warming(value)])
    if gain >= warms:
        warm = with_courses(trial, record, [warming(time)])
        beside = has_walk(warm)
        if likelihood_ratio(trial, warm) >= warms \
                or (not beside and _instead(trial, warm) >= instead):
            walks = walks and beside and _walks(trial, record, [warming(time)])
            return MovingMean(warm, walks, Warming(*amplitude_of(warm, -1), time),
                              courses=(warming(time),))
    if not walks:
        return MovingMean(trial, walk=False)
    if not _walks(trial, record, []):
        return MovingMean(trial, walk=False)
    frequency, gain = _best(trial, record, still, _CYCLES / record.duration_s, cycle)
    if gain >= doubtful:
        turning = with_courses(trial, record, cycle(frequency))
        beside = has_walk(turning)
        ratio = likelihood_ratio(trial, turning)
        if ratio >= cycles:
            return MovingMean(turning, beside, cycle_s=1 / frequency, courses=cycle(frequency))
        if ratio >= doubtful:
            return MovingMean(trial, beside)
    return MovingMean(trial, walk=True)


def in_each(level: float, amplitudes: int, records: int) -> float:
    """Likelihood ratio as rare as `level`, where every record has amplitudes of its own."""
    if records == 1:
        return level
    return float(chi_square.upper(float(chi_square.survival(level, amplitudes)),
                                  amplitudes * records))


def with_courses(trial: Trial, record: Spectrum, courses: Sequence[Course | EachCourse]) -> Trial:
    """Fit the same columns of the same band again, with courses of the mean beside the ramp."""
    full = record.groups(*courses)
    if trial.edge_hz is not None:
        full = full.below(trial.edge_hz)
    groups = replace(trial.groups, along=full.along, among=full.among, record=full.record)
    solution = maximise(groups, trial.solution, fixed=trial.fixed, trend='restricted')
    p_value, misfit, dispersion = residuals(groups, solution)
    return replace(trial, groups=groups, solution=solution, p_value=p_value, misfit=misfit,
                   dispersion=dispersion)


def _walks(trial: Trial, record: Spectrum, courses: Sequence[Course]) -> bool:
    """Whether the walk is observable beside what bends, too."""
    duration = record.duration_s
    bends = [legendre(2, duration), legendre(3, duration)]
    return has_walk(with_courses(trial, record, [*courses, *bends]))


def has_walk(trial: Trial) -> bool:
    """Whether the walk of a fit is observable."""
    limit = trial.solution.loss + OBSERVABLE * trial.dispersion / 2
    return maximise(trial.groups, trial.solution, fixed={**trial.fixed, WALK: 0.0},
                    trend='restricted', tolerance=1e-3, limit=limit).loss >= limit


def _instead(walking: Trial, warm: Trial) -> float:
    """Likelihood ratio of a warm-up without a walk against a walk without a warm-up."""
    walk = maximise(walking.groups, walking.solution, fixed=walking.fixed, trend='likely',
                    tolerance=1e-3)
    rest = maximise(warm.groups, warm.solution, fixed={**warm.fixed, WALK: 0.0}, trend='likely',
                    tolerance=1e-3)
    return 2 * (walk.loss - rest.loss) / walking.dispersion


def likelihood_ratio(without: Trial, beside: Trial) -> float:
    """Likelihood ratio of courses of the mean, the noise fitted with and without."""
    plain = maximise(without.groups, without.solution, fixed=without.fixed, trend='likely',
                     tolerance=1e-3)
    fitted = maximise(beside.groups, beside.solution, fixed=beside.fixed, trend='likely',
                      tolerance=1e-3)
    return 2 * (plain.loss - fitted.loss) / without.dispersion


def _best(trial: Trial, record: Spectrum, still: Solution, values: Array,
          courses: Callable[[float], Sequence[Course]]) -> tuple[float, float]:
    """Rank candidates by what they explain under noise without a walk: the best, and how much."""
    candidates = [courses(float(value)) for value in values]
    gains = sum((_gains(trial, one, still, candidates) for one in record.records),
                np.zeros(len(values)))
    best = int(np.argmax(gains))
    return float(values[best]), float(gains[best]) / trial.dispersion


def _gains(trial: Trial, record: RecordSpectrum, still: Solution,
           candidates: Sequence[Sequence[Course]]) -> Array:
    """Fall of twice the loss that each candidate brings to one record, shape (candidates,)."""
    slow = record.slowest(_SLOW)
    columns = slow.regressors([course for some in candidates for course in some])
    theta = still.theta[:slow.design.shape[1]].copy()
    if trial.rolling:
        theta[0] = 0.0
    weight = 1 / np.maximum(slow.design @ theta, 1e-300)
    # What the ramp and the courses of the record explain is taken out of both sides.
    known = np.column_stack((slow.ramp, slow.regressors(record.courses))) if record.courses \
        else slow.ramp[:, None]
    root = np.sqrt(weight)[:, None]
    basis = np.linalg.qr(root * known)[0]
    signal = (slow.coefficient - (basis @ (basis.T @ (root[:, 0] * slow.coefficient)))
              / root[:, 0])
    columns = columns - basis @ (basis.T @ (root * columns)) / root
    each = columns.reshape(len(columns), len(candidates), -1)
    target = np.einsum('nca,n->ca', each, weight * signal)
    gram = np.einsum('nca,ncb,n->cab', each, each, weight, optimize=True)
    gram = gram + 1e-9 * np.einsum('caa->c', gram)[:, None, None] * np.eye(each.shape[2])
    return np.asarray(
        np.einsum('ca,ca->c', target, np.linalg.solve(gram, target[..., None])[..., 0]))
