# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Moments of interval means of a first-order Gauss-Markov process of unit variance.

A filter observes the mean of the rate between two corrections, and its unaided drift is the mean
over an outage. All formulas are exact for such means. ``x`` is the interval divided by the
correlation time.
"""

from imu_allan.arrays import Array
import numpy as np
from numpy.typing import ArrayLike

_SMALL = 1e-3
"""Below this x, series are used. At it they err by 1e-10; at half of it the formulas, by 1e-9."""


def on_mean(time_s: ArrayLike, interval_s: ArrayLike) -> Array:
    """
    Weight of the initial state in the mean over an interval.

    `time_s`: correlation time of the process; infinite for a constant. `interval_s`: length of
    the interval, broadcast against `time_s`.
    """
    x = np.asarray(interval_s, dtype=np.float64) / np.asarray(time_s)
    return np.where(x > 0, -np.expm1(-x) / np.where(x > 0, x, 1), 1.0)


def mean_variance(time_s: ArrayLike, interval_s: ArrayLike) -> Array:
    """Variance of the mean over an interval of a stationary process of unit variance."""
    x = np.asarray(interval_s, dtype=np.float64) / np.asarray(time_s)
    # 2 (x - 1 + exp(-x))/x^2 loses digits by cancellation for small x.
    full = 2 / np.where(x > 0, x, 1) * (1 - on_mean(1.0, x))
    return np.where(x < _SMALL, 1 - x / 3 + x * x / 12, full)


def rest_of_mean(time_s: ArrayLike, interval_s: ArrayLike) -> Array:
    """Variance of the mean over an interval about its prediction from the initial state."""
    x = np.asarray(interval_s, dtype=np.float64) / np.asarray(time_s)
    full = mean_variance(1.0, x) - on_mean(1.0, x) ** 2
    return np.where(x < _SMALL, 2 * x / 3 * (1 - 3 * x / 4 + 7 * x * x / 20), full)
