# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
One model over one band of the spectrum, and how well it describes it.

References
----------
S. S. Wilks, Ann. Math. Statist. 9 (1938), and H. Chernoff, Ann. Math. Statist. 25 (1954): the
likelihood ratio, and its law at a boundary. E. B. Wilson and M. M. Hilferty, Proc. Natl. Acad.
Sci. 17 (1931): the cube root of a chi-square.

"""

from dataclasses import dataclass, replace

from imu_allan.noise import chi_square
from imu_allan.noise.groups import Groups, QUANTIZATION, WHITE
from imu_allan.noise.likelihood import maximise, residual_power, Solution
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

OBSERVABLE = 6.635
"""
Likelihood ratio above which a term is observable (1 %): its interval then lies well above zero.
Flicker has a few correlated slow coefficients that can pass for a random walk; at 3.84, which
would do for white noise, one record in ten of flicker would show one.
"""
OBSERVABLE_RAMP = OBSERVABLE
"""
The same for the ramp. It rests on the few slowest coefficients, as the random walk does: where a
weak walk hides, up to 3 records in 100 show a ramp. Five standard errors of a ramp, as they would
be if there could be no walk, are passed by 9 in 100.
"""
SMALLEST_P = 0.01
"""Chi-square probability of the residuals above which they are chance."""
BENT_P = 0.001
"""The same below which the band is cut."""
_CHANCE = 1e-3
"""Probability of the excursion of a half-octave that counts as sampling error, not as misfit."""
_TOLERATED_MISFIT = 0.05
"""A million samples reject a misfit of 1 %, which no user cares about; at 5 % some do."""


@dataclass(frozen=True)
class Trial:
    """One model over one band."""

    groups: Groups
    solution: Solution
    fixed: dict[int, float]
    edge_hz: float | None
    rolling: bool
    p_value: float
    misfit: float
    dispersion: float

    @property
    def bent(self) -> bool:
        """Whether the fast end of the spectrum was left out or allowed to roll off."""
        return self.edge_hz is not None or self.rolling

    @property
    def described(self) -> bool:
        """Whether the residuals are no larger than chance makes them."""
        return self.p_value > SMALLEST_P

    @property
    def good(self) -> bool:
        """Whether they are small enough for a user not to care."""
        return self.described or self.misfit <= _TOLERATED_MISFIT


def fit_band(groups: Groups, edge_hz: float | None, rolling: bool = False,
             start: Solution | None = None) -> Trial:
    """Fit the terms over a band, where `rolling` with a roll-off of the white noise."""
    return fit_columns(banded(groups, edge_hz, rolling), edge_hz, rolling, start)


def start_in_band(before: Trial, rolling: bool) -> Solution:
    """Where to begin in another band: at the same terms, the white noise flat to its edge."""
    theta = before.solution.theta[:4].copy()
    theta[QUANTIZATION] = theta[WHITE] if rolling else 0.0
    return replace(before.solution, theta=theta)


def banded(groups: Groups, edge_hz: float | None, rolling: bool) -> Groups:
    """Return the groups of a band, where `rolling` with a column for the roll-off."""
    if edge_hz is not None:
        groups = groups.below(edge_hz)
    if rolling:
        edge = edge_hz if edge_hz is not None else float(groups.frequency[-1])
        design = groups.design.copy()
        fall = np.minimum((groups.frequency / edge) ** 2, 1.0)
        design[:, QUANTIZATION] = groups.design[:, WHITE] * fall
        design[:, WHITE] = groups.design[:, WHITE] * (1 - fall)
        groups = groups.with_design(design)
    return groups


def fit_columns(groups: Groups, edge_hz: float | None, rolling: bool,
                start: Solution | None = None) -> Trial:
    """Fit the columns; drop quantization noise unless the data asks. The ramp is always in."""
    fixed: dict[int, float] = {}
    solution = maximise(groups, start, trend='restricted')
    if not rolling and solution.theta[QUANTIZATION] > 0:
        without = maximise(groups, solution, fixed={QUANTIZATION: 0.0}, trend='restricted',
                           limit=solution.loss + OBSERVABLE / 2)
        if 2 * (without.loss - solution.loss) < OBSERVABLE:
            fixed, solution = {QUANTIZATION: 0.0}, without
    elif not rolling:
        fixed = {QUANTIZATION: 0.0}
    return Trial(groups, solution, fixed, edge_hz, rolling, *residuals(groups, solution))


def residuals(groups: Groups, solution: Solution) -> tuple[float, float, float]:
    """Chi-square probability, worst misfit and dispersion of half-octave residuals."""
    expected = groups.design @ solution.theta
    ratio = residual_power(groups, solution.theta) / np.maximum(expected, 1e-300)
    band = np.floor(2 * np.log2(groups.frequency)).astype(np.int64)
    _, inverse = np.unique(band, return_inverse=True)
    dof = np.bincount(inverse, groups.dof)
    power = np.bincount(inverse, groups.dof * ratio)
    # Wilson-Hilferty: the cube root of a chi-square is normal even for a few degrees of freedom.
    normal = (np.cbrt(power / dof) - (1 - 2 / (9 * dof))) / np.sqrt(2 / (9 * dof))
    free = max(len(dof) - int((solution.theta > 0).sum()), 1)
    total = float(normal @ normal)
    p_value = float(chi_square.survival(total, free))
    high, low = chi_square.upper(_CHANCE, dof) / dof, chi_square.lower(_CHANCE, dof) / dof
    misfit = float(max(np.max(power / dof - high), np.max(low - power / dof), 0.0))
    dispersion = 1.0 if p_value > SMALLEST_P else total / free
    return p_value, misfit, dispersion
