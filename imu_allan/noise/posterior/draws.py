# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Weighted draws around the maxima of models, which also refine their evidence.

References
----------
D. J. C. MacKay, Information Theory, Inference, and Learning Algorithms, ch. 29: importance
sampling.

"""

from dataclasses import dataclass, replace
from functools import lru_cache

from imu_allan.arrays import Array, Ints
from imu_allan.noise.posterior.likelihood import losses_and_means, Rows, Spectra
import numpy as np
from scipy.special import chdtri, gammaln, ndtri

_TAILS = 6.0
"""Degrees of freedom of the multivariate t distribution that draws are taken from."""
_FEWEST_DRAWS = 10.0
"""Effective sample size below which a few draws dominate: their weights are raised to a power
below 1, and the evidence remains that of Laplace."""


@dataclass(frozen=True)
class Draws:
    """
    Draws around the maximum of one model.

    Attributes
    ----------
    x : ndarray, shape (draws, SLOTS)
    share : ndarray, shape (draws,)
        Weights, which add up to 1.
    evidence : float
        Logarithm of the evidence of the model.
    size, error : ndarray, shape (draws, regressors)
        Sizes and standard errors of the regressors of the mean.

    """

    x: Array
    share: Array
    evidence: float
    size: Array
    error: Array


def sample(spectra: Spectra, rows: Rows, counts: Ints) -> list[Draws]:
    """Draw `counts` times from each row by importance sampling, with fixed quasi-random points."""
    # Draw from a distribution that is wider than the Laplace approximation by this factor.
    wider = 1.15
    root = np.linalg.cholesky(np.linalg.inv(rows.hessian))
    half_log_det = 0.5 * np.linalg.slogdet(rows.hessian)[1]
    many = replace(rows, hessian=rows.x[:, :0]).take(np.repeat(np.arange(len(rows)), counts))
    parts = [slice(end - count, end)
             for end, count in zip(np.cumsum(counts).tolist(), counts.tolist(), strict=True)]
    log_t = np.empty(len(many))
    for number, part in enumerate(parts):
        free = np.flatnonzero(rows.present[number])
        d = len(free)
        normal, chi_square = _points(part.stop - part.start, d)
        scale = np.sqrt(_TAILS / chi_square)
        steps = normal @ root[number][np.ix_(free, free)].T
        many.x[part, free] += wider * scale[:, None] * steps
        log_t[part] = (
            gammaln((_TAILS + d) / 2) - gammaln(_TAILS / 2) - 0.5 * d * np.log(_TAILS * np.pi)
            - d * np.log(wider) + half_log_det[number]
            - 0.5 * (_TAILS + d) * np.log1p((normal**2).sum(axis=1) * scale**2 / _TAILS))
    loss, sizes, errors = losses_and_means(spectra, many, many.x)
    drawn = []
    for number, part in enumerate(parts):
        log_ratio = -log_t[part] - loss[part]
        # Within the limit, powers of the weights become equal soon.
        log_weight = np.maximum(log_ratio - log_ratio.max(), -600.0)
        weight = np.exp(log_weight)
        evidence = float(rows.prior[number] + log_ratio.max() + np.log(weight.mean()))
        while weight.sum()**2 < _FEWEST_DRAWS * float(weight @ weight):
            log_weight, evidence = 0.8 * log_weight, float(rows.evidence[number])
            weight = np.exp(log_weight)
        drawn.append(Draws(many.x[part], weight / weight.sum(), evidence, sizes[part],
                           errors[part]))
    return drawn


@lru_cache(maxsize=64)
def _points(count: int, dimensions: int) -> tuple[Array, Array]:
    """Return quasi-random normal numbers, and the chi-square numbers that scale them to t."""
    uniform = evenly(count, dimensions + 1)
    return (np.asarray(ndtri(uniform[:, :-1]), np.float64),
            np.asarray(chdtri(_TAILS, 1 - uniform[:, -1]), np.float64))


def evenly(count: int, dimensions: int) -> Array:
    """
    Return quasi-random points in the unit cube, shape (count, dimensions).

    Coordinates are multiples of inverse powers of the root of x^(d + 1) = x + 1, modulo 1.

    References
    ----------
    H. Niederreiter, Random Number Generation and Quasi-Monte Carlo Methods, 1992: Kronecker
    sequences.

    """
    root = 2.0
    for _ in range(60):
        root = (1 + root) ** (1 / (dimensions + 1))
    step = root ** -np.arange(1.0, dimensions + 1)
    return np.clip((0.5 + np.arange(1, count + 1)[:, None] * step) % 1, 1e-6, 1 - 1e-6)
