# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether a random walk is one, or the mean moves in a way that is no noise.

A warm-up, a day's cycle or a bent drift stands in the slowest coefficients, as a random walk does.
Each is laid to the record beside the noise terms; a walk that needs to be there all the same is
one.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from imu_allan.noise.correlated import Process
from imu_allan.noise.courses import (
    best_course,
    has_walk,
    in_each,
    likelihood_ratio,
    Spectrum,
    with_courses,
)
from imu_allan.noise.groups import WALK
from imu_allan.noise.leaks import Course
from imu_allan.noise.likelihood import maximise, Solution
from imu_allan.noise.trends import cycle, legendre
from imu_allan.noise.trial import Trial
from imu_allan.noise.warm_up import Choose, warm_up, Warming
import numpy as np

_CYCLING = 25.0
"""Likelihood ratio above which a slow cycle is one; its frequency is searched over many."""
_DOUBTFUL_CYCLE = 10.0
"""Above this one, a walk has to be observable beside the cycle too."""
_CYCLES = np.arange(1.0, 16.1, 0.25)
"""Cycles in the record that are tried; of more, each has little to do with a walk."""


@dataclass(frozen=True)
class MovingMean:
    """
    What moves the mean beside a ramp.

    Attributes
    ----------
    trial : Trial
        With the regressors that the record asks for.
    process : Process or None
        A Gauss-Markov process that is part of the trial.
    record : RecordSpectrum or JointSpectrum
        What the trial was fitted to.
    walk : bool
        Whether a random walk has to be there beside any of these courses.
    warmings : tuple of Warming
        The parts of a warm-up, the largest first.
    cycle_s : float or None
        Period of a slow cycle.

    """

    trial: Trial
    process: Process | None
    record: Spectrum
    walk: bool
    warmings: tuple[Warming, ...] = ()
    cycle_s: float | None = None

    @property
    def course(self) -> Course:
        """Return the mean of the first record, with the ramp."""
        assert self.trial.solution.trend is not None
        return self.record.records[0].mean(np.atleast_2d(self.trial.solution.trend)[0])


def moving_mean(trial: Trial, process: Process | None, record: Spectrum, walks: bool,
                choose: Choose) -> MovingMean:
    """
    Ask what moves the mean, and what a walk that the fit has found may be instead.

    Parameters
    ----------
    trial : Trial
        A fit with the ramp alone.
    process : Process or None
        A Gauss-Markov process that is part of it.
    record : RecordSpectrum or JointSpectrum
        That it was fitted to.
    walks : bool
        Whether the walk is observable in it.
    choose : callable
        Chooses the model anew, where a warm-up bends the spectrum.

    Returns
    -------
    MovingMean

    """
    if record.duration_s == 0:
        # Nothing but runs too short for a spectrum of slow courses.
        return MovingMean(trial, process, record, walks)
    still = _without_walk(trial)
    warm = warm_up(trial, record, still, choose)
    warmings: tuple[Warming, ...] = ()
    if warm is not None:
        trial, process, record, warmings = warm.trial, warm.process, warm.record, warm.warmings
        walks, still = has_walk(trial), _without_walk(trial)
    if not walks or not _walks(trial, record):
        return MovingMean(trial, process, record, False, warmings)
    doubtful, cycles = (in_each(level, 2, len(record.records))
                        for level in (_DOUBTFUL_CYCLE, _CYCLING))
    frequency, gain = best_course(trial, record, still, (_CYCLES / record.duration_s).tolist(),
                                  cycle)
    if gain >= doubtful:
        turning = with_courses(trial, record, cycle(frequency))
        beside = has_walk(turning)
        ratio = likelihood_ratio(trial, turning)
        if ratio >= cycles:
            return MovingMean(turning, process, record.beside(cycle(frequency)), beside, warmings,
                              1 / frequency)
        if ratio >= doubtful:
            return MovingMean(trial, process, record, beside, warmings)
    return MovingMean(trial, process, record, True, warmings)


def _without_walk(trial: Trial) -> Solution:
    return maximise(trial.groups, trial.solution, fixed={**trial.fixed, WALK: 0.0},
                    trend='restricted')


def _walks(trial: Trial, record: Spectrum, courses: Sequence[Course] = ()) -> bool:
    """Whether the walk is observable beside what bends, too."""
    duration = record.duration_s
    bends = [legendre(2, duration), legendre(3, duration)]
    return has_walk(with_courses(trial, record, [*courses, *bends]))
