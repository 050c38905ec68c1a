# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether parts of a record agree on a coefficient, and how much wider its interval has to be.

References
----------
R. T. Birge, Phys. Rev. 40 (1932): intervals of measurements that disagree.

"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from imu_allan.noise import chi_square
from imu_allan.noise.groups import Groups
from imu_allan.noise.intervals import spread
from imu_allan.noise.likelihood import maximise, Solution
from imu_allan.noise.trial import Trial
import numpy as np

_CHANCE = 0.05
"""Of parts that agree, so many disagree by chance; their intervals then are wider for nothing."""
PARTS = 4
"""More parts are each too short to know flicker and walk, fewer cannot disagree much."""


@dataclass(frozen=True)
class Agreement:
    """
    What the parts say of one coefficient.

    Attributes
    ----------
    widening : float
        By which likelihood ratios are to be divided; 1 where the parts agree.
    between : float
        Standard deviation between the parts beyond their errors.
    disagrees : bool
        Whether the parts differ by more than chance makes of equal ones in 5 of 100 records.

    """

    widening: float
    between: float
    disagrees: bool


def agreements(trial: Trial, parts: Sequence[Groups], columns: Sequence[int]) -> list[Agreement]:
    """
    Compare the parts of a record on some coefficients.

    Parameters
    ----------
    trial : Trial
        The fit of the whole record.
    parts : sequence of Groups
        Of the same band and columns.
    columns : sequence of int
        Of the coefficients.

    Returns
    -------
    list of Agreement
        The ratio X of a value common to n parts is a chi-square of n - 1 degrees where they agree;
        the widening is 1 + n (phi - 1) with phi = max(1, (X + 2) / (n + 1)).

    """
    own = [maximise(groups, trial.solution, fixed=trial.fixed, trend='restricted')
           for groups in parts]
    return [_agreement(trial, parts, own, column) for column in columns]


def _agreement(trial: Trial, parts: Sequence[Groups], own: Sequence[Solution], column: int
               ) -> Agreement:
    """Compare the parts, each with its own fit, on one coefficient."""
    common = float(trial.solution.theta[column])
    total, values, errors = 0.0, [], []
    for groups, free in zip(parts, own, strict=True):
        held = maximise(groups, free, fixed={**trial.fixed, column: common}, trend='restricted',
                        tolerance=1e-3)
        total += 2 * max(held.loss - free.loss, 0.0) / trial.dispersion
        values.append(float(np.sqrt(free.theta[column])))
        errors.append(spread(replace(trial, groups=groups), free, column))
    count = len(parts)
    excess = max(0.0, (total + 2) / (count + 1) - 1)
    beyond = float(np.var(values, ddof=1)) - float(np.mean(np.square(errors)))
    return Agreement(1 + count * excess, float(np.sqrt(max(beyond, 0.0))),
                     bool(chi_square.survival(total, count - 1) < _CHANCE))
