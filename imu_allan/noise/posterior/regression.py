# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What regressors explain of a spectrum, and the power that is left about them.

With the noise's weights W = n / lambda the coefficients c are regressed on X: A = X'WX, b = X'Wc.
The likelihood gains b'A^-1 b / 2, the restricted one loses (1/2) ln det A of that again, and what
is left of the power is (c - X A^-1 b)^2 + x'A^-1 x, the last for the uncertainty of the trend.
Several records have regressors of their own.

References
----------
H. D. Patterson and R. Thompson, Biometrika 58 (1971): restricted likelihood.

"""

from math import log
from typing import NamedTuple

from imu_allan.noise.record.groups import Groups, LEAST_OF_BLOCKS
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RIDGE = 1e-10
"""Relative; far above rounding and far below what any two different regressors leave."""


class Explained(NamedTuple):
    """What the regressors explain: fall of the loss, their coefficients, and the covariance."""

    gain: float
    trend: Array
    covariance: Array


NOTHING = Explained(0.0, np.zeros(0), np.zeros((0, 0)))
"""Where the mean is known."""


def explained_by_regressors(groups: Groups, weight: Array, restricted: bool) -> Explained:
    """
    Regress the coefficients of a spectrum on the regressors of its groups.

    Parameters
    ----------
    groups : Groups
        With regressors, `n` of them.
    weight : ndarray, shape (groups,)
        Degrees of freedom over the variance of the noise.
    restricted : bool
        Whether the gain is that of the restricted likelihood.

    Returns
    -------
    Explained
        Trend of shape (n,), or (records, n) for several records.

    """
    assert groups.along is not None
    assert groups.among is not None
    if groups.record is not None:
        return _in_each_record(groups, weight, restricted)
    if groups.along.shape[1] == 1:
        # The ramp alone: nearly every fit, and plain numbers are several times faster.
        single = max(float(weight @ groups.among[:, 0, 0]), 1e-300)
        along = float(weight @ groups.along[:, 0])
        return Explained(0.5 * (along**2 / single - restricted * log(single)),
                         np.array([along / single]), np.array([[1 / single]]))
    target = weight @ groups.along
    gram = np.tensordot(weight, groups.among, 1)
    scale = np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
    # The ridge is for a regressor that no coefficient sees, or that repeats another.
    lower = np.linalg.cholesky(gram / np.outer(scale, scale) + RIDGE * np.eye(len(scale)))
    half = np.linalg.inv(lower) / scale
    covariance = half.T @ half
    trend = covariance @ target
    gain = 0.5 * float(target @ trend)
    if restricted:
        gain -= float(np.log(np.diagonal(lower) * scale).sum())
    return Explained(gain, trend, covariance)


def _in_each_record(groups: Groups, weight: Array, restricted: bool) -> Explained:
    """Regress the coefficients of every record on its own regressors, and add up the gains."""
    assert groups.along is not None
    assert groups.among is not None
    assert groups.record is not None
    own = np.where(groups.record == np.arange(groups.records)[:, None], weight, 0.0)
    target = own @ groups.along
    gram = np.tensordot(own, groups.among, 1)
    norm = np.diagonal(gram, axis1=1, axis2=2)
    # Of a record with fewer regressors some are nothing.
    scale = np.sqrt(np.where(norm > 0, norm, 1.0))
    lower = np.linalg.cholesky(gram / (scale[:, :, None] * scale[:, None])
                               + RIDGE * np.eye(gram.shape[1]))
    half = np.linalg.inv(lower) / scale[:, None]
    covariance = np.swapaxes(half, 1, 2) @ half
    trend = np.einsum('rab,rb->ra', covariance, target)
    gain = 0.5 * float(np.vdot(target, trend))
    if restricted:
        gain -= float(np.log(np.diagonal(lower, axis1=1, axis2=2) * scale).sum())
    return Explained(gain, trend, covariance)


def slope_of(groups: Groups, trend: Array) -> float | Array:
    """Return the ramp, the first regressor, of a trend: for each group where records differ."""
    return float(trend[0]) if groups.record is None else trend[groups.record, 0]


def about_blocks(groups: Groups, slope: float | Array) -> Array:
    """
    Take the ramp out of the blocks, which know no sign, and leave it in the coefficients.

    Parameters
    ----------
    groups : Groups
        Of one axis.
    slope : float or ndarray, shape (groups,)
        Of the ramp, per second.

    Returns
    -------
    ndarray, shape (groups,)

    """
    if isinstance(slope, float) and slope == 0:
        return groups.power
    return np.asarray(np.maximum(groups.power + slope**2 * np.minimum(groups.ramp, 0.0),
                                 LEAST_OF_BLOCKS * groups.power))


def about_trend(groups: Groups, power: Array, explained: Explained) -> Array:
    """
    Take the trend out of the power, and give back what its uncertainty has taken away.

    Parameters
    ----------
    groups : Groups
        Of one axis, with regressors.
    power : ndarray, shape (groups,)
        As `about_blocks` leaves it.
    explained : Explained
        By the regressors.

    Returns
    -------
    ndarray, shape (groups,)
        As expected of the noise alone.

    """
    assert groups.along is not None
    assert groups.among is not None
    trend = explained.trend
    if groups.record is not None:
        each = trend[groups.record]
        spread = (trend[:, :, None] * trend[:, None] + explained.covariance)[groups.record]
        about = power - 2 * np.einsum('ga,ga->g', groups.along, each) \
            + np.einsum('gab,gab->g', groups.among, spread)
        return np.asarray(np.maximum(about, 1e-12 * power))
    if len(trend) == 1:
        slope, variance = float(trend[0]), float(explained.covariance[0, 0])
        about = power - 2 * slope * groups.along[:, 0] + (slope**2 + variance) \
            * groups.among[:, 0, 0]
        return np.asarray(np.maximum(about, 1e-12 * power))
    moments = np.outer(trend, trend) + explained.covariance
    about = power - 2 * groups.along @ trend + np.tensordot(groups.among, moments, 2)
    return np.asarray(np.maximum(about, 1e-12 * power))
