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


def regress(products: Array, records: int, weight: Array) -> tuple[Array, Array, Array]:
    """
    Regress on the regressors of the mean with weights of shape (rows, groups).

    `products`: as from `regressors`, of a single spectrum or one for each row.

    Returns
    -------
    gain : ndarray, shape (rows,)
        Gain of the restricted log likelihood.
    size : ndarray, shape (rows, records, regressors)
    covariance : ndarray, shape (rows, records, regressors, regressors)

    """
    sums = weight @ products[0].T if len(products) == 1 else np.matmul(
        products, weight[:, :, None])
    sums = sums.reshape(len(weight), records, -1)
    # The n elements of b, then the n^2 elements of A
    count = int(np.sqrt(sums.shape[2]))
    if count == 1:
        target, gram = sums[:, :, :1], sums[:, :, 1:]
        gram = np.where(gram > 0, gram, 1.0)
        size = target / gram
        return 0.5 * (target * size - np.log(gram)).sum(axis=(1, 2)), size, (1 / gram)[..., None]
    # The matrix [[A, b], [b', 0]], with one contiguous array, shape (rows, records), per element
    sums = np.ascontiguousarray(sums.transpose(2, 0, 1))
    matrix = np.zeros((count + 1, count + 1, *sums.shape[1:]))
    matrix[:count, :count] = sums[count:].reshape(count, count, *sums.shape[1:])
    matrix[:count, count] = matrix[count, :count] = sums[:count]
    norm = matrix[range(count), range(count)]
    # The ridge removes regressors that are zero in all groups, or nothing but rounding error.
    ridge = np.where(norm > 0, RIDGE * norm, 1.0)
    log_det = 0.0
    # Sweeping A out leaves A^-1 in its place, A^-1 b beside it, and -b'A^-1 b in the corner.
    for k in range(count):
        if not norm[k].any():
            matrix[k, k] = 1.0
            continue
        pivot = matrix[k, k] + ridge[k]
        log_det = log_det + np.log(pivot).sum(axis=1)
        row = matrix[k] / pivot
        row[k] = 1 / pivot
        column = matrix[:, k].copy()
        matrix[:, k] = 0.0
        matrix -= column[:, None] * row
        matrix[k] = row
    gain = -0.5 * (matrix[count, count].sum(axis=1) + log_det)
    return (gain, matrix[:count, count].transpose(1, 2, 0),
            matrix[:count, :count].transpose(2, 3, 0, 1))


def residual_power(power: Array, products: Array, size: Array, covariance: Array) -> Array:
    """Return the power about the mean, as expected of the noise alone, shape (rows, groups)."""
    second_moment = size[..., :, None] * size[..., None, :] + covariance
    factors = np.concatenate((-2 * size, second_moment.reshape(*size.shape[:2], -1)), axis=2)
    factors = factors.reshape(len(size), 1, -1)
    residual = power + (factors[:, 0] @ products[0] if len(products) == 1 else np.matmul(
        factors, products)[:, 0])
    return np.asarray(np.maximum(residual, 1e-12 * power))


class AboutMean(NamedTuple):
    """Spectrum without the mean and its trends."""

    blocks: Array    # (groups,): power without the ramp in blocks, which have no signed values
    noise: Array    # (groups,): power without the mean, as expected of the noise alone
    ramp: Array    # (records,): slope per second


def about_mean(groups: Groups) -> Callable[[Array], AboutMean]:
    """Return a function that removes the mean from a spectrum, given the expected noise power."""
    products = regressors([groups])

    def about(expected: Array) -> AboutMean:
        _, size, covariance = regress(products, groups.records, (groups.dof / expected)[None])
        ramp = size[0, :, 0]
        blocks = np.maximum(groups.power + np.minimum(groups.ramp, 0.0) @ ramp**2,
                            LEAST_OF_BLOCKS * groups.power)
        return AboutMean(blocks, residual_power(blocks, products, size, covariance)[0], ramp)

    return about
