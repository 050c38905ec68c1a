# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Regression of spectral coefficients on the regressors of the mean, and the residual power.

The coefficients c are regressed on X with the weights W = n / lambda: A = X'WX, b = X'Wc. The log
likelihood gains b'A^-1 b / 2, and the restricted likelihood subtracts (1/2) ln det A. The residual
power is (c - X A^-1 b)^2 + x'A^-1 x; the last term is the uncertainty of the trend. If there are
several records, each has its own regressors.

References
----------
H. D. Patterson and R. Thompson, Biometrika 58 (1971): restricted likelihood.

"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from imu_allan.arrays import Array
from imu_allan.noise.record.groups import Groups, LEAST_OF_BLOCKS, padded
import numpy as np

RIDGE = 1e-10
"""Relative ridge: far above rounding, far below the residual of any two different regressors."""


def regressors(groups: Sequence[Groups]) -> Array:
    """Return products with the regressors of each record, shape (spectra, products, groups)."""
    found = []
    for one in padded(groups):
        among = one.among.reshape(*one.along.shape[:2], -1)
        found.append(np.concatenate((one.along, among), axis=2).reshape(len(one.dof), -1).T)
    return np.stack(found)


def mean(products: Array, records: int, weight: Array) -> tuple[Array, Array, Array]:
    """
    Regress on the regressors of the mean with weights of shape (rows, groups).

    Returns
    -------
    gain : ndarray, shape (rows,)
        Gain of the restricted log likelihood.
    size : ndarray, shape (rows, records, regressors)
    covariance : ndarray, shape (rows, records, regressors, regressors)

    """
    found = weight @ products[0].T if len(products) == 1 else np.matmul(
        products, weight[:, :, None])
    found = found.reshape(len(weight), records, -1)
    count = int(np.sqrt(found.shape[2]))
    if count == 1:
        target, gram = found[:, :, :1], found[:, :, 1:]
        single = np.where(gram > 0, gram, 1.0)
        gain = 0.5 * (target * (target / single) - np.log(single)).sum(axis=(1, 2))
        return gain, target / single, (1 / single)[..., None]
    # One contiguous array per element of the matrix [[A, b], [b', 0]].
    found = np.ascontiguousarray(found.transpose(2, 0, 1))
    table = np.zeros((count + 1, count + 1, *found.shape[1:]))
    table[:count, :count] = found[count:].reshape(count, count, *found.shape[1:])
    table[:count, count] = table[count, :count] = found[:count]
    norm = table[range(count), range(count)]
    # The ridge removes regressors that are zero in all groups, or nothing but rounding error.
    ridge = np.where(norm > 0, RIDGE * norm, 1.0)
    log_det = 0.0
    # Eliminating A leaves A^-1 in its place, A^-1 b beside it, and -b'A^-1 b in the corner.
    for k in range(count):
        if not norm[k].any():
            table[k, k] = 1.0
            continue
        pivot = table[k, k] + ridge[k]
        log_det = log_det + np.log(pivot).sum(axis=1)
        row = table[k] / pivot
        row[k] = 1 / pivot
        column = table[:, k].copy()
        table[:, k] = 0.0
        table -= column[:, None] * row
        table[k] = row
    gain = -0.5 * (table[count, count].sum(axis=1) + log_det)
    return (gain, table[:count, count].transpose(1, 2, 0),
            table[:count, :count].transpose(2, 3, 0, 1))


def residual_power(power: Array, products: Array, size: Array, covariance: Array) -> Array:
    """Return the power about the mean, as expected of the noise alone, shape (rows, groups)."""
    second = size[..., :, None] * size[..., None, :] + covariance
    factors = np.concatenate((-2 * size, second.reshape(*size.shape[:2], -1)), axis=2)
    factors = factors.reshape(len(size), 1, -1)
    about = power + (factors[:, 0] @ products[0] if len(products) == 1 else np.matmul(
        factors, products)[:, 0])
    return np.asarray(np.maximum(about, 1e-12 * power))


class AboutMean(NamedTuple):
    """Spectrum without the mean and its trends."""

    blocks: Array    # (groups,): power without the ramp in blocks, which have no signed values
    noise: Array    # (groups,): power without the mean, as expected of the noise alone
    ramp: Array    # (records,): slope per second


def about_mean(groups: Groups) -> Callable[[Array], AboutMean]:
    """Return a function that removes the mean from a spectrum, given the expected noise power."""
    products = regressors([groups])

    def about(expected: Array) -> AboutMean:
        _, size, covariance = mean(products, groups.records, (groups.dof / expected)[None])
        ramp = size[0, :, 0]
        blocks = np.maximum(groups.power + np.minimum(groups.ramp, 0.0) @ ramp**2,
                            LEAST_OF_BLOCKS * groups.power)
        return AboutMean(blocks, residual_power(blocks, products, size, covariance)[0], ramp)

    return about
