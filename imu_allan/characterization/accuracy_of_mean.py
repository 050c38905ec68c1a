# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The accuracy of the mean of a record."""

from math import sqrt

from imu_allan.noise.terms import allan_variance, LASTING_TERMS
from imu_allan.result import AxisResult
import numpy as np


def mean_is_known(axis: AxisResult) -> bool:
    """Return whether the error of the mean is known: not after a high-pass, and not without N."""
    return axis.high_passed_hz is None and axis.coefficients['noise_density'].value is not None


def error_of_mean(axis: AxisResult, duration_s: float, *, at_most: bool = False) -> float:
    """
    Return the standard error of the mean of one axis over a record.

    `axis`: a fitted axis for which `mean_is_known`; unobservable terms count as zero. `at_most`:
    count unobservable lasting terms by their upper bounds, for the largest error. Returns: the
    Allan deviation of the fitted terms at the length of the record. It says how well the mean of
    one such record predicts that of the next. Zero without a record.
    """
    values = {key: found.value for key, found in axis.coefficients.items()
              if found.value is not None}
    if at_most:
        values |= {key: bound for key in LASTING_TERMS if key not in values
                   and (bound := axis.coefficients[key].upper95) is not None}
    # A file may state 5e-324 s, over which the error of a mean is infinite.
    with np.errstate(over='ignore'):
        return sqrt(float(allan_variance(values, duration_s))) if duration_s > 0 else 0.0
