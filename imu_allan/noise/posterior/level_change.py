# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Change of the white-noise level over a record, as a parameter with a prior.

The levels of the parts are y_i = ln level_i with known errors e_i, and y_i ~ N(mu, e_i^2 + tau^2).
tau has a restricted likelihood and a prior. The level changes slowly from part to part, so the
level of the whole record is less certain than with independent parts.

References
----------
A. Gelman, Bayesian Analysis 1 (2006): priors of a variance between groups.

"""

from dataclasses import dataclass
from functools import lru_cache

from imu_allan.arrays import Array
from imu_allan.noise.posterior import thresholds_and_priors as priors
from imu_allan.noise.posterior.draws import evenly
import numpy as np
from scipy.special import ndtri

_TAUS = np.concatenate(([0.0], np.geomspace(0.003, 1.0, 40)))


@dataclass(frozen=True)
class Change:
    """
    Posterior of the standard deviation between parts of the logarithm of the power.

    Attributes
    ----------
    weight : ndarray
        Posterior probability of each standard deviation on a grid that begins at 0.

    """

    weight: Array

    @property
    def typical(self) -> float:
        """Posterior median of the standard deviation."""
        return float(_TAUS[int(np.searchsorted(np.cumsum(self.weight), 0.5))])

    def factors(self, count: int) -> Array:
        """Return `count` draws of the factor by which an amplitude changes."""
        if self.weight[0] > 1 - 1e-9:
            return np.ones(count)
        uniform = _points(count)
        place = np.searchsorted(np.cumsum(self.weight), uniform[:, 0])
        tau = _TAUS[np.minimum(place, len(_TAUS) - 1)]
        # Parts are correlated because the change is slow: the power varies by 4 tau^2.
        return np.asarray(np.exp(tau * ndtri(uniform[:, 1])))


STEADY = Change(np.where(_TAUS == 0, 1.0, 0.0))


@lru_cache(maxsize=16)
def _points(count: int) -> Array:
    """Return quasi-random pairs, shuffled to be independent of the order of other draws."""
    return evenly(count, 2)[np.random.default_rng(3).permutation(count)]


def change_of(level: Array, error: Array) -> Change:
    """
    Compute the posterior of the change of a level between parts of a record.

    Parameters
    ----------
    level, error : ndarray, shape (parts,)
        At least three. Logarithm of the power in each part, and its standard error.

    Returns
    -------
    Change

    Examples
    --------
    >>> level = np.array([0.0, 0.3, -0.2, 0.4, -0.3, 0.1, 0.0, -0.4])
    >>> 0.15 < change_of(level, np.full(8, 0.01)).typical < 0.4
    True
    >>> change_of(0.01 * level, np.full(8, 0.01)).typical
    0.0

    """
    variance = error**2 + _TAUS[:, None]**2
    known = (1 / variance).sum(axis=1)
    mean = (level / variance).sum(axis=1) / known
    loss = 0.5 * (np.log(variance).sum(axis=1) + np.log(known)
                  + ((level - mean[:, None])**2 / variance).sum(axis=1))
    prior = np.exp(-0.5 * (np.log(_TAUS[1:] / priors.CHANGE_MEDIAN) / priors.CHANGE_SPREAD)**2)
    change = (1 - priors.STEADY_LEVEL) * prior / prior.sum()
    weight = np.append(priors.STEADY_LEVEL, change) * np.exp(loss.min() - loss)
    return Change(weight / weight.sum())
