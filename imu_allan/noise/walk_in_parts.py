# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether a random walk goes on in every part of a record, or is what a mean has done once.

A mean may settle, bend or jump in more ways than any list of courses has. Whatever it does, it
does at some time; a walk goes on. In parts of the record, each with a mean and a ramp of its own,
it shows as well, and in any of them as in the others.
"""

from collections.abc import Sequence
from dataclasses import replace

from imu_allan.noise import chi_square
from imu_allan.noise.courses import has_walk, likelihood_ratio, Spectrum, with_courses
from imu_allan.noise.groups import Groups, joined_groups, WALK
from imu_allan.noise.intervals import Estimate
from imu_allan.noise.likelihood import maximise
from imu_allan.noise.shapes import legendre
from imu_allan.noise.trial import Trial

_CLEAR_WALK = 25.0
"""
Likelihood ratio in all parts from which on a walk has to show in most of them, too. A judgment:
below, parts of a weak walk that is one may well differ so much.
"""
_BENDS = range(2, 8)
"""Orders of the polynomials beside which a walk has to show where the mean is known to move."""
_BENT_BY_CHANCE = 0.025
"""
Of what these explain beside a walk, as if by chance alone: below, the mean is known to move. A
judgment: of 26 records of a walk 3 had a ratio above 14.4, of 6 means that passed for one all.
"""


def is_walk(trial: Trial, record: Spectrum, parts: Sequence[Groups], *, moves: bool, even: bool
            ) -> bool:
    """
    Tell whether what a fit takes for a walk goes on all the time.

    Parameters
    ----------
    trial : Trial
        A fit of the whole record with a walk.
    record : RecordSpectrum or JointSpectrum
        That it was fitted to.
    parts : sequence of Groups
        Of four parts of the record, the same band and columns; none where it is too short.
    moves : bool
        Whether the mean is known to move.
    even : bool
        Whether the walk goes as far in any batch of time.

    Returns
    -------
    bool
        Where the mean stands still for all that is known, a walk that the parts together show
        clearly has to show in any three of them, and one too weak for that is let pass.

    """
    beside = with_courses(trial, record, [
        legendre(order, record.duration_s) for order in _BENDS])
    amplitudes = len(_BENDS) * len(record.records)
    by_chance = float(chi_square.upper(_BENT_BY_CHANCE, amplitudes))
    moves = moves or likelihood_ratio(trial, beside) >= by_chance
    if moves and not (even and trial.good and has_walk(beside)):
        return False
    if not parts:
        return True
    every = in_parts(trial, parts)
    ratio = 2 * (without_walk(every).solution.loss - every.solution.loss) / trial.dispersion
    return (ratio < _CLEAR_WALK and not moves) or all(
        has_walk(in_parts(trial, [*parts[:one], *parts[one + 1:]])) for one in range(len(parts)))


def without_walk(trial: Trial) -> Trial:
    """Fit the other terms alone."""
    fixed = {**trial.fixed, WALK: 0.0}
    return replace(trial, fixed=fixed, solution=maximise(
        trial.groups, trial.solution, fixed=fixed, trend='restricted'))


def either(one: Estimate, other: Estimate) -> Estimate:
    """Give what holds whichever of two fits is the true one; observable where it is in both."""
    upper = max(one.upper, other.upper)
    if not (one.observable and other.observable):
        return replace(one, observable=False, upper=upper)
    return replace(one, low=min(one.low, other.low), high=max(one.high, other.high), upper=upper)


def in_parts(trial: Trial, parts: Sequence[Groups]) -> Trial:
    """Fit the terms of a trial to parts of its record at once."""
    groups = joined_groups(parts)
    return replace(trial, groups=groups, solution=maximise(
        groups, replace(trial.solution, trend=None), fixed=trial.fixed, trend='restricted'))
