# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Intervals and bounds by profile likelihood, in one module as all ends are crossings of one."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from imu_allan.noise.chi_square import NORMAL95
from imu_allan.noise.groups import Groups, QUANTIZATION, WHITE
from imu_allan.noise.likelihood import maximise, Solution
from imu_allan.noise.regression import about_blocks
from imu_allan.noise.trial import OBSERVABLE, OBSERVABLE_RAMP, Trial
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FEWEST_GROUPS = 24
"""Three octaves, the fewest that tell four terms from one another."""
CI95 = 3.841
"""
Likelihood ratio at the ends of a 95 % interval. A bound ends there too: the 2.706 of a one-sided
question would hold for a normal error, and that of a weak term is skewed to the low side.
"""


@dataclass(frozen=True)
class Estimate:
    """A coefficient: value and interval where observable, else an upper bound; SI units."""

    observable: bool
    value: float
    low: float
    high: float
    upper: float


def estimate(trial: Trial, column: int, widening: float = 1.0) -> Estimate:
    """One coefficient with its profile-likelihood interval; `widening` divides the ratios."""
    trial = replace(trial, dispersion=trial.dispersion * widening)
    best = trial.solution
    others = {key: value for key, value in trial.fixed.items() if key != column}
    if column in trial.fixed:
        best = maximise(trial.groups, best, fixed=others, trend='restricted')

    near = best

    def rise(coefficient: float) -> float:
        nonlocal near
        near = maximise(trial.groups, near, fixed={**others, column: coefficient**2},
                        trend='restricted', tolerance=1e-3)
        return 2 * (near.loss - best.loss) / trial.dispersion

    value = float(np.sqrt(best.theta[column]))
    # That the parts of a record differ makes a value less certain, not its being there.
    limit = best.loss + OBSERVABLE * trial.dispersion / widening / 2
    there = value > 0 and maximise(
        trial.groups, best, fixed={**others, column: 0.0}, trend='restricted', tolerance=1e-3,
        limit=limit).loss >= limit
    scale = spread(trial, best, column)
    if not there:
        # A term that the model was fitted without stands at zero there.
        kept = 0.0 if column in trial.fixed else value
        return Estimate(False, kept, 0.0, 0.0, crossing(rise, value, scale, CI95))
    high = crossing(rise, value, scale, CI95)
    if not np.isfinite(high):
        return Estimate(False, value, 0.0, 0.0, high)
    low = crossing(rise, value, -scale, CI95)
    if low <= 0:
        # Parts of the record differ so much that nothing is a value as good as any.
        return Estimate(False, value, 0.0, 0.0, high)
    return Estimate(True, value, low, high, high)


def log_ratio(trial: Trial, column: int, one: float, other: float) -> float:
    """
    Logarithm of how much likelier one value of a coefficient makes the data than another.

    Parameters
    ----------
    trial : Trial
        The other coefficients are fitted anew for either value.
    column : int
        Which coefficient.
    one, other : float
        Its two values.

    Returns
    -------
    float
        Positive where `one` is the likelier.

    """
    others = {key: value for key, value in trial.fixed.items() if key != column}
    losses = [maximise(trial.groups, trial.solution, fixed={**others, column: value**2},
                       trend='restricted', tolerance=1e-4).loss for value in (one, other)]
    return (losses[1] - losses[0]) / trial.dispersion


def bent_density(trial: Trial, dt: float, plain: Estimate, widening: float = 1.0) -> Estimate:
    """
    Widen the interval of the noise density by what a bend would make of it.

    A roll-off of a few percent at the edge of the band, or quantization noise of a few standard
    errors, stays below any test and still bends the density by several times its error.

    Parameters
    ----------
    trial : Trial
        In which a roll-off was fitted already, the question is put to the next octave below.
    dt : float
        Sample interval in seconds.
    plain : Estimate
        Of the density in it.
    widening : float, optional
        As for `estimate`.

    Returns
    -------
    Estimate
        Its interval is the hull of the plain one and of that with the white noise as
        ``N^2 cos^2(pi nu) + M^2 sin^2(pi nu)``, M free, scaled to the edge of the band. Of
        several records it is the second one, which holds by itself, with the value in it.

    """
    if not plain.observable:
        return plain
    groups = trial.groups
    edge = trial.edge_hz if trial.edge_hz is not None else float(groups.frequency[-1])
    if trial.rolling:
        design = groups.design.copy()
        design[:, WHITE] = design[:, WHITE] + design[:, QUANTIZATION]
        edge /= 2
        groups = groups.with_design(design).below(edge)
        if len(groups.frequency) < FEWEST_GROUPS:
            return plain
    fall = np.sin(np.pi * np.minimum(groups.frequency * dt, 0.5))**2 \
        / np.sin(np.pi * min(edge * dt, 0.5))**2
    design = groups.design.copy()
    design[:, QUANTIZATION] = groups.design[:, WHITE] * np.minimum(fall, 1.0)
    design[:, WHITE] = groups.design[:, WHITE] - design[:, QUANTIZATION]
    theta = trial.solution.theta.copy()
    theta[QUANTIZATION] = theta[WHITE]
    bent = groups.with_design(design)
    solution = maximise(bent, replace(trial.solution, theta=theta), trend='restricted')
    other = estimate(replace(trial, groups=bent, solution=solution, fixed={}), WHITE, widening)
    if not other.observable:
        return plain
    within = (plain.low, plain.high) if groups.records == 1 else (plain.value, plain.value)
    low, high = min(within[0], other.low), max(within[1], other.high)
    return replace(plain, low=low, high=high, upper=high)


def spread(trial: Trial, best: Solution, column: int) -> float:
    """Guess the standard error of a coefficient from the Fisher information."""
    expected = np.maximum(trial.groups.design @ best.theta, 1e-300)
    active = [i for i in range(len(best.theta))
              if i == column or (best.theta[i] > 0 and i not in trial.fixed)]
    scaled = trial.groups.design[:, active] / expected[:, None]
    gram = (scaled * trial.groups.dof[:, None] / 2).T @ scaled
    norm = np.sqrt(np.diag(gram))
    value = float(np.sqrt(best.theta[column]))
    if not (np.isfinite(gram).all() and np.all(norm > 0)):
        # Without noise nothing is known: the search for the interval begins with the value.
        return max(value, 1e-150)
    inverse = np.linalg.pinv(gram / np.outer(norm, norm))
    place = active.index(column)
    error = float(np.sqrt(max(inverse[place, place], 0) * trial.dispersion) / norm[place])
    # From the standard error of the square to that of the coefficient.
    if value**2 > 2 * error:
        return error / (2 * value)
    return float(np.sqrt(value**2 + error) - value + 0.1 * np.sqrt(error))


def crossing(rise: Callable[[float], float], value: float, scale: float, level: float
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
            # Towards zero without end, unless zero itself is too unlikely.
            if rise(0.0) < (0.99 * root)**2:
                return 0.0
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


def estimate_ramp(trial: Trial) -> Estimate:
    """Estimate the ramp, which is signed, with the interval of a mean."""
    if trial.groups.record is not None:
        # Every record has its own, and none is that of all.
        return Estimate(False, 0.0, 0.0, 0.0, np.nan)
    if trial.groups.along is not None and trial.groups.along.shape[1] > 1:
        return _ramp_beside(trial)
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
        bounds = [abs(_two_sided(rise, free.slope, side * scale, CI95)) for side in (-1, 1)]
        return Estimate(False, 0.0, 0.0, 0.0, max(bounds))
    low, high = (_two_sided(rise, free.slope, side * scale, CI95) for side in (-1, 1))
    return Estimate(True, free.slope, low, high, max(abs(low), abs(high)))


def amplitude_of(trial: Trial, course: int, common: bool = False) -> tuple[float, float, float]:
    """
    Return the size of a course of the mean in a fit: equation (7) of docs/statistics.md.

    Parameters
    ----------
    trial : Trial
        With courses.
    course : int
        Its number; the ramp is the first.
    common : bool, optional
        Of several records, whether they have one amplitude, whose weighted mean is returned;
        otherwise it is that of the record where it is clearest.

    Returns
    -------
    amplitude, low, high : float
        With its 95 % interval, which is that of a mean under the fitted noise.

    """
    assert trial.solution.trend is not None
    half = np.sqrt(CI95) * errors_of_courses(trial)[:, course]
    amplitudes = np.atleast_2d(trial.solution.trend)[:, course]
    if common:
        amplitude = float(np.average(amplitudes, weights=half**-2.0))
        error = float(np.sum(half**-2.0)**-0.5)
    else:
        clearest = int(np.argmax(np.abs(amplitudes) / np.maximum(half, 1e-300)))
        amplitude, error = float(amplitudes[clearest]), float(half[clearest])
    return amplitude, amplitude - error, amplitude + error


def errors_of_courses(trial: Trial) -> Array:
    """Return the standard errors of the regressors of a fit, shape (records, regressors)."""
    groups = trial.groups
    assert groups.among is not None
    weight = groups.dof / np.maximum(groups.design @ trial.solution.theta, 1e-300)
    errors = []
    for number in range(groups.records):
        own = weight if groups.record is None else np.where(groups.record == number, weight, 0.0)
        gram = np.tensordot(own, groups.among, 1)
        scale = np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
        inverse = np.linalg.pinv(gram / np.outer(scale, scale), hermitian=True)
        errors.append(np.sqrt(np.maximum(np.diagonal(inverse), 0.0) * trial.dispersion) / scale)
    return np.array(errors)


def _ramp_beside(trial: Trial) -> Estimate:
    """Estimate the ramp where other courses move the mean as well, whatever the noise may be."""
    value, low, high = amplitude_of(trial, 0)
    best = maximise(_at_slope(trial.groups, value), trial.solution, fixed=trial.fixed,
                    trend='restricted', tolerance=1e-4)

    def rise(slope: float) -> float:
        held = maximise(_at_slope(trial.groups, slope), best, fixed=trial.fixed,
                        trend='restricted', tolerance=1e-3)
        return 2 * max(held.loss - best.loss, 0.0) / trial.dispersion

    there = rise(0.0) >= OBSERVABLE_RAMP
    scale = max((high - low) / (2 * NORMAL95), 1e-300)
    low, high = (_two_sided(rise, value, side * scale, CI95) for side in (-1, 1))
    bound = max(abs(low), abs(high))
    return Estimate(True, value, low, high, bound) if there else Estimate(
        False, 0.0, 0.0, 0.0, bound)


def _at_slope(groups: Groups, slope: float) -> Groups:
    """Return groups about a ramp that is held, with the other regressors alone."""
    assert groups.along is not None
    assert groups.among is not None
    power = about_blocks(groups, slope) - 2 * slope * groups.along[:, 0] \
        + slope**2 * groups.among[:, 0, 0]
    return replace(groups, power=np.maximum(power, 1e-12 * groups.power),
                   ramp=np.zeros(len(power)),
                   along=groups.along[:, 1:] - slope * groups.among[:, 0, 1:],
                   among=groups.among[:, 1:, 1:])


def _two_sided(rise: Callable[[float], float], value: float, scale: float,
               level: float) -> float:
    """Where the ratio reaches `level` on one side of a signed value."""
    sign = np.sign(scale)
    return value + float(sign) * crossing(lambda d: rise(value + float(sign) * d), 0.0,
                                          abs(scale), level)
