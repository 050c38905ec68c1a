# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Report of one axis, derived from the posterior over its noise models.

A term is reported if it is probably present; otherwise it has an upper bound. Trends of the mean,
the kind of slow noise and filters are derived from the same models.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from imu_allan.arrays import Array
from imu_allan.noise.chi_square import NORMAL95
from imu_allan.noise.posterior import estimates, thresholds_and_priors as thresholds
from imu_allan.noise.posterior.estimates import Estimate, ReportedTrend
from imu_allan.noise.posterior.posterior import Posterior
from imu_allan.noise.posterior.random_walk_persists import random_walk_persists
from imu_allan.noise.record.groups import Groups
from imu_allan.noise.trends.regressors import RecordSpectrum
from imu_allan.noise.trends.temperature_series import TemperatureSeries
from imu_allan.result import GaussMarkov, PowerLaw, Ramp, TemperatureDependence, Trend, WarmUp
import numpy as np


@dataclass(frozen=True)
class BiasStep:
    """Single step of the mean: time in seconds from the start of the record, and size."""

    at_s: float
    size: float


@dataclass(frozen=True)
class AxisReport:
    """
    Reported results of one axis.

    Attributes
    ----------
    estimates : dict
        By key of `TERMS`.
    p_value, misfit : float
        As in `Goodness`.
    acceptable : bool
        Whether the model describes enough of the spectrum, with tolerable residuals.
    window_s : float or None
        Effective averaging window of a low-pass, if there is one.
    passed : tuple of ndarray or None
        Frequencies in Hz, and the share of the white noise that a low-pass lets pass there.
    edge_hz : float or None
        Highest frequency that the model describes, if it leaves the top unexplained.
    high_pass_hz : float or None
        Corner of a filter that removes the bias.
    gauss_markov : GaussMarkov or None
    power_law : PowerLaw or None
        Slow noise whose exponent is not that of flicker; flicker then has only an upper bound.
    random_walk_unclear : bool
        Whether there is slow noise or drift that could not be identified.
    trend : Trend
        Deterministic drift of the mean.
    bias_step : BiasStep or None
    between : dict
        Standard deviation between parts of the record beyond their errors, by key of `TERMS`.

    """

    estimates: dict[str, Estimate]
    p_value: float
    misfit: float
    acceptable: bool
    window_s: float | None = None
    passed: tuple[Array, Array] | None = None
    edge_hz: float | None = None
    high_pass_hz: float | None = None
    gauss_markov: GaussMarkov | None = None
    power_law: PowerLaw | None = None
    random_walk_unclear: bool = False
    trend: Trend = field(default_factory=Trend)
    bias_step: BiasStep | None = None
    between: Mapping[str, float] = field(default_factory=dict)

    @property
    def values(self) -> dict[str, float]:
        """Return the most probable values of the terms by key, zero for absent terms."""
        likely = {key: one.value if one.presence > thresholds.OBSERVABLE else 0.0
                  for key, one in self.estimates.items()}
        if not self.estimates['rate_ramp'].observable:
            likely['rate_ramp'] = 0.0
        if self.power_law is not None:
            likely['bias_instability'] = 0.0
        return likely

    def bounded(self, *keys: str) -> 'AxisReport':
        """Return the report with some of the terms as upper bounds."""
        bounds = {key: replace(self.estimates[key], observable=False) for key in keys}
        return replace(self, estimates={**self.estimates, **bounds})


def reported(posterior: Posterior, dt: float, temperature: TemperatureSeries | None = None,
             record: RecordSpectrum | None = None,
             quarters: Sequence[Callable[[], list[Groups]]] = ()) -> AxisReport:
    """
    Derive the report of one axis from its posterior.

    `dt`: sample interval in seconds. `temperature`: that the trends were made from. `record`: to
    estimate the ramp from, including the uncertainty of other trends. `quarters`: returns those
    of each record, which have to confirm a random walk.
    """
    found = estimates.marginals(posterior, dt)
    sigma, time, exponent, amplitude, corner = (found.pop(key) for key in (
        'sigma', 'correlation_time', 'exponent', 'amplitude', 'corner'))
    ramp = estimates.ramp_of(posterior, record)
    found['rate_ramp'] = ramp
    if exponent.observable:
        found['bias_instability'] = replace(found['bias_instability'], observable=False)
    # A high-pass takes drift out; what is left fits its own settling, or ends of the record.
    moving = () if corner.observable else estimates.reported_trends(posterior, record)
    if sum(one.trend.kind.key == 'bias_step' for one in moving) > 1:
        # Two steps may as well be a bump or something else.
        moving = tuple(one for one in moving if one.trend.kind.key != 'bias_step')
    # Slower than the record, a warm-up may only bend the mean: then its size is not known.
    moving = tuple(one for one in moving if one.trend.kind.key != 'warm_up' or record is None
                   or one.trend.value <= record.duration_s
                   or abs(one.columns[0][0]) > NORMAL95 * one.columns[0][1])
    identified = (sigma.observable or exponent.observable or bool(moving) or ramp.observable
                  or found['rate_random_walk'].observable)
    unclear = not identified and (
        estimates.weight_of(posterior, estimates.drifts) > thresholds.REPORTED)
    walk = found['rate_random_walk']
    if walk.observable and not corner.observable and not random_walk_persists(
            posterior, [of_record() for of_record in quarters], dt):
        # It may have another cause.
        found['rate_random_walk'], unclear = replace(walk, observable=False), True
    change, edge = posterior.change.typical, posterior.edge
    edge_hz = None if edge is None else float(posterior.models[0].spectra.frequency[edge - 1])
    filtered = estimates.filtered(posterior)
    by_kind = {one.trend.kind.key: one for one in moving}
    step, cycle, heat = (by_kind.get(key) for key in ('bias_step', 'slow_cycle', 'temperature'))
    warm = sorted((_warm_up(one) for one in moving if one.trend.kind.key == 'warm_up'),
                  key=lambda one: -abs(one.amplitude))
    process = GaussMarkov(sigma.value, time.value, sigma.interval, time.interval)
    law = PowerLaw(exponent.value, exponent.interval,
                   amplitude.value**2 / (2 * np.pi)**exponent.value)
    trend = Trend(
        Ramp(ramp.value, ramp.interval) if ramp.observable else None, warm[0] if warm else None,
        _dependence(heat, temperature) if heat and temperature else None,
        warm[1] if len(warm) > 1 else None, 1 / cycle.trend.value if cycle else None)
    goodness = posterior.goodness
    return AxisReport(
        found, goodness.p_value, goodness.misfit, goodness.acceptable,
        estimates.window_of(filtered, edge, dt) if filtered else None,
        estimates.passed_by(filtered) if filtered else None, edge_hz,
        corner.value if corner.observable else None, process if sigma.observable else None,
        law if exponent.observable else None, trend=trend,
        random_walk_unclear=unclear,
        bias_step=BiasStep(step.trend.value, step.columns[0][0]) if step else None,
        between={'noise_density': found['noise_density'].value * change / 2} if change > 0 else {})


def _warm_up(warming: ReportedTrend) -> WarmUp:
    trend, [(size, error)] = warming
    half = NORMAL95 * error
    return WarmUp(size, trend.value, (size - half, size + half), trend.interval)


def _dependence(heating: ReportedTrend, temperature: TemperatureSeries) -> TemperatureDependence:
    trend, [(size, error)] = heating
    half, (low, high) = NORMAL95 * error, trend.interval
    lags = not low <= 0 <= high
    return TemperatureDependence(
        size, (size - half, size + half), temperature.lowest, temperature.highest,
        trend.value if lags else None, trend.interval if lags else None)
