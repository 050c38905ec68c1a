# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Kalman filters of state spaces over series of means.

All axes and both directions of a test run in one loop. A step costs a dozen operations on small
arrays, whether one filter runs or twenty.
"""

from collections.abc import Sequence, Set
from dataclasses import dataclass

from imu_allan.arrays import Array
from imu_allan.tuning.state_space import StateSpace
import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True, eq=False)
class Filtered:
    """Innovations and states of filters, step by step."""

    innovation: Array    # (filters, steps): mean minus prediction
    variance: Array    # (filters, steps): predicted variance of the innovation
    # By step: state before it, (filters, states), and its covariance, (filters, states, states)
    before: dict[int, tuple[Array, Array]]


def run_filters(spaces: Sequence[StateSpace], means: ArrayLike, kept: Set[int] = frozenset()
                ) -> Filtered:
    """
    Run the Kalman filter of each state space over its consecutive means.

    A space with fewer states than others has zeros after its last one. Let x, P be before a step,
    and y its mean. Then ``S = H P H' + R``, ``G = (A P H' + C)/S``, ``x = A x + G (y - H x)`` and
    ``P = A P A' + Q - G S G'``. x and P are kept for the steps in `kept`.
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
    found = Filtered(np.empty((lanes, steps)), np.empty((lanes, steps)), {})
    for k in range(steps):
        if k in kept:
            found.before[k] = x, p
        ph = (p * h[:, None, :]).sum(axis=2)
        predicted = (h * ph).sum(axis=1) + r
        innovation = series[:, k] - (h * x).sum(axis=1)
        gain = (decay * ph + cross) / predicted[:, None]
        found.innovation[:, k], found.variance[:, k] = innovation, predicted
        x = decay * x + gain * innovation[:, None]
        p = both * p + process - predicted[:, None, None] * gain[:, :, None] * gain[:, None, :]
    return found
