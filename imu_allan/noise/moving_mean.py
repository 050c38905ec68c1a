# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether a random walk is one, or the mean moves in a way that is no noise.

A warm-up, a day's cycle, a step or a bent drift stands in the slowest coefficients, as a random
walk does. Each is laid to the record beside the noise terms; a walk that needs to be there all the
same is one.
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
from imu_allan.noise.harmonics import without
from imu_allan.noise.likelihood import maximise, Solution
from imu_allan.noise.mean_in_blocks import Course
from imu_allan.noise.shapes import cycle, legendre, step
from imu_allan.noise.slow_cycle import (
    likeliest_cycle,
    slow_cycle,
    SlowCycle,
    sticks_out,
    taken_out,
)
from imu_allan.noise.trends import EachCourse, RecordSpectrum
from imu_allan.noise.trial import Trial
from imu_allan.noise.warm_up import Choose, likeliest_warming, warm_up, Warming
import numpy as np

_DOUBTFUL_CYCLE = 10.0
"""Likelihood ratio of a slow cycle above which a walk has to be observable beside it, too."""
_DOUBTFUL_STEP = 9.0
"""
The same of a step beside the walk: three standard errors. Of 12 steps of 5 B from which a walk was
made each had 9.8 or more; of 29 walks that are one 1, and that was observable beside it. Several
records need so much each: 78 sets of two or four with a step of 5 B or more in each have more than
15 a record; 5 of 54 sets with a walk lose it beside the steps, and have 6 to 9.5.
"""
_STEPS_TRIED = 64
"""Evenly over the record, ..."""
_STEPS_NEAR = 8
"""... and so many times as closely about the best of them."""
_FEWEST_CYCLES = 2.0
"""In the record: below, a strong one is not told from a mean that bends."""


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
    cycle : SlowCycle or None

    """

    trial: Trial
    process: Process | None
    record: Spectrum
    walk: bool
    warmings: tuple[Warming, ...] = ()
    cycle: SlowCycle | None = None

    @property
    def moves(self) -> bool:
        """Whether it is known to move, beside a ramp."""
        return self.cycle is not None or any(one.courses for one in self.record.records)

    @property
    def course(self) -> Course:
        """Return the mean of the first record, with the ramp."""
        assert self.trial.solution.trend is not None
        still = self.record.records[0].mean(np.atleast_2d(self.trial.solution.trend)[0])
        if self.cycle is None:
            return still
        turns = self.cycle.cycles[0].course
        return lambda time: still(time) + turns(time)


def moving_mean(trial: Trial, process: Process | None, record: Spectrum, walks: bool,
                choose: Choose, known_hz: Sequence[float] = ()) -> MovingMean:
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
        Chooses the model anew, where a warm-up or a cycle bends the spectrum.
    known_hz : sequence of float, optional
        Frequencies of slow cycles that other axes have.

    Returns
    -------
    MovingMean

    """
    if record.duration_s == 0:
        # Nothing but runs too short for a spectrum of slow courses.
        return MovingMean(trial, process, record, walks)
    turning = _turning_first(trial, process, record, choose, known_hz)
    return _beside_cycle(trial, process, record, walks, choose, known_hz, turning)


def _beside_cycle(trial: Trial, process: Process | None, record: Spectrum, walks: bool,
                  choose: Choose, known_hz: Sequence[float], turning: SlowCycle | None
                  ) -> MovingMean:
    """Ask the same where a cycle was found already, or none."""
    whole = record
    if turning is not None:
        trial, process, record = turning.trial, turning.process, turning.record
    still = _without_walk(trial)
    warm = warm_up(trial, record, still, choose)
    if warm is not None:
        if turning is not None:
            turning = taken_out(warm.trial, warm.process, warm.beside(whole),
                                turning.cycles[0].frequency_hz, choose)
        else:
            turning = _turning(warm.trial, warm.process, warm.record, choose, known_hz)
        if turning is not None:
            # Each was fitted beside what the other had left: once more, without the cycle.
            record = without(whole, turning.cycles, turning.variances)
            trial, process = choose(record.groups(), turning.trial.solution)
            still = _without_walk(trial)
            warm = warm_up(trial, record, still, choose)
    warmings: tuple[Warming, ...] = ()
    if warm is not None:
        trial, process, record, warmings = warm.trial, warm.process, warm.record, warm.warmings
        still = _without_walk(trial)
    if warm is not None or turning is not None:
        walks = has_walk(trial)
    if not walks or not _walks(trial, record) or _steps(trial, record, still):
        return MovingMean(trial, process, record, False, warmings, turning)
    doubtful = in_each(_DOUBTFUL_CYCLE, 2, len(record.records))
    frequency, gain = likeliest_cycle(trial, record, still)
    if gain >= doubtful:
        beside = with_courses(trial, record, cycle(frequency))
        ratio = likelihood_ratio(trial, beside)
        found = (slow_cycle(trial, process, record, frequency, choose, ratio=ratio)
                 if turning is None else None)
        if found is not None and warm is None:
            # It has hidden what a warm-up would explain.
            return _beside_cycle(trial, process, whole, walks, choose, known_hz, found)
        if found is not None:
            return MovingMean(found.trial, found.process, found.record, has_walk(found.trial),
                              warmings, found)
        if ratio >= doubtful:
            return MovingMean(trial, process, record, has_walk(beside), warmings, turning)
    return MovingMean(trial, process, record, True, warmings, turning)


def _turning_first(trial: Trial, process: Process | None, record: Spectrum, choose: Choose,
                   known_hz: Sequence[float]) -> SlowCycle | None:
    """Look for a cycle before anything else, where it explains more than a warm-up does."""
    if not known_hz and not sticks_out(trial, record):
        return None
    still = _without_walk(trial)
    _, gain = (best_course(trial, record, still, known_hz, cycle) if known_hz
               else likeliest_cycle(trial, record, still))
    if gain < likeliest_warming(trial, record, still)[1]:
        return None
    return _turning(trial, process, record, choose, known_hz)


def _turning(trial: Trial, process: Process | None, record: Spectrum, choose: Choose,
             known_hz: Sequence[float]) -> SlowCycle | None:
    """Look for a cycle at the frequencies of other axes, then at all."""
    for frequency in known_hz:
        found = slow_cycle(trial, process, record, frequency, choose, known=True)
        if found is not None:
            return found
    if not sticks_out(trial, record):
        return None
    frequency, _ = likeliest_cycle(trial, record, _without_walk(trial))
    if frequency * record.duration_s < _FEWEST_CYCLES:
        return None
    return slow_cycle(trial, process, record, frequency, choose)


def _without_walk(trial: Trial) -> Solution:
    return maximise(trial.groups, trial.solution, fixed={**trial.fixed, WALK: 0.0},
                    trend='restricted')


def _walks(trial: Trial, record: Spectrum, courses: Sequence[Course] = ()) -> bool:
    """Whether the walk is observable beside what bends, too."""
    duration = record.duration_s
    bends = [legendre(2, duration), legendre(3, duration)]
    return has_walk(with_courses(trial, record, [*courses, *bends]))


def _steps(trial: Trial, record: Spectrum, still: Solution) -> bool:
    """Whether a single step in each record explains what passes for a walk, and more than that."""
    each = EachCourse(tuple(step(_likeliest_step(trial, one, still)) for one in record.records))
    beside = with_courses(trial, record, [each])
    doubtful = _DOUBTFUL_STEP * len(record.records)
    return likelihood_ratio(trial, beside) >= doubtful and not has_walk(beside)


def _likeliest_step(trial: Trial, record: RecordSpectrum, still: Solution) -> float:
    """Return when the step comes in one record that explains most."""
    between = record.duration_s / _STEPS_TRIED
    at_s = 0.0
    for near in (between * np.arange(1, _STEPS_TRIED),
                 between / _STEPS_NEAR * np.arange(1 - _STEPS_NEAR, _STEPS_NEAR)):
        at_s, _ = best_course(trial, record, still, (at_s + near).tolist(),
                              lambda at: [step(at)])
    return at_s
