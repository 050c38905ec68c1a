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
from imu_allan.noise.record.groups import Groups, LEAST_OF_BLOCKS
import numpy as np

RIDGE = 1e-10
"""Relative ridge: far above rounding, far below the residual of any two different regressors."""


def regressors(groups: Sequence[Groups]) -> Array:
    """Return products with the regressors of each record, shape (spectra, products, groups)."""
    found = []
    for one in groups:
        assert one.along is not None
        assert one.among is not None
        products = np.concatenate((one.along, one.among.reshape(len(one.dof), -1)), axis=1).T
        own = np.ones((1, 1), dtype=bool) if one.record is None else (
            one.record == np.arange(one.records)[:, None])
        found.append((own[:, None] * products).reshape(-1, len(one.dof)))
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
    found = np.matmul(products, weight[:, :, None]).reshape(len(weight), records, -1)
    count = int(np.sqrt(found.shape[2]))
    target = found[:, :, :count]
    gram = found[:, :, count:].reshape(*target.shape, count)
    if count == 1:
        single = np.where(gram[..., 0] > 0, gram[..., 0], 1.0)
        gain = 0.5 * (target * (target / single) - np.log(single)).sum(axis=(1, 2))
        return gain, target / single, (1 / single)[..., None]
    norm = np.einsum('...ii->...i', gram)
    scale = np.sqrt(np.where(norm > 0, norm, 1.0))
    # The ridge removes regressors that are zero in all groups, or nothing but rounding error.
    ridge = np.where(norm > 0, RIDGE, 1.0)[..., None] * np.eye(count)
    unit = gram / (scale[..., :, None] * scale[..., None, :]) + ridge
    covariance = np.linalg.inv(unit) / (scale[..., :, None] * scale[..., None, :])
    size = np.einsum('...ij,...j->...i', covariance, target)
    gain = 0.5 * np.einsum('mri,mri->m', target, size) - 0.5 * (
        np.linalg.slogdet(unit)[1] + 2 * np.log(scale).sum(axis=-1)).sum(axis=-1)
    return gain, size, covariance


def residual_power(power: Array, products: Array, size: Array, covariance: Array) -> Array:
    """Return the power about the mean, as expected of the noise alone, shape (rows, groups)."""
    second = size[..., :, None] * size[..., None, :] + covariance
    factors = np.concatenate((-2 * size, second.reshape(*size.shape[:2], -1)), axis=2)
    about = power + np.matmul(factors.reshape(len(size), 1, -1), products)[:, 0]
    return np.asarray(np.maximum(about, 1e-12 * power))


class AboutMean(NamedTuple):
    """Spectrum without the moving mean."""

    blocks: Array    # (groups,): power without the ramp in blocks, which have no signed values
    noise: Array    # (groups,): power without the mean, as expected of the noise alone
    ramp: float | Array    # slope per second; (groups,) if there are several records


def about_mean(groups: Groups) -> Callable[[Array], AboutMean]:
    """Return a function that removes the mean from a spectrum, given the expected noise power."""
    products = regressors([groups])

    def about(expected: Array) -> AboutMean:
        _, size, covariance = mean(products, groups.records, (groups.dof / expected)[None])
        ramp = float(size[0, 0, 0]) if groups.record is None else size[0, groups.record, 0]
        blocks = np.maximum(groups.power + ramp**2 * np.minimum(groups.ramp, 0.0),
                            LEAST_OF_BLOCKS * groups.power)
        return AboutMean(blocks, residual_power(blocks, products, size, covariance)[0], ramp)

    return about
