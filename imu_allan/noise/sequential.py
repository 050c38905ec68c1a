# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Wald's sequential test of whether a coefficient lies below or above a limit.

Two likelihood ratio tests run in parallel on the growing record. One compares the limit L with
L / m, the other L with L m and L m^2 together, where m is a margin. The record passes when it is
1 / beta times as likely under L / m as under L. It fails when the mean likelihood of the two upper
values is 1 / alpha times that of L. At the limit itself, the probability of passing is at most
beta, and that of failing at most alpha, however often one looks (Ville's inequality). On the wrong
side of the limit they are smaller still. If L is likelier by these factors than both L / m and
L m, the coefficient is within the margin of the limit. Waiting longer would not help soon.

The likelihood of a value is that of the posterior draws. It is normal in the logarithm of a
reported coefficient, and in the square of one with only a bound. So it includes the uncertainty
of the model, such as a filter or an exponent.

References
----------
A. Wald, "Sequential Analysis", 1947. M. Sobel and A. Wald, Ann. Math. Statist. 20 (1949): three
decisions.

"""

from math import log
from typing import Literal

from imu_allan.noise.chi_square import NORMAL95
from imu_allan.noise.posterior.estimates import Estimate
from numpy import logaddexp

Decision = Literal['below', 'above', 'near', 'open']

SMALLEST_RECORD = 1024
"""Samples before the first test: with fewer, slow terms look like white noise."""


def decide(estimate: Estimate, limit: float, *, margin: float, pass_error: float,
           fail_error: float) -> Decision:
    """
    Test one coefficient against its limit.

    Parameters
    ----------
    estimate : Estimate
        Estimate from the record so far.
    limit : float
        Limit of the coefficient, above zero.
    margin : float
        Relative distance of the alternatives from the limit; above it, also twice this distance.
        Half the margin takes a record about four times as long.
    pass_error : float
        Largest probability of passing at or above the limit.
    fail_error : float
        Largest probability of failing at or below the limit.

    Returns
    -------
    'below', 'above', 'near' or 'open'
        'open' as long as the record decides nothing.

    References
    ----------
    Equation (7) of docs/statistics.md, which the draws are from. Wald, 1947: the bounds 1/error.

    Examples
    --------
    >>> found = Estimate(True, 1.0, 0.95, 1.05, 1.05)
    >>> [decide(found, limit, margin=0.1, pass_error=0.05, fail_error=0.05)
    ...  for limit in (1.3, 0.7, 1.05, 1.0)]
    ['below', 'above', 'open', 'near']

    """
    at = _log_likelihood(estimate, limit)
    below = _log_likelihood(estimate, limit / (1 + margin)) - at
    above, beyond = (_log_likelihood(estimate, limit * (1 + margin)**steps) - at
                     for steps in (1, 2))
    if below >= -log(pass_error):
        return 'below'
    # The mean of two likelihoods is a valid alternative. The first decides near the margin; far
    # above it the second does, much sooner.
    if estimate.observable and logaddexp(above, beyond) - log(2) >= -log(fail_error):
        return 'above'
    return 'near' if below <= log(pass_error) and above <= log(fail_error) else 'open'


def _log_likelihood(estimate: Estimate, value: float) -> float:
    """Return the log likelihood of a value of a coefficient, up to a constant."""
    if not estimate.observable:
        return -((value / estimate.upper)**2 * NORMAL95)**2 / 2
    far = log(value / estimate.value)
    end = estimate.high if far > 0 else estimate.low
    return -(far / log(end / estimate.value) * NORMAL95)**2 / 2
