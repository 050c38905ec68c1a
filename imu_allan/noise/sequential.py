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
margin, and waiting longer would not help soon.

The likelihood of a value is that of the posterior's draws: of the logarithm of the coefficient
where it is reported, of its square where there is a bound. What the models leave open, a filter or
an exponent, is in it.

References
----------
A. Wald, "Sequential Analysis", 1947. M. Sobel and A. Wald, Ann. Math. Statist. 20 (1949): three
decisions.

"""

from math import log
from typing import Literal

from imu_allan.noise.chi_square import NORMAL95
from imu_allan.noise.posterior.answer import Estimate
from numpy import logaddexp

Decision = Literal['below', 'above', 'near', 'open']

SMALLEST_RECORD = 1024
"""Samples before the first look: fewer do not distinguish slow terms from white noise."""


def decide(estimate: Estimate, limit: float, *, margin: float, pass_error: float,
           fail_error: float) -> Decision:
    """
    Hold one coefficient against its limit.

    Parameters
    ----------
    estimate : Estimate
        Of the record so far.
    limit : float
        Above zero.
    margin : float
        Relative distance from the limit at which the tests look, and twice it above; half makes
        the record about four times as long.
    pass_error : float
        Probability of passing at the limit, or above, at most.
    fail_error : float
        Probability of failing at the limit, or below, at most.

    Returns
    -------
    'below', 'above', 'near' or 'open'
        The last as long as the record decides nothing.

    References
    ----------
    Equation (7) of docs/statistics.md, of which the draws are. Wald, 1947: the bounds 1/error.

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
    # The mean of two likelihoods is as good an alternative: near the margin the first speaks,
    # further off the second, which the data distinguishes from the limit much sooner.
    if estimate.observable and logaddexp(above, beyond) - log(2) >= -log(fail_error):
        return 'above'
    return 'near' if below <= log(pass_error) and above <= log(fail_error) else 'open'


def _log_likelihood(estimate: Estimate, value: float) -> float:
    """Logarithm of the likelihood of a value of a coefficient, up to a constant."""
    if not estimate.observable:
        return -((value / estimate.upper)**2 * NORMAL95)**2 / 2
    far = log(value / estimate.value)
    end = estimate.high if far > 0 else estimate.low
    return -(far / log(end / estimate.value) * NORMAL95)**2 / 2
