# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Filters with two or three parameters, and the closed forms that choose them.

Most filters model white noise and a random walk, some white noise and a first-order Gauss-Markov
process. The truth is the drift model. V(h) is what such a filter predicts for the variance of the
mean over the next h seconds, E(h) its actual mean square error. In the steady state both have
closed forms. The parameters are those with the best mean logarithmic score, the smallest mean of
ln V + E/V. It is taken over horizons from the time between two corrections to the longest unaided
time.

References
----------
Y. Bar-Shalom, X. R. Li, T. Kirubarajan, "Estimation with Applications to Tracking and Navigation",
2001, ch. 5.4 (consistency). J. Farrell et al., IEEE Control Systems 42(6), 2022 (Gauss-Markov
processes from the Allan variance). T. Gneiting, A. Raftery, JASA 102 (2007) (scoring rules).

"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from math import inf, isinf, sqrt
from typing import Literal

from imu_allan.arrays import Array
from imu_allan.errors import ImuAllanError, positive, positive_time
from imu_allan.noise.drift_model import drift_avar
from imu_allan.noise.gauss_markov_means import mean_variance, on_mean
from imu_allan.noise.terms import line_power
from imu_allan.result import AxisResult, GaussMarkov, GoodnessOfFit
from imu_allan.tuning.forecast import hidden_variance, upper_of_drift, upper_of_white
from imu_allan.tuning.state_space import above_band, drift_model_of, over_step
import numpy as np

Bias = Literal['random_walk', 'gauss_markov']

_KEPT = 256
"""Cached tunings: a report configures some thirty consumers, most with the same options."""


@dataclass(frozen=True)
class FilterTuning:
    """
    Parameters of a filter, and their performance.

    Attributes
    ----------
    aiding_interval_s, coast_s : float
        Interval of external corrections, and the longest time without any.
    noise_density : float
    random_walk : float or None
        Driving density of the bias for a filter with a random walk.
    sigma, correlation_time_s : float or None
        Standard deviation and correlation time for a filter with a Gauss-Markov process.
    consistency : tuple of (float, float, float)
        Horizon in seconds, and expected and predicted standard deviation of the mean over it.
    known_from_s, known_to_s : float
        Horizons that the recording covers. Below them, the noise density is that of the band it
        knows, or more if the curve lies above. Beyond them, the expectation was widened by a
        random walk that the recording could not have shown.

    """

    aiding_interval_s: float
    coast_s: float
    noise_density: float
    random_walk: float | None
    sigma: float | None
    correlation_time_s: float | None
    consistency: tuple[tuple[float, float, float], ...]
    known_from_s: float
    known_to_s: float

    @property
    def nis(self) -> float:
        """
        Return the expected mean normalised innovation squared.

        1 is consistent, above 1 overconfident.

        """
        _, expected, predicted = self.consistency[0]
        return (expected / predicted) ** 2

    @property
    def coast_ratio(self) -> float:
        """Return expected over predicted variance of the mean over the longest unaided time."""
        _, expected, predicted = self.consistency[-1]
        return (expected / predicted) ** 2


def tune(axis: AxisResult, aiding_interval_s: float = 0.1, coast_s: float = 60.0,
         bias: Bias = 'random_walk', conservative: bool = False,
         correlation_time_s: float | None = None) -> FilterTuning:
    """
    Choose the parameters of a filter with one bias state: equation (10) of docs/statistics.md.

    Parameters
    ----------
    axis : AxisResult
        An axis object of a result, with a drift model.
    aiding_interval_s : float, optional
        Time between two corrections by camera, lidar or satellites.
    coast_s : float, optional
        Longest unaided time.
    bias : {'random_walk', 'gauss_markov'}, optional
        Bias model of the filter.
    conservative : bool, optional
        Whether predictions are never below the upper 95 % end of what is expected at any horizon,
        instead of right on average. How much a sensor's drift usually changes is included.
    correlation_time_s : float, optional
        Correlation time of the filter's Gauss-Markov process, if it is fixed; chosen by default.

    Returns
    -------
    FilterTuning

    Raises
    ------
    ImuAllanError
        If the axis has no drift model, or the times are not positive or not in order.

    Examples
    --------
    >>> import imu_allan
    >>> rates = imu_allan.simulate({'noise_density': 1e-3, 'rate_random_walk': 1e-4},
    ...                            360_000, 100.0)
    >>> tuning = imu_allan.tune(imu_allan.characterize(rates, 100.0), aiding_interval_s=1.0)
    >>> bool(0.97e-3 < tuning.noise_density < 1.03e-3)
    True
    >>> bool(0.8e-4 < tuning.random_walk < 1.2e-4)
    True
    >>> bool(0.95 < tuning.nis < 1.05)
    True

    """
    times = _times(aiding_interval_s, coast_s, correlation_time_s)
    if not isinstance(bias, str) or bias not in ('random_walk', 'gauss_markov'):
        raise ImuAllanError(f"bias must be 'random_walk' or 'gauss_markov', not {bias!r}")
    if bias == 'random_walk' and correlation_time_s is not None:
        raise ImuAllanError("correlation_time_s is for bias='gauss_markov': a random walk has "
                            'none')
    return _tune(_drifting(axis), *times, bias, conservative)


def _drifting(axis: AxisResult) -> AxisResult:
    """Keep only what tuning needs of an axis, so that axes equal in it are tuned once."""
    model = drift_model_of(axis)
    return AxisResult(axis.quantity, axis.unit, None, None, axis.tones, {},
                      GoodnessOfFit(None, None, True), axis.curve, drift_model=model,
                      stationarity=axis.stationarity)


@lru_cache(maxsize=_KEPT)
def _tune(axis: AxisResult, aiding_s: float, coast_s: float, time_s: float | None, bias: Bias,
          conservative: bool) -> FilterTuning:
    truth = Truth(axis)
    horizons = _horizons(aiding_s, coast_s)
    s2 = truth.allan_variance(aiding_s)
    if s2 <= 0:
        raise ImuAllanError('this axis has no noise: there is nothing to tune a filter with')
    # Factors on squared noise density: 3 % of N apart.
    excesses = 10 ** np.linspace(0, 1, 41)
    excess = excesses if conservative else excesses[:1]
    if bias == 'random_walk':
        filters = _candidates(s2, aiding_s, coast_s, excess, np.array([np.inf]))
    else:
        # Correlation times from the aiding interval to ten times the longest unaided time.
        filters = _candidates(s2, aiding_s, coast_s, excess[::3], np.array([time_s]) if time_s
                              else np.geomspace(aiding_s, 10 * coast_s, 25))
    predicted = filters.predicted(horizons)
    expected = truth.expected(filters, horizons)
    wanted = truth.upper(filters, horizons) if conservative else expected
    cost = np.mean(np.log(predicted) + wanted / predicted, axis=0)
    if conservative:
        worst = np.max(wanted / predicted, axis=0)
        # If none is safe at every horizon, take the least unsafe one.
        cost = np.where(worst <= max(1.0, 1.001 * float(worst.min())), cost, np.inf)
    best = int(np.argmin(cost))
    return _performance(truth, float(filters.white[best]), float(filters.driving[best]),
                        float(filters.time[best]), aiding_s, coast_s)


def assess(axis: AxisResult, noise_density: float, random_walk: float,
           aiding_interval_s: float = 0.1, coast_s: float = 60.0,
           correlation_time_s: float | None = None) -> FilterTuning:
    """
    Return how given parameters perform in a filter, by the terms of (10) in docs/statistics.md.

    Parameters
    ----------
    axis : AxisResult
        An axis object of a result, with a drift model.
    noise_density, random_walk : float
        Parameters that the filter is given.
    aiding_interval_s, coast_s : float, optional
        As for `tune`.
    correlation_time_s : float, optional
        Correlation time if the filter's bias is a first-order Gauss-Markov process driven by
        `random_walk`.

    Returns
    -------
    FilterTuning
        With the parameters as given.

    Raises
    ------
    ImuAllanError
        As `tune`, or if a number is not above zero.

    Examples
    --------
    Ten times the random walk makes an outage bound several times too wide:

    >>> import imu_allan
    >>> rates = imu_allan.simulate({'noise_density': 1e-3, 'rate_random_walk': 1e-4},
    ...                            360_000, 100.0)
    >>> axis = imu_allan.characterize(rates, 100.0)
    >>> bool(imu_allan.assess(axis, 1e-3, 1e-3, 1.0).coast_ratio < 0.1)
    True

    """
    times = _times(aiding_interval_s, coast_s, correlation_time_s)
    noise_density = positive('noise_density', noise_density)
    random_walk = positive('random_walk', random_walk)
    return _assess(_drifting(axis), noise_density, random_walk, *times)


@lru_cache(maxsize=_KEPT)
def _assess(axis: AxisResult, noise_density: float, random_walk: float, aiding_s: float,
            coast_s: float, time_s: float | None) -> FilterTuning:
    return _performance(Truth(axis), noise_density**2, random_walk**2, time_s or inf,
                        aiding_s, coast_s)


@dataclass(frozen=True, eq=False)
class Filters:
    """Filters with one bias state in their steady state, side by side: fields of shape (n,)."""

    aiding_s: float
    white: Array    # squared noise density
    driving: Array    # squared driving density of the bias
    time: Array    # correlation time of the bias; infinite for a random walk
    gain: Array    # of the one-step predictor
    # 1 minus the closed-loop transition of the state: a filter that learns for long has so little
    # of it that 1 minus it would be rounded to 1
    forgetting: Array
    covariance: Array    # of the state after a correction

    @classmethod
    def of(cls, white: Array, driving: Array, time: Array, aiding_s: float) -> 'Filters':
        """Return the filters with these parameters."""
        e, a, q, s, rest = over_step(driving, time, aiding_s)
        r = white / aiding_s + rest
        # The scalar Riccati equation p = e^2 p + q - (e a p + s)^2/(a^2 p + r).
        b = r * (1 - e**2) + 2 * e * a * s - a**2 * q
        c = s**2 - q * r
        p = (-b + np.sqrt(np.maximum(b**2 - 4 * a**2 * c, 0))) / (2 * a**2)
        gain = (e * a * p + s) / (a**2 * p + r)
        return cls(aiding_s, white, driving, time, gain, gain * a - np.expm1(-aiding_s / time), p)

    def weight(self, horizons: Array) -> Array:
        """Return the weight of the state in the mean over each horizon, shape (horizons, n)."""
        return on_mean(self.time, horizons[:, None])

    def predicted(self, horizons: Array) -> Array:
        """Return V(h), the variance that the filters predict for the mean over each horizon."""
        h = horizons[:, None]
        _, weight, _, _, rest = over_step(self.driving, self.time, h)
        return np.asarray(weight**2 * self.covariance + rest + self.white / h)


class Truth:
    """Actual errors of a filter, by the drift model of an axis with its tones."""

    def __init__(self, axis: AxisResult) -> None:
        self.axis = axis
        self.model = drift_model_of(axis)

    def allan_variance(self, interval_s: float) -> float:
        """Return the Allan variance of model and tones, and what may lie outside the band."""
        return (float(drift_avar(self.model, self.axis.tones, interval_s))
                + above_band(self.axis, interval_s)
                + float(hidden_variance(self.axis, np.array([interval_s]))[0]))

    def _shows_s(self, random_walk: float) -> float:
        """Return from which averaging time, at most `to_s`, a random walk exceeds white noise."""
        white = float(np.sqrt(3)) * self.model.noise_density
        return min(white / random_walk, self.model.to_s) if random_walk > 0 else self.model.to_s

    def expected(self, filters: Filters, horizons: Array) -> Array:
        """Return E(h), the mean square error of the filters, shape (horizons, filters)."""
        return np.asarray(sum(part for _, part in self._parts(filters, horizons)))

    def upper(self, filters: Filters, horizons: Array) -> Array:
        """Return the upper 95 % end of E(h), shape (horizons, filters)."""
        # A process is known by how often it came and went, whatever the horizon. A slow one is
        # known by how often it exceeded the white noise.
        return np.asarray(sum(
            part * (upper_of_white(self.axis) if scale_s is None else
                    upper_of_drift(self.axis, np.maximum(horizons, scale_s))[:, None])
            for scale_s, part in self._parts(filters, horizons)))

    def _parts(self, filters: Filters, horizons: Array) -> Iterator[tuple[float | None, Array]]:
        """Yield the terms of E(h), and the time over which each shows; None for fast noise."""
        t, h = filters.aiding_s, horizons[:, None]
        g, lost, weight = filters.gain, filters.forgetting, filters.weight(horizons)
        # Variance of the state over that of independent means.
        memory = g**2 / (lost * (2 - lost))
        above = above_band(self.axis, t)
        # Noise above the band averages out like phase noise.
        yield None, (self.model.noise_density**2 * (weight**2 * memory / t + 1 / h)
                     + above * (weight**2 * memory + (t / h) ** 2))
        yield 0.0, (weight**2 * memory * line_power(self.axis.tones, t)
                    + line_power(self.axis.tones, h)
                    + hidden_variance(self.axis, horizons)[:, None])
        random_walk = self.model.rate_random_walk
        # Over short times a process is a random walk, too. Its Allan variance peaks at 1.89
        # correlation times. It is known by its values over eight times as long as a random walk
        # takes to reach the white noise. A smaller factor makes a conservative filter
        # overconfident on more real halves, a larger one makes it wider. Chosen on the 24 halves
        # of two ADIS16405, which therefore do not validate it.
        processes = [(min(1.89 * p.correlation_time_s,
                          8.0 * self._shows_s(p.sigma * (2 / p.correlation_time_s)**0.5)), p)
                     for p in self.model.processes]
        if random_walk > 0:
            shows_s = self._shows_s(random_walk)
            if np.isfinite(filters.time).any():
                # In the end a random walk leaves a forgetting filter behind. It is followed for
                # only as long as the recording has seen it, by a slow process in its place.
                time = 10 * self.model.to_s
                processes.append((
                    shows_s, GaussMarkov(random_walk * float(np.sqrt(time / 2)), time)))
            else:
                yield shows_s, random_walk**2 * (h / 3 + t * (g**2 / 3 - g + 1) / (g * (2 - g)))
        for scale_s, process in processes:
            time, variance = process.correlation_time_s, process.sigma**2
            e, a, ah = np.exp(-t / time), on_mean(time, t), on_mean(time, h)
            r0, c1 = mean_variance(time, t), a**2
            follow = lost * e - np.expm1(-t / time)
            yield scale_s, variance * (weight**2 * memory * (r0 + 2 * c1 * (1 - lost) / follow)
                                       - 2 * weight * ah * a * g / follow
                                       + mean_variance(time, h))


def _performance(truth: Truth, white: float, driving: float, time: float, aiding_s: float,
                 coast_s: float) -> FilterTuning:
    """Return how the filter with these parameters, as of `Filters`, performs."""
    horizons = _horizons(aiding_s, coast_s)
    filters = Filters.of(np.array([white]), np.array([driving]), np.array([time]), aiding_s)
    rows = zip(horizons.tolist(), np.sqrt(truth.expected(filters, horizons)[:, 0]).tolist(),
               np.sqrt(filters.predicted(horizons)[:, 0]).tolist(), strict=True)
    walks = isinf(time)
    return FilterTuning(
        aiding_s, float(horizons[-1]), sqrt(white), sqrt(driving) if walks else None,
        None if walks else sqrt(driving * time / 2), None if walks else time,
        tuple(rows), truth.model.from_s, truth.model.to_s)


def _candidates(s2: float, aiding_s: float, coast_s: float, excess: Array, times: Array
                ) -> Filters:
    """
    Return candidate filters: what the bias does not explain at the aiding interval is N.

    `s2`: Allan variance at the aiding interval. `excess`: factors on squared noise density.
    `times`: correlation times of the bias; infinite for a random walk.
    """
    # Squared driving densities, from invisible ones to three times the Allan variance. With
    # K = 0.01 N / coast_s, the bias makes 1 % of the variance over the longest unaided time.
    decades = 1 - 2 * np.log10(1e-2 * aiding_s / coast_s)
    step = 9 / 160   # decades of squared density: 7 % of a random walk, finer than it is known
    densities = s2 / aiding_s * 10 ** (1 - step * np.arange(decades / step + 1))
    time, driving, more = (part.ravel() for part in np.meshgrid(times, densities, excess))
    # Allan variance of the bias: the variance of a mean minus the covariance of neighbours.
    *_, explained = over_step(driving, time, aiding_s)
    # Without white noise a filter would divide by nearly zero.
    white = more * (aiding_s * np.maximum(s2 - explained, 0.05 * s2))
    return Filters.of(white, driving, time, aiding_s)


def _horizons(aiding_s: float, coast_s: float) -> Array:
    # From aiding interval to longest unaided time: a few per decade, all with equal weight.
    return np.geomspace(aiding_s, coast_s, 7)


def _times(aiding_s: float, coast_s: float, time_s: float | None
           ) -> tuple[float, float, float | None]:
    aiding_s = positive_time('aiding_interval_s', aiding_s)
    coast_s = positive_time('coast_s', coast_s)
    if coast_s < aiding_s:
        raise ImuAllanError(f'a coast of {coast_s:g} s is shorter than an aiding interval of '
                            f'{aiding_s:g} s: a filter is unaided for at least one interval')
    return (aiding_s, coast_s,
            None if time_s is None else positive_time('correlation_time_s', time_s))
