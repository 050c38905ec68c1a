# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The Kalman filter of state spaces over series of means, many side by side.

All axes and both directions of a test run in the same loop: a step costs a dozen operations on
small arrays, whether one filter runs or twenty.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from imu_allan.tuning.state_space import StateSpace
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Filtered:
    """
    What filters saw, step by step.

    Attributes
    ----------
    innovation : ndarray, shape (filters, steps)
        Mean minus prediction; NaN where the mean is missing.
    variance : ndarray, shape (filters, steps)
        Claimed for it.
    state : ndarray, shape (filters, steps, states)
        Before each step.
    covariance : ndarray, shape (filters, steps, states, states)
        Claimed for it.

    """

    innovation: Array
    variance: Array
    state: Array
    covariance: Array


def run_filters(spaces: Sequence[StateSpace], means: ArrayLike) -> Filtered:
    """
    Run the Kalman filter of each state space over its series.

    Parameters
    ----------
    spaces : sequence of StateSpace
        One for each series; they may differ in the number of states.
    means : array_like, shape (filters, steps)
        Consecutive means over the step; NaN where one is missing.

    Returns
    -------
    Filtered
        States that a space does not have stay zero; they stand behind the last. With x, P before a
        step and y its mean: ``S = H P H' + R``, ``G = (A P H' + C)/S``, then
        ``x = A x + G (y - H x)`` and ``P = A P A' + Q - G S G'``.

    Examples
    --------
    >>> import imu_allan
    >>> rates = imu_allan.simulate({'noise_density': 1e-3}, 60_000, 100.0)
    >>> space = imu_allan.state_space(imu_allan.characterize(rates, 100.0), 1.0)
    >>> found = run_filters([space], rates.reshape(1, -1, 100).mean(axis=2))
    >>> found.innovation.shape
    (1, 600)

    """
    series = np.asarray(means, dtype=np.float64)
    lanes, steps = series.shape
    n = max(len(space.transition) for space in spaces)
    decay, h, cross = np.zeros((lanes, n)), np.zeros((lanes, n)), np.zeros((lanes, n))
    process, p = np.zeros((lanes, n, n)), np.zeros((lanes, n, n))
    for lane, space in enumerate(spaces):
        k = len(space.transition)
        decay[lane, :k] = np.diag(space.transition)
        h[lane, :k], cross[lane, :k] = space.observation[0], space.cross[:, 0]
        process[lane, :k, :k], p[lane, :k, :k] = space.process, space.initial
    r = np.array([float(space.measurement[0, 0]) for space in spaces])
    both = decay[:, :, None] * decay[:, None, :]
    x = np.zeros((lanes, n))
    found = Filtered(np.empty((lanes, steps)), np.empty((lanes, steps)),
                     np.empty((lanes, steps, n)), np.empty((lanes, steps, n, n)))
    there = np.isfinite(series)
    for k in range(steps):
        found.state[:, k], found.covariance[:, k] = x, p
        ph = (p * h[:, None, :]).sum(axis=2)
        claimed = (h * ph).sum(axis=1) + r
        innovation = series[:, k] - (h * x).sum(axis=1)
        gain = (decay * ph + cross) / claimed[:, None]
        if not there[:, k].all():
            gain[~there[:, k]] = 0
        found.innovation[:, k], found.variance[:, k] = innovation, claimed
        x = decay * x + gain * np.where(there[:, k], innovation, 0)[:, None]
        p = both * p + process - claimed[:, None, None] * gain[:, :, None] * gain[:, None, :]
    return found
