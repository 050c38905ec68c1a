# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Noise coefficients of one axis from its spectrum, with intervals one can trust.

The fit is a maximum of likelihood over the whole band. Where no sum of the five terms describes
the spectrum there, the sensor's or driver's low-pass is the usual reason: the finest octaves are
then left out one after the other, with a roll-off of the white noise towards the edge allowed for,
until what is left is described. A term is reported only where leaving it out would make the data
markedly less likely; otherwise there is an upper bound.

References
----------
S. S. Wilks, Ann. Math. Statist. 9 (1938), and H. Chernoff, Ann. Math. Statist. 25 (1954): the
likelihood ratio, and its law at a boundary.

"""

from collections.abc import Callable
from dataclasses import dataclass, replace

from imu_allan.noise import chi_square
from imu_allan.noise.likelihood import (
    FLICKER,
    Groups,
    maximise,
    QUANTIZATION,
    Solution,
    WALK,
    WHITE,
)
from imu_allan.noise.spectrum import gauss_markov
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

COLUMNS = {'quantization_noise': QUANTIZATION, 'noise_density': WHITE,
           'bias_instability': FLICKER, 'rate_random_walk': WALK}

OBSERVABLE = 6.635
"""
Likelihood ratio above which a term is observable (1 %): its interval then lies well above zero.
Flicker has a few correlated slow coefficients that can pass for a random walk; at 3.84, which
would do for white noise, one record in ten of flicker would show one.
"""
OBSERVABLE_RAMP = 10.83
"""
The same for the ramp (0.1 %). It rests on the few slowest coefficients, as the random walk does:
a ramp that is only chance takes most of the walk with it, so the evidence has to be strong.
"""
_CI95 = 3.841
_UPPER95 = 2.706
_SMALLEST_P = 0.01
_BENT_P = 0.001
_CHANCE = 1e-3
_TOLERATED_MISFIT = 0.05
_LOWEST_EDGE_HZ = 0.5
_EDGE_GROUPS = 24
_WORTH = 3.0
_DEEP = 1 / 12
_SHORTEST_CORRELATION = 50
_SLOWEST = (4, 8, 16, 32, 64)  # coefficients that are asked together whether a walk levels off
_OBSERVABLE_PROCESS = 13.82


@dataclass(frozen=True)
class Estimate:
    """A coefficient: value and interval where observable, else an upper bound; SI units."""

    observable: bool
    value: float
    low: float
    high: float
    upper: float


@dataclass(frozen=True)
class Fit:
    """
    What the spectrum of one axis says.

    Attributes
    ----------
    estimates : dict
        By key of `TERMS`.
    window_s : float or None
        Effective averaging window of a low-pass, where one was found.
    edge_hz : float or None
        Highest frequency that was used, where not all.
    p_value : float
        Of the half-octave residuals.
    misfit : float
        Largest relative misfit of a half-octave beyond its sampling error.
    acceptable : bool
    gauss_markov : (float, float) or None
        Standard deviation and correlation time of an additional Gauss-Markov term.

    """

    estimates: dict[str, Estimate]
    window_s: float | None
    edge_hz: float | None
    p_value: float
    misfit: float
    acceptable: bool
    gauss_markov: tuple[float, float] | None = None


@dataclass(frozen=True)
class _Trial:
    """One model over one band."""

    groups: Groups
    solution: Solution
    fixed: dict[int, float]
    ramp: float | None
    edge_hz: float | None
    rolling: bool
    p_value: float
    misfit: float
    dispersion: float

    @property
    def described(self) -> bool:
        """Whether the residuals are no larger than chance makes them."""
        return self.p_value > _SMALLEST_P

    @property
    def good(self) -> bool:
        """Whether they are small enough for a user not to care."""
        return self.described or self.misfit <= _TOLERATED_MISFIT


def fit(groups: Groups, dt: float, start: Solution | None = None) -> Fit:
    """
    Fit one axis.

    Parameters
    ----------
    groups : Groups
        Spectrum of the axis, lines left out.
    dt : float
        Sample interval in seconds.
    start : Solution, optional
        Where to begin.

    Returns
    -------
    Fit

    """
    trial = whole = _try(groups, None, start=start)
    searched, found = None, None
    if whole.p_value < _BENT_P:
        trial = _without_fine_octaves(groups, dt, whole)
        if not trial.described or (trial.edge_hz or np.inf) * dt < _DEEP:
            searched, found = whole, _with_gauss_markov(whole, dt)
    if found is None and trial is not searched and _levels_off(trial):
        found = _with_gauss_markov(trial, dt)
    trial, markov = found or (trial, None)
    estimates = {key: _estimate(trial, column) for key, column in COLUMNS.items()}
    window = None
    if trial.edge_hz is not None or trial.rolling:
        # At the edge of the band the first column no longer is quantization noise.
        window = _window(trial)
        estimates['quantization_noise'] = Estimate(False, 0.0, 0.0, 0.0, np.nan)
    estimates['rate_ramp'] = _ramp(trial)
    return Fit(estimates, window, trial.edge_hz, trial.p_value, trial.misfit, trial.good, markov)


def _try(groups: Groups, edge_hz: float | None, rolling: bool = False,
         start: Solution | None = None) -> _Trial:
    """Fit the terms over a band, where `rolling` with a roll-off of the white noise."""
    if edge_hz is not None:
        groups = groups.below(edge_hz)
    if rolling:
        edge = edge_hz if edge_hz is not None else float(groups.frequency[-1])
        design = groups.design.copy()
        fall = np.minimum((groups.frequency / edge) ** 2, 1.0)
        design[:, QUANTIZATION] = groups.design[:, WHITE] * fall
        design[:, WHITE] = groups.design[:, WHITE] * (1 - fall)
        groups = groups.with_design(design)
    return _fit_columns(groups, edge_hz, rolling, start)


def _fit_columns(groups: Groups, edge_hz: float | None, rolling: bool,
                 start: Solution | None = None) -> _Trial:
    """Fit the columns; drop quantization noise and ramp unless the data asks."""
    fixed: dict[int, float] = {}
    solution = maximise(groups, start)
    if not rolling and solution.theta[QUANTIZATION] > 0:
        without = maximise(groups, solution, fixed={QUANTIZATION: 0.0})
        if 2 * (without.loss - solution.loss) < OBSERVABLE:
            fixed, solution = {QUANTIZATION: 0.0}, without
    elif not rolling:
        fixed = {QUANTIZATION: 0.0}
    ramp: float | None = 0.0
    sloping = maximise(groups, solution, fixed=fixed, ramp=None)
    if 2 * (solution.loss - sloping.loss) > OBSERVABLE_RAMP:
        ramp, solution = None, sloping
    p_value, misfit, dispersion = _residuals(groups, solution)
    return _Trial(groups, solution, fixed, ramp, edge_hz, rolling, p_value, misfit, dispersion)


def _residuals(groups: Groups, solution: Solution) -> tuple[float, float, float]:
    """Chi-square probability, worst misfit and dispersion of half-octave residuals."""
    expected = groups.design @ solution.theta
    ratio = groups.at_ramp(solution.slope) / np.maximum(expected, 1e-300)
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
    dispersion = 1.0 if p_value > _SMALLEST_P else total / free
    return p_value, misfit, dispersion


def _without_fine_octaves(groups: Groups, dt: float, first: _Trial) -> _Trial:
    """
    Leave out the finest octaves until the rest is described.

    Leaving out more than needed costs precision, keeping too much a bias: of the bands tried, that
    one is returned whose noise density is best, both errors taken together.
    """
    tried = [first]
    for decimation in (1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024):
        edge = 1 / (2 * decimation * dt)
        if edge < _LOWEST_EDGE_HZ and decimation > 1:
            break
        if int((groups.frequency <= edge).sum()) < _EDGE_GROUPS:
            break
        if tried[-1].described:
            # A roll-off of another shape passes unseen while it still bends the density by a
            # multiple of its error; an octave further down the bend is a quarter.
            further = _try(groups, edge, rolling=True, start=_start(tried[-1], True))
            worth = _error_of_density(further) < _WORTH * _error_of_density(tried[-1])
            return further if further.described and worth else tried[-1]
        for rolling in (False, True):
            if decimation == 1 and not rolling:
                continue
            tried.append(_try(groups, edge if decimation > 1 else None, rolling,
                              start=_start(tried[-1], rolling)))
            if tried[-1].described:
                break
    return min(tried, key=_error_of_density)


def _start(before: _Trial, rolling: bool) -> Solution:
    """Where to begin in another band: at the same terms, the white noise flat to its edge."""
    theta = before.solution.theta.copy()
    theta[QUANTIZATION] = theta[WHITE] if rolling else 0.0
    return replace(before.solution, theta=theta)


def _error_of_density(trial: _Trial) -> float:
    """Relative error of the noise density: sampling, and what the worst misfit may bend it."""
    value = float(np.sqrt(trial.solution.theta[WHITE]))
    if value <= 0:
        return float('inf')
    sampling = _spread(trial, trial.solution, WHITE) / value
    return float(np.hypot(sampling, 0 if trial.described else trial.misfit / 2))


def _levels_off(trial: _Trial) -> bool:
    """
    Whether the slowest coefficients are markedly smaller than the terms say.

    There are so few of them that the residuals of all half-octaves together do not show it.
    """
    expected = np.maximum(trial.groups.design @ trial.solution.theta, 1e-300)
    ratio = trial.groups.at_ramp(trial.solution.slope) / expected
    # Groups stand in order of frequency.
    dof = np.cumsum(trial.groups.dof)
    power = np.cumsum(trial.groups.dof * ratio)
    some = [at for at in np.searchsorted(dof, _SLOWEST) if at < len(dof)]
    chance = 1 - chi_square.survival(power[some], dof[some])
    return bool(np.any(chance < _SMALLEST_P / len(_SLOWEST)))


def _with_gauss_markov(base: _Trial, dt: float) -> tuple[_Trial, tuple[float, float]] | None:
    """
    Fit the terms and a Gauss-Markov process to the band of a trial.

    A correlation time of a few samples is not considered: that is what a low-pass looks like.
    """
    from scipy.optimize import minimize_scalar  # seldom needed, and slow to import

    groups = base.groups
    longest = 1 / (2 * np.pi * float(groups.frequency[0]))
    if longest < 2 * _SHORTEST_CORRELATION * dt:
        return None
    white = groups.design[:, WHITE]
    if base.rolling:
        white = white + groups.design[:, QUANTIZATION]

    def with_process(time: float) -> Groups:
        density = dt * gauss_markov(np.minimum(groups.frequency * dt, 0.5), dt, time)
        return groups.with_design(np.column_stack((groups.design, white * density)))

    nearest: Solution | None = None

    def attempt(log_time: float) -> float:
        nonlocal nearest
        nearest = maximise(with_process(float(np.exp(log_time))), nearest,
                           fixed={} if base.rolling else {QUANTIZATION: 0.0}, tolerance=1e-3)
        return nearest.loss

    times = np.linspace(np.log(_SHORTEST_CORRELATION * dt), np.log(longest), 12)
    best = int(np.argmin([attempt(time) for time in times]))
    around = (times[max(best - 1, 0)], times[min(best + 1, len(times) - 1)])
    time = float(np.exp(minimize_scalar(attempt, bounds=around, method='bounded',
                                        options={'xatol': 0.01}).x))
    trial = _fit_columns(with_process(time), base.edge_hz, base.rolling)
    theta = trial.solution.theta
    if not trial.described or theta[WHITE] <= 0 or theta[-1] <= 0:
        return None
    if 2 * (base.solution.loss - trial.solution.loss) < _OBSERVABLE_PROCESS:
        return None
    return trial, (float(np.sqrt(theta[-1])), time)


def _window(trial: _Trial) -> float:
    """Width of the boxcar that bends the white noise as much as the roll-off does."""
    edge = float(trial.edge_hz or trial.groups.frequency[-1])
    if not trial.rolling:
        # The filter lies above the edge: no more is known than that it is shorter.
        return 1 / (2 * edge)
    white, at_edge = trial.solution.theta[WHITE], trial.solution.theta[QUANTIZATION]
    if white <= 0 or at_edge >= white:
        return 1 / (2 * edge)
    return float(np.sqrt(3 * (1 - at_edge / white)) / (np.pi * edge))


def _estimate(trial: _Trial, column: int) -> Estimate:
    """One coefficient with its profile-likelihood interval."""
    best = trial.solution
    others = {key: value for key, value in trial.fixed.items() if key != column}
    if column in trial.fixed:
        best = maximise(trial.groups, best, fixed=others, ramp=trial.ramp)

    def rise(coefficient: float) -> float:
        held = maximise(trial.groups, best, fixed={**others, column: coefficient**2},
                        ramp=trial.ramp, tolerance=1e-3)
        return 2 * (held.loss - best.loss) / trial.dispersion

    value = float(np.sqrt(best.theta[column]))
    ratio = rise(0.0) if value > 0 else 0.0
    scale = _spread(trial, best, column)
    if ratio < OBSERVABLE:
        # A term that the model was fitted without stands at zero there.
        kept = 0.0 if column in trial.fixed else value
        return Estimate(False, kept, 0.0, 0.0, _crossing(rise, value, scale, _UPPER95))
    high = _crossing(rise, value, scale, _CI95)
    if not np.isfinite(high):
        return Estimate(False, value, 0.0, 0.0, high)
    low = _crossing(rise, value, -scale, _CI95)
    return Estimate(True, value, low, high, high)


def _spread(trial: _Trial, best: Solution, column: int) -> float:
    """Guess the standard error of a coefficient from the Fisher information."""
    expected = np.maximum(trial.groups.design @ best.theta, 1e-300)
    active = [i for i in range(len(best.theta))
              if i == column or (best.theta[i] > 0 and i not in trial.fixed)]
    scaled = trial.groups.design[:, active] / expected[:, None]
    gram = (scaled * trial.groups.dof[:, None] / 2).T @ scaled
    norm = np.sqrt(np.diag(gram))
    inverse = np.linalg.pinv(gram / np.outer(norm, norm))
    place = active.index(column)
    error = float(np.sqrt(max(inverse[place, place], 0) * trial.dispersion) / norm[place])
    value = float(np.sqrt(best.theta[column]))
    # From the standard error of the square to that of the coefficient.
    if value**2 > 2 * error:
        return error / (2 * value)
    return float(np.sqrt(value**2 + error) - value + 0.1 * np.sqrt(error))


def _crossing(rise: Callable[[float], float], value: float, scale: float, level: float
              ) -> float:
    """
    Find where the likelihood ratio reaches `level`, going from `value` by steps of `scale`.

    Infinity where it never does, zero on the side of smaller coefficients.
    """
    root = float(np.sqrt(level))
    inner, inner_height = value, -root
    outer, outer_height = value + root * scale, 0.0
    for _ in range(40):
        if scale < 0 and outer <= 0:
            outer = inner / 2
        outer_height = float(np.sqrt(max(rise(outer), 0.0))) - root
        if outer_height > -0.01 * root:
            break
        inner, inner_height = outer, outer_height
        outer = value + (outer - value) * 1.7 if scale > 0 else value - (value - outer) * 1.4
    else:
        return np.inf if scale > 0 else 0.0
    for _ in range(12):
        if abs(outer_height) < 0.01 * root:
            return outer
        middle = inner + (outer - inner) * (-inner_height) / (outer_height - inner_height)
        height = float(np.sqrt(max(rise(middle), 0.0))) - root
        if abs(height) < 0.01 * root:
            return float(middle)
        if height < 0:
            inner, inner_height = middle, height
        else:
            outer, outer_height = middle, height
    return float(outer)


def _ramp(trial: _Trial) -> Estimate:
    """Estimate the ramp, which is signed, with the interval of a mean."""
    free = maximise(trial.groups, trial.solution, fixed=trial.fixed, ramp=None)
    still = maximise(trial.groups, trial.solution, fixed=trial.fixed, ramp=0.0)
    ratio = 2 * (still.loss - free.loss) / trial.dispersion

    def rise(slope: float) -> float:
        held = maximise(trial.groups, free, fixed=trial.fixed, ramp=slope, tolerance=1e-3)
        return 2 * (held.loss - free.loss) / trial.dispersion

    expected = np.maximum(trial.groups.design @ free.theta, 1e-300)
    information = float(np.sum(trial.groups.dof * np.maximum(trial.groups.ramp, 0) / expected))
    scale = float(np.sqrt(trial.dispersion / information)) if information > 0 else 0.0
    if scale == 0:
        return Estimate(False, 0.0, 0.0, 0.0, np.nan)
    if ratio < OBSERVABLE_RAMP:
        bounds = [abs(_two_sided(rise, free.slope, side * scale, _UPPER95)) for side in (-1, 1)]
        return Estimate(False, 0.0, 0.0, 0.0, max(bounds))
    low, high = (_two_sided(rise, free.slope, side * scale, _CI95) for side in (-1, 1))
    return Estimate(True, free.slope, low, high, max(abs(low), abs(high)))


def _two_sided(rise: Callable[[float], float], value: float, scale: float,
               level: float) -> float:
    """Where the ratio reaches `level` on one side of a signed value."""
    sign = np.sign(scale)
    return value + float(sign) * _crossing(lambda d: rise(value + float(sign) * d), 0.0,
                                           abs(scale), level)
