# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What the doubt about the exponent of flicker leaves of the noise density.

Noise of an exponent near 1, or weak, passes for flicker. White noise then stands in for what
flicker leaves of it, by several of its own errors. The exponent is a parameter like any other:
beside the terms stands the derivative of the spectrum by it, whose size says how far it is off
(Gauss and Newton), and whose error is one of the density, too.

References
----------
D. M. Bates and D. G. Watts, "Nonlinear Regression Analysis and Its Applications", 1988, ch. 2.

"""

from dataclasses import replace
from typing import NamedTuple

from imu_allan.noise.chi_square import NORMAL95
from imu_allan.noise.groups import FLICKER, WHITE
from imu_allan.noise.intervals import Estimate
from imu_allan.noise.likelihood import maximise, residual_power
from imu_allan.noise.power_law import TRIED, with_exponent
from imu_allan.noise.trial import Trial
import numpy as np

_STEPS = 3
"""Most to the exponent: from 1 to 0.7 two are enough."""
_RIDGE = 1e-10
"""Relative; far above rounding and far below what any two different terms leave."""


class _Step(NamedTuple):
    """How far the exponent is off, the density there, and the errors of both."""

    exponent: float
    error: float
    density: float
    density_error: float


def with_doubt_of_flicker(trial: Trial, dt: float, plain: Estimate, widening: float = 1.0
                          ) -> Estimate:
    """
    Widen the interval of the noise density by what another exponent than flicker's makes of it.

    Parameters
    ----------
    trial : Trial
        Whose terms and band are those of the fit.
    dt : float
        Sample interval in seconds.
    plain : Estimate
        Of the density in it.
    widening : float, optional
        As for `estimate`.

    Returns
    -------
    Estimate
        Its interval is the hull of the plain one and of that beside the likeliest exponent, with
        the error that both have together.

    """
    if not plain.observable or trial.solution.theta[FLICKER] <= 0:
        return plain
    exponent, beside = 1.0, trial
    step = _step(beside, dt, exponent)
    for _ in range(_STEPS):
        if abs(step.exponent) < step.error or not step.exponent:
            break
        exponent += step.exponent
        groups = with_exponent(trial.groups, dt, exponent)
        solution = maximise(groups, beside.solution, fixed=trial.fixed, trend='restricted',
                            tolerance=1e-3)
        if min(solution.theta[FLICKER], solution.theta[WHITE]) <= 0:
            break
        beside = replace(trial, groups=groups, solution=solution)
        step = _step(beside, dt, exponent)
    half = NORMAL95 * step.density_error * float(np.sqrt(widening))
    low, high = min(plain.low, step.density - half), max(plain.high, step.density + half)
    return replace(plain, low=max(low, 0.0), high=high, upper=high)


def _step(trial: Trial, dt: float, exponent: float) -> _Step:
    """Regress what the fit leaves on its terms and on the derivative by the exponent, in range."""
    groups, theta = trial.groups, trial.solution.theta
    expected = np.maximum(groups.design @ theta, 1e-300)
    terms = [column for column in range(len(theta))
             if theta[column] > 0 and column not in trial.fixed]
    # Up to a multiple of flicker itself, which is among the terms.
    by_exponent = -np.log(groups.frequency * dt) * groups.design[:, FLICKER] * theta[FLICKER]
    columns = np.column_stack((groups.design[:, terms], by_exponent)) / expected[:, None]
    root = np.sqrt(groups.dof / 2)
    columns = columns * root[:, None]
    size = np.sqrt(np.sum(columns**2, axis=0))
    columns = columns / size
    covariance = np.linalg.inv(columns.T @ columns + _RIDGE * np.eye(len(size)))
    steps = covariance @ (columns.T @ (root * (residual_power(groups, theta) / expected - 1)))
    errors = np.sqrt(np.diagonal(covariance) * trial.dispersion)
    steps, errors = steps / size, errors / size
    white = terms.index(WHITE)
    # At an end of what is tried the exponent is that, and the others are as they are beside it.
    inside = float(np.clip(steps[-1], TRIED[0] - exponent, TRIED[-1] - exponent))
    slope = covariance[white, -1] / covariance[-1, -1] * size[-1] / size[white]
    steps[white] += slope * (inside - steps[-1])
    steps[-1] = inside
    density = float(np.sqrt(max(theta[WHITE] + steps[white], 0.0)))
    return _Step(float(steps[-1]), float(errors[-1]), density,
                 float(errors[white]) / (2 * float(np.sqrt(theta[WHITE]))))
