# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
When a coefficient is certain to lie below or above a limit: Wald's sequential test.

Two tests run side by side on the growing record, each the ratio of two likelihoods. One holds the
limit L against L / m, the other L against L m and L m^2 together, m being a margin. The record has
passed once it is 1 / beta times as likely under L / m as under L, and failed once it is 1 / alpha
times as likely in the mean of the two values above. At the limit itself the first happens with a
probability of at most beta and the second of at most alpha, however often one looks (Ville's
inequality), and away from it in the wrong direction less often still. Once L is the likelier
beside L / m and beside L m, the coefficient lies too near to the limit for either word within the
margin, and waiting longer would not help soon. A limit that is exceeded by octaves is also held
against the octave below the estimate.

The other coefficients are fitted anew under each value, so that the bounds hold as nearly as those
of a profile likelihood do; the Monte Carlo in docs/statistics.md says how nearly. Beside the noise
density so is the exponent of the slow noise: where it is not flicker's, white noise stands in for
the difference.

References
----------
A. Wald, "Sequential Analysis", 1947. M. Sobel and A. Wald, Ann. Math. Statist. 20 (1949): three
decisions.

"""

from collections.abc import Callable
from functools import cache
from math import floor, log, log2, sqrt
from typing import Literal

from imu_allan.noise.chi_square import NORMAL95
from imu_allan.noise.intervals import log_ratio
from imu_allan.noise.likelihood import maximise
from imu_allan.noise.minimum import lowest_near
from imu_allan.noise.power_law import TRIED, with_exponent
from imu_allan.noise.trial import Trial
from numpy import argmin, logaddexp

Decision = Literal['below', 'above', 'near', 'open']
_Ratio = Callable[[float, float], float]
"""Logarithm of how much likelier the first of two values makes the data than the second."""

_FAR = 0.1
"""Share of the error that goes to limits exceeded by octaves: plain cases, which need little."""
SMALLEST_RECORD = 1024
"""Samples before the first look: of fewer the slow terms are not told from the white noise."""


def decide(trial: Trial, column: int, limit: float, *, margin: float, pass_error: float,
           fail_error: float, dt: float | None = None) -> Decision:
    """
    Hold one coefficient against its limit.

    Parameters
    ----------
    trial : Trial
        The record so far.
    column : int
        Which coefficient.
    limit : float
        Above zero.
    margin : float
        Relative distance from the limit at which the tests look, and twice it above; half makes
        the record
        about four times as long.
    pass_error : float
        Probability of passing at the limit, or above, at most.
    fail_error : float
        Probability of failing at the limit, or below, at most.
    dt : float, optional
        Sample interval in seconds. With it no side of the limit is decided on but what holds
        whatever the exponent of the slow noise is.

    Returns
    -------
    'below', 'above', 'near' or 'open'
        The last as long as the record decides nothing.

    References
    ----------
    Equation (7) of docs/statistics.md, for each of the values. Wald, 1947: the bounds 1/error.

    Examples
    --------
    >>> from imu_allan.noise.axis_fit import fit_axes
    >>> from imu_allan.noise.estimator import Estimator
    >>> from imu_allan.noise.simulate import simulate
    >>> estimator = Estimator()
    >>> estimator.update(simulate({'noise_density': 1e-3}, 2_000, 100.0))
    >>> [axis] = fit_axes(estimator.finished(), 0.01)
    >>> [decide(axis.fit.trial, 1, limit, margin=0.1, pass_error=0.05, fail_error=0.05)
    ...  for limit in (1.3e-3, 0.7e-3)]
    ['below', 'above']

    """
    value = float(sqrt(trial.solution.theta[column]))

    def decided(ratio: _Ratio) -> Decision:
        below = ratio(limit / (1 + margin), limit)
        if below >= -log(pass_error):
            return 'below'
        above, beyond = (ratio(limit * (1 + margin)**steps, limit) for steps in (1, 2))
        # The mean of two likelihoods is as good an alternative: near the margin the first speaks,
        # further off the second, which the data tells from the limit much sooner.
        if (logaddexp(above, beyond) - log(2) >= -log(fail_error * (1 - _FAR))
                or _is_far(ratio, value, limit, fail_error)):
            return 'above'
        near = below <= log(pass_error) and above <= log(fail_error)
        return 'near' if near else 'open'

    decision = decided(lambda one, other: log_ratio(trial, column, one, other))
    if dt is None or decision not in ('below', 'above'):
        return decision
    beside = decided(_of_any_exponent(trial, column, dt))
    return beside if beside in (decision, 'near') else 'open'


def borne_out(decision: Decision, limit: float, value: float, interval: tuple[float, float],
              error: float) -> Decision:
    """
    Leave open what the interval of a coefficient does not bear out.

    The interval holds doubt that the test does not know: what a bend at the edge of the band or
    noise that changes may do to the noise density.

    Parameters
    ----------
    decision : 'below', 'above', 'near' or 'open'
        Of the test.
    limit : float
        That it is about.
    value : float
        Of the coefficient.
    interval : (float, float)
        At 95 %. It is stretched to where the test would find the ratio of 1 / error.
    error : float
        Of the test.

    Returns
    -------
    'below', 'above', 'near' or 'open'

    Examples
    --------
    >>> [borne_out('above', 1.0, 1.2, (low, 1.4), 0.05) for low in (0.9, 1.01, 1.1)]
    ['open', 'open', 'above']

    """
    low, high = interval
    stretch = sqrt(-2 * log(error)) / NORMAL95
    denied = ((decision == 'below' and value + stretch * (high - value) > limit)
              or (decision == 'above' and value - stretch * (value - low) < limit))
    return 'open' if denied else decision


def _of_any_exponent(trial: Trial, column: int, dt: float) -> _Ratio:
    """Compare values of a coefficient where the exponent of the slow noise is fitted anew, too."""
    near = trial.solution

    @cache
    def least(value: float) -> float:
        def loss(exponent: float) -> float:
            nonlocal near
            near = maximise(with_exponent(trial.groups, dt, exponent), near,
                            fixed={**trial.fixed, column: value**2}, trend='restricted',
                            tolerance=1e-3)
            return near.loss

        losses = [loss(exponent) for exponent in TRIED]
        return min(*losses, lowest_near(loss, TRIED, int(argmin(losses)), 1e-2)[1])

    return lambda one, other: (least(other) - least(one)) / trial.dispersion


def _is_far(ratio: _Ratio, value: float, limit: float, fail_error: float) -> bool:
    """
    Hold the limit against the power of two times it that is nearest below the estimate.

    Far above the limit neither it nor a value within the margin describes the record, because the
    other coefficients stand in for what is missing. Each octave has its share of the error.
    """
    octave = floor(log2(max(value / limit, 1.0)))
    if octave == 0:
        return False
    share = _FAR / 2**octave
    return ratio(limit * 2**octave, limit) >= -log(fail_error * share)
