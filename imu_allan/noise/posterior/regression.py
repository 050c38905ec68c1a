# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What regressors explain of spectra, and the power that is left about them.

With the noise's weights W = n / lambda the coefficients c are regressed on X: A = X'WX, b = X'Wc.
The likelihood gains b'A^-1 b / 2, the restricted one loses (1/2) ln det A of that again, and what
is left of the power is (c - X A^-1 b)^2 + x'A^-1 x, the last for the uncertainty of the trend.
Several records have regressors of their own.

References
----------
H. D. Patterson and R. Thompson, Biometrika 58 (1971): restricted likelihood.

"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from imu_allan.noise.record.groups import Groups, LEAST_OF_BLOCKS
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RIDGE = 1e-10
"""Relative; far above rounding and far below what any two different regressors leave."""


def regressors(groups: Sequence[Groups]) -> Array:
    """Products with the regressors of every record, shape (spectra, products, groups)."""
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
    Regress on the mean's regressors under weights, shape (rows, groups).

    Returns
    -------
    gain : ndarray, shape (rows,)
        Of the restricted likelihood.
    size : ndarray, shape (rows, records, regressors)
    covariance : ndarray, shape (rows, records, regressors, regressors)

    """
    found = np.matmul(products, weight[:, :, None]).reshape(len(weight), records, -1)
    count = int(np.sqrt(found.shape[2]))
    target = found[:, :, :count]
    gram = found[:, :, count:].reshape(*target.shape, count)
    if count == 1:
        single = np.where(gram[..., 0] > 0, gram[..., 0], 1.0)
        gain = 0.5 * (target**2 / single - np.log(single)).sum(axis=(1, 2))
        return gain, target / single, (1 / single)[..., None]
    norm = np.einsum('...ii->...i', gram)
    scale = np.sqrt(np.where(norm > 0, norm, 1.0))
    # What no group sees, or nothing but rounding, is left out.
    ridge = np.where(norm > 0, RIDGE, 1.0)[..., None] * np.eye(count)
    unit = gram / (scale[..., :, None] * scale[..., None, :]) + ridge
    covariance = np.linalg.inv(unit) / (scale[..., :, None] * scale[..., None, :])
    size = np.einsum('...ij,...j->...i', covariance, target)
    gain = 0.5 * np.einsum('mri,mri->m', target, size) - 0.5 * (
        np.linalg.slogdet(unit)[1] + 2 * np.log(scale).sum(axis=-1)).sum(axis=-1)
    return gain, size, covariance


def residual_power(power: Array, products: Array, size: Array, covariance: Array) -> Array:
    """Power about the mean as expected of the noise alone, shape (rows, groups)."""
    second = size[..., :, None] * size[..., None, :] + covariance
    factors = np.concatenate((-2 * size, second.reshape(*size.shape[:2], -1)), axis=2)
    about = power + np.matmul(factors.reshape(len(size), 1, -1), products)[:, 0]
    return np.asarray(np.maximum(about, 1e-12 * power))


class AboutMean(NamedTuple):
    """A spectrum without its mean."""

    blocks: Array    # (groups,): power without the ramp in blocks, which know no sign
    noise: Array    # (groups,): power without the mean, as expected of the noise alone
    ramp: float | Array    # per second; of every group where there are several records


def about_mean(groups: Groups) -> Callable[[Array], AboutMean]:
    """Return what takes the mean out of a spectrum, given the expected power of the noise."""
    products = regressors([groups])

    def about(expected: Array) -> AboutMean:
        _, size, covariance = mean(products, groups.records, (groups.dof / expected)[None])
        ramp = float(size[0, 0, 0]) if groups.record is None else size[0, groups.record, 0]
        blocks = np.maximum(groups.power + ramp**2 * np.minimum(groups.ramp, 0.0),
                            LEAST_OF_BLOCKS * groups.power)
        return AboutMean(blocks, residual_power(blocks, products, size, covariance)[0], ramp)

    return about
