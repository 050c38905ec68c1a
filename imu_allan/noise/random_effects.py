# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Random effects: a population of units, each measured with its own error.

The true value x_i of unit i is normal about the population mean with standard deviation `between`.
It was measured as y_i with standard error e_i, so y_i is normal with variance between^2 + e_i^2.
The spread maximises the restricted likelihood, which accounts for the fitted mean; otherwise the
spread of 20 units would be 4 to 12 % too small. A unit with only an upper bound u contributes the
probability of lying below it. So the spread between units is separated from measurement error.

References
----------
H. D. Patterson and R. Thompson, Biometrika 58 (1971): the restricted likelihood. W. Viechtbauer,
Stat. Med. 26 (2007): the interval of the spread. D. B. Owen, Technometrics 10 (1968): tolerance
limits by the non-central t. B. Rosner, Technometrics 25 (1983): several outliers.

"""

from collections.abc import Callable
from dataclasses import dataclass

from imu_allan.arrays import Array, Bools
from imu_allan.noise.chi_square import NORMAL95
import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri, log_ndtr, ndtri


@dataclass(frozen=True)
class Effects:
    """Fitted population of units."""

    errors: Array    # (units,): standard errors of the measured values
    # Mean and standard deviation of the population, by restricted maximum likelihood
    mean: float
    between: float
    # By the generalised Q statistic, exact for any number of units, and extended to `between`. If
    # that allows no spread, the upper end is that of the likelihood interval.
    between_ci95: tuple[float, float]

    def percentile(self, share: float) -> float:
        """Return the value below which `share` of all units lie."""
        return self.mean + float(ndtri(share)) * self.between

    def tolerance(self, share: float = 0.95, confidence: float = 0.95) -> float:
        """
        Return a one-sided tolerance limit for all units, not only for those measured.

        `share`: share of the units below the limit. `confidence`: probability that at least this
        share is. Returns: a limit that is exact if measurement errors are much smaller than the
        spread. If the two cannot be separated, the upper bound of the spread is used.
        """
        from scipy.stats import nct

        total = self.between**2 + self.errors**2
        # Of each unit's variance, the share that is due to the population
        shares = np.divide(self.between**2, total, out=np.zeros_like(total), where=total > 0)
        z = float(ndtri(share))
        free, weight = float(np.sum(shares**2)) - 1, float(np.sum(shares))
        # With fewer than two degrees of freedom, use the upper bound of the spread.
        if free < 2.0:
            spread = max(self.between_ci95[1], self.between)
            weights = 1 / np.maximum(spread**2 + self.errors**2, 1e-300)
            error = 1 / np.sqrt(float(np.sum(weights)))
            return float(self.mean + ndtri(confidence) * error + z * spread)
        factor = float(nct.ppf(confidence, free, z * np.sqrt(weight))) / np.sqrt(weight)
        return float(self.mean + factor * self.between)


def random_effects(values: ArrayLike, errors: ArrayLike, bounds: ArrayLike = ()) -> Effects:
    """
    Fit a population to units that were measured with different errors.

    `values`, `errors`, shape (units,): at least two units, errors not negative. `bounds`, shape
    (censored,): upper bounds of further units. Returns: the maximum over mean m and spread b of
    -1/2 sum_i [ln v_i + (y_i - m)^2/v_i] - 1/2 ln sum_i 1/v_i with v_i = b^2 + e_i^2. A bound adds
    the logarithm of the probability below it. Raises ValueError: for fewer than two units.
    """
    y, e, u = (np.asarray(part, dtype=np.float64) for part in (values, errors, bounds))
    if len(y) < 2 or y.shape != e.shape:
        raise ValueError('at least two units are needed, each with its error')

    def loss(spread: float) -> float:
        return _best_mean(y, e, u, spread)[1]

    scatter = float(np.std(y)) or float(np.max(e)) or 1e-12 * float(np.max(np.abs(y))) or 1e-300
    # Begin at a millionth of the scatter of the measured values, with 14 spreads per decade.
    spreads = scatter * np.geomspace(1e-6, 10.0, 97)
    # Losses that differ by rounding alone are equal, and the smallest of their spreads is taken. A
    # best spread at the lower end of the grid counts as zero.
    best = int(np.argmin(np.round([loss(spread) for spread in spreads], 9)))
    spread = 0.0
    if best > 0:
        from scipy.optimize import minimize_scalar  # seldom needed: a tenth of a second of import

        around = np.log(spreads[[best - 1, min(best + 1, len(spreads) - 1)]])
        spread = float(np.exp(minimize_scalar(
            lambda log: loss(float(np.exp(log))), bounds=tuple(around), method='bounded',
            options={'xatol': 1e-4}).x))
    low, high = _interval(y, e, scatter)
    if high == 0 and np.any(e > 0):
        # The scatter is smaller than errors alone cause in 39 of 40 populations, so that Q allows
        # no spread at all. That is chance; the likelihood still gives an upper limit.
        limit = loss(spread) + NORMAL95**2 / 2
        high = _crossing(lambda s: loss(s) - limit, spread, float(np.max(e)), 2)
    # Bounds are not part of Q, and errors that differ by orders of magnitude weigh otherwise.
    low, high = min(low, spread), max(high, spread)
    return Effects(e, _best_mean(y, e, u, spread)[0], spread, (low, high))


def q_statistic(values: ArrayLike, errors: ArrayLike, spread: float = 0.0) -> float:
    """
    Weighted sum of squares about the weighted mean.

    `values`, `errors`, shape (units,): measured values and their standard errors. `spread`: of the
    true values. Returns: a statistic that is chi-square distributed with one degree of freedom
    less than there are units, if the spread is true.
    """
    y, e = np.asarray(values, dtype=np.float64), np.asarray(errors, dtype=np.float64)
    weight = 1 / np.maximum(spread**2 + e**2, 1e-300)
    return float(weight @ (y - weight @ y / weight.sum())**2)


def _interval(y: Array, e: Array, scatter: float) -> tuple[float, float]:
    """Return the 95 % interval of the spread, by inverting the test of the Q statistic."""
    def end(probability: float) -> float:
        wanted = float(chdtri(len(y) - 1, probability))
        return 0.0 if q_statistic(y, e) <= wanted else _crossing(
            lambda spread: wanted - q_statistic(y, e, spread), 0.0, scatter, 4)

    return end(0.025), end(0.975)


def _crossing(excess: Callable[[float], float], low: float, step: float, growth: float) -> float:
    """Return where a function rises above zero: first sought a step above `low`, then farther."""
    from scipy.optimize import brentq

    high = low + step
    while excess(high) < 0:
        high *= growth
    return float(brentq(excess, low, high, xtol=1e-6 * step))


def _best_mean(y: Array, e: Array, u: Array, spread: float) -> tuple[float, float]:
    """Return the best mean for a given spread, and the negative restricted log likelihood."""
    variance = np.maximum(spread**2 + e**2, 1e-300)
    weight = 1 / variance
    information = float(weight.sum())
    mean = float(weight @ y / information)

    def of_values(at: float) -> float:
        return float(0.5 * (np.sum(np.log(variance) + (y - at)**2 / variance)
                            + np.log(information)))

    if not len(u):
        return mean, of_values(mean)
    from scipy.optimize import minimize_scalar

    # Bounds have no standard error, so use that of a typical unit.
    deviation = np.sqrt(spread**2 + float(np.median(e))**2) or 1e-300
    reach = 5 * np.sqrt(float(np.mean(variance))) + float(np.ptp(np.append(y, u)))
    found = minimize_scalar(
        lambda at: of_values(at) - float(np.sum(log_ndtr((u - at) / deviation))),
        bounds=(mean - reach, mean), method='bounded')
    return float(found.x), float(found.fun)


def outliers(values: ArrayLike, errors: ArrayLike, chance: float = 0.01) -> Bools:
    """
    Find the units that do not belong to the population of the others.

    `values`, `errors`, shape (units,): measured values and their standard errors. `chance`:
    probability of finding an outlier in a population without any. Returns shape (units,): no
    outliers among fewer than five units. Units are removed one by one, the farthest first. Each is
    tested against the remaining population, at the quantile of Student's t for that number of
    tests. All units up to the last one rejected are outliers, so that they do not mask each other.
    """
    from scipy.stats import t

    y, e = np.asarray(values, dtype=np.float64), np.asarray(errors, dtype=np.float64)
    found = np.zeros(len(y), dtype=np.bool_)
    # Among fewer units, an outlier cannot be identified.
    if len(y) < 5:
        return found
    rest = np.arange(len(y))
    effects = random_effects(y, e)
    taken: list[int] = []
    last = 0
    # More than a quarter of the units would be a second population.
    for _ in range(max(1, len(y) // 4)):
        scatter = np.sqrt(np.maximum(effects.between**2 + e[rest]**2, 1e-300))
        farthest = int(np.argmax(np.abs(y[rest] - effects.mean) / scatter))
        unit = int(rest[farthest])
        taken.append(unit)
        rest = np.delete(rest, farthest)
        effects = random_effects(y[rest], e[rest])
        expected = np.sqrt(effects.between**2 * (1 + 1 / len(rest)) + e[unit]**2)
        # The unit tested is the farthest of all, hence the correction for the number of units.
        threshold = float(t.isf(chance / (2 * (len(rest) + 1)), len(rest) - 1))
        if abs(y[unit] - effects.mean) > threshold * max(float(expected), 1e-300):
            last = len(taken)
        # Stop after eight units in a row that are not rejected.
        if len(taken) - last == 8:
            break
    found[taken[:last]] = True
    return found
