# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What the doubt whether a random walk goes on for ever leaves of the slow coefficients.

A record sees a walk over the slowest decade or less of its spectrum. The rise there may be that of
a first-order Gauss-Markov process as well, which has not levelled off yet, or has just begun to,
long before it could be named: taken for a walk it is too small, by several errors. A walk is the
process of an infinite correlation time, so the time is a parameter like any other, and the
interval of a coefficient is that beside all times that the record does not rule out. What levels
off stands in for flicker, too.

References
----------
D. R. Cox and D. V. Hinkley, "Theoretical Statistics", 1974, ch. 9: likelihood ratios where other
parameters are not known.

"""

from dataclasses import dataclass, replace

from imu_allan.noise.correlated import longest_correlation, with_process_column
from imu_allan.noise.groups import FLICKER, WALK
from imu_allan.noise.intervals import CI95, crossing, Estimate, estimate, spread
from imu_allan.noise.likelihood import maximise
from imu_allan.noise.trial import OBSERVABLE, Trial
from imu_allan.noise.walk_in_parts import either
import numpy as np

_HALVINGS = 10
"""Of the longest correlation time: the shortest are ruled out wherever a walk is observable."""


@dataclass(frozen=True)
class DoubtOfWalk:
    """
    What a random walk would be if it levelled off, and what that leaves of the flicker.

    Attributes
    ----------
    walk : Estimate
        Its upper end is the highest of all correlation times: a process of standard deviation
        sigma and correlation time T is over less than T a walk of ``sigma sqrt(2 / T)``.
    is_likelier : bool
        Whether one of them is as much likelier than the walk as a term that is observable.
    least_flicker : Trial or None
        A process in the place of the walk, of those not ruled out the one that leaves least of
        the flicker; None where there is none.

    """

    walk: Estimate
    is_likelier: bool = False
    least_flicker: Trial | None = None

    def of_flicker(self, plain: Estimate, widening: float = 1.0) -> Estimate:
        """Widen the interval of flicker by what such a process would leave of it."""
        if self.least_flicker is None:
            return plain
        return either(plain, estimate(self.least_flicker, FLICKER, widening))


def doubt_of_walk(trial: Trial, dt: float, plain: Estimate, widening: float = 1.0) -> DoubtOfWalk:
    """
    Ask what a random walk would be if it levelled off.

    Parameters
    ----------
    trial : Trial
        Whose terms and band are those of the fit.
    dt : float
        Sample interval in seconds.
    plain : Estimate
        Of the walk in it.
    widening : float, optional
        As for `estimate`.

    Returns
    -------
    DoubtOfWalk

    """
    if not plain.observable:
        return DoubtOfWalk(plain)
    dispersion = trial.dispersion * widening
    level = CI95 * dispersion / 2
    tried, best = [trial], trial.solution.loss
    time = longest_correlation(trial.groups)
    for _ in range(_HALVINGS):
        # The longest itself is as good as a walk.
        time /= 2
        one = _levelling_off(trial, tried[-1], dt, time)
        if one.solution.loss > best + level:
            break
        tried.append(one)
        best = min(best, one.solution.loss)

    def guessed(one: Trial) -> float:
        left = max(best + level - one.solution.loss, 0.0)
        error = spread(one, one.solution, WALK) * float(np.sqrt(2 * left / one.dispersion))
        return float(np.sqrt(one.solution.theta[WALK])) + error

    is_likelier = trial.solution.loss >= best + OBSERVABLE * dispersion / 2
    least = min(tried[1:], key=lambda one: float(one.solution.theta[FLICKER]), default=None)
    highest = max(tried, key=guessed)
    if highest is trial:
        return DoubtOfWalk(plain, is_likelier, least)
    start = highest.solution

    def rise(coefficient: float) -> float:
        held = maximise(highest.groups, start, fixed={**trial.fixed, WALK: coefficient**2},
                        trend='restricted', tolerance=1e-3)
        return 2 * (held.loss - best) / dispersion

    value, guess = float(np.sqrt(start.theta[WALK])), guessed(highest)
    upper = max(plain.high, crossing(rise, value, (guess - value) / float(np.sqrt(CI95)), CI95))
    return DoubtOfWalk(replace(plain, high=upper, upper=upper), is_likelier, least)


def _levelling_off(trial: Trial, start: Trial, dt: float, time: float) -> Trial:
    """Fit a process in the place of the walk, in units of the walk that it begins as."""
    process = with_process_column(trial.groups, trial.rolling, dt, time).design[:, -1]
    design = trial.groups.design.copy()
    design[:, WALK] = process * time / 2
    groups = trial.groups.with_design(design)
    return replace(trial, groups=groups, solution=maximise(
        groups, start.solution, fixed=trial.fixed, trend='restricted', tolerance=1e-3))
