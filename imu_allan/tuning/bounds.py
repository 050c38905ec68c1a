# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What an upper bound is worth: a filter must not be given one that the data contradicts."""

from imu_allan.noise.terms import TERMS
from imu_allan.result import AxisResult
import numpy as np


def upper_bound(axis: AxisResult, key: str) -> float | None:
    """
    Return the upper bound of a coefficient that the data does not show.

    A course that bends as a random walk does, and is taken out of the fit, can take with it all
    that the data says of the walk; its bound then is any number. But the measured Allan variance
    holds every term, and the courses besides: no term is above the upper end of its interval at
    any averaging time.

    Parameters
    ----------
    axis : AxisResult
        An axis object of a result.
    key : str
        One of the noise terms.

    Returns
    -------
    float or None
        In the unit of the coefficient. None where there is no bound, or no curve to hold it
        against.

    """
    bound = axis.coefficients[key].upper95
    if not bound:
        return None
    # Widths W of a low-pass: the Allan variance over tau is short of W/(2 tau), 2 % in deviation.
    least_s = 16.0 * (axis.band_limit_s or 0.0)
    curve = [(tau, interval[1]) for tau, interval
             in zip(axis.curve.tau_s, axis.curve.ci95, strict=False) if tau >= least_s]
    if not curve:
        return None
    tau, highest = np.array(curve).T
    allowed = float(np.min(highest / TERMS[key].adev(1.0, tau)))
    return min(bound, allowed) or None
