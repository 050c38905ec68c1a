# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The Allan deviation curve and its confidence intervals.

The equivalent degrees of freedom of each point are those of the fitted sum of terms, not of one
dominant noise type. Mean and variance of the estimator follow from the covariance of its second
differences, for which the generalised covariance of phase gives a closed form.

References
----------
C. A. Greenhall, "Recipes for degrees of freedom of frequency stability estimators", IEEE Trans.
Instrum. Meas. 40 (1991). W. J. Riley, "Handbook of Frequency Stability Analysis", NIST SP 1065.

"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import gcd

from imu_allan.arrays import Array, Ints
from imu_allan.noise import chi_square
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.record.pyramid import OVERLAP
from imu_allan.noise.terms import power_law_avar, SPECTRAL_TERMS
from imu_allan.result import PowerLaw
import numpy as np
from numpy.typing import ArrayLike

_FOURTH = ((-2, 1), (-1, -4), (0, 6), (1, -4), (2, 1))
"""Shifts, in clusters, and weights of the fourth difference."""


@dataclass(frozen=True)
class Octaves:
    """Allan variance of one or more axes at octave cluster sizes."""

    size: Ints    # (octaves,): samples in a cluster
    # (octaves,): samples between the second differences that were averaged
    stride: Ints
    count: Ints    # (octaves,): number of differences averaged
    avar: Array    # (octaves, axes): in the squared unit of a sample


def octaves(estimator: Estimator) -> Octaves:
    """
    Compute the Allan variance of a finished estimator: equation (4) of docs/statistics.md.

    Parameters
    ----------
    estimator : Estimator
        Estimator as returned by `Estimator.finished`.

    Returns
    -------
    Octaves
        Long clusters are computed from the whole-record series if that gives more overlap than
        the pyramid.

    References
    ----------
    W. J. Riley, NIST SP 1065, 2008, eq. 11: the overlapping estimate, of frequency from phase.

    Examples
    --------
    A ramp of 1 per sample: R^2 tau^2 / 2, exactly.

    >>> estimator = Estimator()
    >>> estimator.update(np.arange(64.0))
    >>> octaves(estimator.finished()).avar[:4, 0]
    array([ 0.5,  2. ,  8. , 32. ])

    """
    pyramid, periodogram = estimator.pyramid, estimator.periodogram
    cell = periodogram.cell
    rows = []
    for octave, count in enumerate(pyramid.counts):
        size = 2**octave
        stride, sums = max(1, size // OVERLAP), pyramid.sums[octave]
        if size // cell > OVERLAP:
            found, of_series = _series_differences(estimator, size // cell)
            if found:
                stride, count, sums = cell, found, of_series
        if count:
            rows.append((size, stride, int(count), sums / (2.0 * count * size**2)))
    sizes, strides, counts = np.array([row[:3] for row in rows], np.int64).reshape(-1, 3).T
    return Octaves(sizes, strides, counts,
                   np.array([row[3] for row in rows]).reshape(-1, estimator.axes))


def _series_differences(estimator: Estimator, m: int) -> tuple[int, Array]:
    """Return number and sums of squares of second differences over `m` cells of the series."""
    cell, series = estimator.periodogram.cell, estimator.periodogram.series
    part = series.take(series.counts == cell)
    if len(part) < 2 * m:
        return 0, np.zeros(estimator.axes)
    phase = np.pad(np.cumsum(part.sums, axis=1), ((0, 0), (1, 0)))
    # A difference is valid if its 2 m cells are consecutive, which those of two runs never are.
    good = part.keys[2 * m - 1:] - part.keys[:len(part) - 2 * m + 1] == 2 * m - 1
    d = (phase[:, 2 * m:] - 2 * phase[:, m:-m] + phase[:, :-2 * m])[:, good]
    return d.shape[1], np.einsum('ij,ij->i', d, d)


def joined_octaves(records: Sequence[Octaves]) -> Octaves:
    """Return the Allan variance over several records, without differences across their seams."""
    sizes = np.unique(np.concatenate([one.size for one in records]))
    strides, counts, avars = [], [], []
    for size in sizes:
        known = [(one, at) for one in records for at in np.flatnonzero(one.size == size)]
        span = np.array([int(one.count[at] * one.stride[at]) for one, at in known])
        strides.append(max(int(one.stride[at]) for one, at in known))
        counts.append(max(int(span.sum()) // strides[-1], 1))
        avars.append(np.average([one.avar[at] for one, at in known], axis=0, weights=span))
    return Octaves(sizes, np.array(strides, np.int64), np.array(counts, np.int64),
                   np.array(avars).reshape(len(sizes), -1))


def edf(coefficients: Mapping[str, float], size: int, stride: int, count: int,
        dt: float, power_law: PowerLaw | None = None) -> float:
    """
    Equivalent degrees of freedom of an Allan variance: equation (5) of docs/statistics.md.

    `coefficients`: SI coefficient by key of `TERMS`; a missing key means zero. A ramp is
    deterministic and ignored. `size`: samples in a cluster. `stride`: samples between second
    differences. `count`: number of second differences averaged. `dt`: sample interval in seconds.
    `power_law`: slow noise with another exponent than flicker. Returns: ``2 v^2 / var(v)`` for the
    sum of the terms.

    Examples
    --------
    White noise, 1000 samples, clusters of 1 and of 128 samples:

    >>> [round(edf({'noise_density': 1.0}, m, 1, 1001 - 2 * m, 1.0), 1) for m in (1, 128)]
    [666.2, 9.6]

    """
    tau = size * dt
    scales = np.array([1.0, tau, tau**2, tau**3])
    squares = np.array([coefficients.get(key, 0.0) or 0.0 for key in SPECTRAL_TERMS]) ** 2 * scales
    if not squares.any() and power_law is None:
        squares[1] = 1.0
    # Differences more than 64 clusters apart count as uncorrelated, to save time.
    lags = min(count, int(64 * size / stride))
    # A growing record needs more lags in every fit; powers of two need only a few cached tables.
    shared = gcd(size, stride)
    table = _difference_covariance(size // shared, stride // shared, 1 << (lags - 1).bit_length())
    r = squares @ table[:, :lags]
    if power_law is not None:
        own = _power_law_covariance(np.arange(lags, dtype=np.float64) * stride / size,
                                    power_law.exponent)
        # The variance of a difference is 2 tau^2 times the Allan variance.
        own *= 2 * tau**2 * power_law_avar(power_law.amplitude, power_law.exponent, tau) / own[0]
        r = r + own
    weight = (count - np.arange(lags)) * 2.0
    weight[0] = count
    return float(count**2 * r[0] ** 2 / (weight @ r**2))


def _power_law_covariance(lag: Array, exponent: float) -> Array:
    """Covariance of second differences of f^-exponent noise, up to a factor; lags in clusters."""
    def phase(h: Array) -> Array:
        return h**2 * np.log(np.where(h > 0, h, 1)) if exponent == 1 else h**(exponent + 1)

    return np.asarray(sum(weight * phase(np.abs(lag + shift)) for shift, weight in _FOURTH))


@lru_cache(maxsize=32)
def _difference_covariance(size: int, stride: int, lags: int) -> Array:
    """Covariance of second differences at lags 0, stride, ..., by term, for a unit cluster."""
    lag = np.arange(lags, dtype=np.float64) * stride
    total = np.zeros((4, lags))
    for shift, weight in _FOURTH:
        h = np.abs(lag + shift * size) / size
        total[0] += weight * (h == 0)
        total[1] -= weight * h / 2
        total[2] += weight * h**2 * np.log(np.where(h > 0, h, 1)) / (2 * np.pi)
        total[3] += weight * h**3 / 12
    return total


def interval(avar: ArrayLike, dof: ArrayLike, level: float) -> tuple[Array, Array]:
    """
    Chi-square interval of the Allan deviation.

    `avar`, shape (n,): estimated Allan variance. `dof`, shape (n,): equivalent degrees of freedom.
    `level`: probability, such as 0.95. Returns `low`, `high`, shape (n,): bounds of the deviation.
    """
    avar, dof = np.asarray(avar, dtype=np.float64), np.asarray(dof, dtype=np.float64)
    tail = (1 - level) / 2
    return (np.sqrt(avar * dof / chi_square.upper(tail, dof)),
            np.sqrt(avar * dof / chi_square.lower(tail, dof)))
