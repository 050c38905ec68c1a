# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The chi-square distribution, by incomplete gamma functions.

scipy.stats has it too, at half a second of import for a command that takes two.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import gammaincc, gammainccinv, gammaincinv

Array = NDArray[np.float64]

NORMAL95 = 1.96
"""Standard errors about a normal estimate that hold 95 %: the root of `upper(0.05, 1)`."""
NORMAL90 = 1.645
"""The same of 90 %, or of 95 % on one side."""


def survival(x: ArrayLike, dof: ArrayLike) -> Array:
    """Return the probability that a chi-square variable of `dof` degrees exceeds `x`."""
    return np.asarray(gammaincc(_half(dof), _half(x)))


def upper(probability: float, dof: ArrayLike) -> Array:
    """Return the value that is exceeded with `probability`."""
    return np.asarray(2 * gammainccinv(_half(dof), probability))


def lower(probability: float, dof: ArrayLike) -> Array:
    """Return the value that is not reached with `probability`."""
    return np.asarray(2 * gammaincinv(_half(dof), probability))


def _half(value: ArrayLike) -> Array:
    return np.asarray(value, dtype=np.float64) / 2
