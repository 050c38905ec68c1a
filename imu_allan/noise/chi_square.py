# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The chi-square distribution, from functions of scipy.special.

scipy.stats has it as well, but takes half a second to import, for a command of two seconds.

References
----------
M. S. Bartlett, "Properties of sufficiency and statistical tests", Proc. R. Soc. A 160 (1937).

"""

from imu_allan.arrays import Array
import numpy as np
from scipy.special import chdtrc, chdtri, gammaincinv

NORMAL95 = 1.96
"""Half-width of a normal 95 % interval in standard errors: the square root of `upper(0.05, 1)`."""


def survival(x: Array | float, dof: Array | float) -> Array:
    """Return the probability that a chi-square variable of `dof` degrees exceeds `x`."""
    return np.asarray(chdtrc(dof, x), np.float64)


def upper(probability: float, dof: Array | float) -> Array:
    """Return the value that is exceeded with `probability`."""
    return np.asarray(chdtri(dof, probability), np.float64)


def lower(probability: float, dof: Array | float) -> Array:
    """Return the value below which the variable lies with `probability`."""
    return np.asarray(2 * gammaincinv(dof / 2, probability), np.float64)


def equal_variances(ratio: Array, dof: Array) -> float:
    """
    Test the hypothesis of equal variances by Bartlett's test, and return its p-value.

    `ratio`, `dof`, shape (n, bands): variances relative to their expectations, and their degrees
    of freedom. Returns: a common p-value of all bands.
    """
    total = dof.sum(axis=0)
    pooled = np.sum(dof * ratio, axis=0) / total
    there = pooled != 0  # bands without any power do not differ
    if not np.all(there):
        return equal_variances(ratio[:, there], dof[:, there]) if np.any(there) else 1.0
    # Zero has no logarithm.
    value = total * np.log(pooled) - np.sum(dof * np.log(np.maximum(ratio, 1e-300 * pooled)), 0)
    correction = 1 + (np.sum(1 / dof, axis=0) - 1 / total) / (3 * (len(ratio) - 1))
    return float(survival(max(float(np.sum(value / correction)), 0.0),
                          (len(ratio) - 1) * ratio.shape[1]))
