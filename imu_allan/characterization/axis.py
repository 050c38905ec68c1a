# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The result of every axis from an estimator; one module, as each field takes a few lines."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import floor, log10
from warnings import warn

from imu_allan.arrays import Array
from imu_allan.characterization.noise_findings import fit_findings, steadiness_findings
from imu_allan.errors import positive
from imu_allan.finding import Finding, finding
from imu_allan.finding_messages import message_of
from imu_allan.noise import faults
from imu_allan.noise.allan_deviation import edf, interval, Octaves, octaves
from imu_allan.noise.axis_fit import AxisFit, fit_axes
from imu_allan.noise.chi_square import NORMAL95
from imu_allan.noise.drift_model import fit_drift_model
from imu_allan.noise.fitted_model import FittedModel, with_model_curve
from imu_allan.noise.posterior.estimates import Estimate
from imu_allan.noise.posterior.report import AxisReport
from imu_allan.noise.posterior.thresholds_and_priors import POSSIBLE
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.record.groups import WHITE
from imu_allan.noise.recording_time import further_times
from imu_allan.noise.stationarity import white_ratio
from imu_allan.noise.terms import Quantity, SLOW_TERMS, TERMS
from imu_allan.noise.uncertainty import CERTAIN, most_below
from imu_allan.result import (
    AxisResult,
    Coefficient,
    Curve,
    Deadband,
    GoodnessOfFit,
    Interval,
    PowerLaw,
    Saturation,
    Segment,
    Signal,
    Span,
    Spectrum,
    Stationarity,
)
import numpy as np
from numpy.typing import ArrayLike


def characterize(samples: ArrayLike, sample_rate_hz: float,
                 quantity: str = 'angular_velocity') -> AxisResult:
    """
    Characterize one axis from evenly spaced samples.

    The coefficients are those of equation (1) of docs/statistics.md, estimated by (7); the curve
    is (4).

    Parameters
    ----------
    samples : array_like, shape (n,)
        In rad/s or m/s^2, with the sensor at rest.
    sample_rate_hz : float
        Samples per second.
    quantity : {'angular_velocity', 'linear_acceleration'}, optional
        What the axis measures.

    Returns
    -------
    AxisResult
        The axis object of a result file, SI units.

    Warns
    -----
    UserWarning
        If a finding has to be acted upon, as for a recording.

    Raises
    ------
    ValueError
        If `samples` is not one-dimensional, not finite or masked in part, the rate is not
        positive, or the quantity is unknown.

    Examples
    --------
    >>> from imu_allan import simulate
    >>> axis = characterize(simulate({'noise_density': 1e-3}, 20_000, 100.0), 100.0)
    >>> low, high = axis.coefficients['noise_density'].ci95
    >>> low < 1e-3 < high
    True
    >>> axis.coefficients['bias_instability'].observable
    False

    """
    sample_rate_hz = positive('sample_rate_hz', sample_rate_hz)
    if quantity not in list(Quantity):
        known = ' or '.join(repr(one.value) for one in Quantity)
        raise ValueError(f'quantity must be {known}, not {quantity!r}')
    # Once, as it may have to be computed or read.
    samples = np.asanyarray(samples)
    if np.ndim(samples) != 1:
        raise ValueError(f'samples must have one dimension, not {np.ndim(samples)}: '
                         'characterize one axis at a time')
    estimator = Estimator()
    estimator.update(samples)
    estimator.finish()
    [(axis, remarks)] = axis_results(estimator, sample_rate_hz, [Quantity(quantity)])
    for remark in remarks:
        if remark.severity == 'act':
            warn(f'{remark.code}: {message_of(remark)}', stacklevel=2)
    return axis


def axis_results(finished: Estimator, sample_rate_hz: float, quantities: Sequence[Quantity],
                 fits: Sequence[AxisFit | None] | None = None, points: Octaves | None = None
                 ) -> list[tuple[AxisResult, list[Finding]]]:
    """
    Fit every axis of an estimator.

    `finished`: holds the samples, all processed. `quantities`: what each axis measures. `fits`: of
    every axis, if they exist already, or do not come from the estimator alone. `points`: the
    curves, if they do not. Returns: for each axis its result and the findings worth reporting,
    which do not name the axis.
    """
    dt = 1.0 / sample_rate_hz
    points = octaves(finished) if points is None else points
    signals = _signals(finished, dt)
    found = []
    fits = fit_axes(finished, dt) if fits is None else fits
    for axis, (quantity, fitted) in enumerate(zip(quantities, fits, strict=True)):
        nothing = {key: Coefficient(term.symbol, term.unit(quantity), False, None, None, None)
                   for key, term in TERMS.items()}
        mean = float(finished.mean[axis]) if finished.samples else None
        base = AxisResult(quantity.value, quantity.unit, mean, None, (), nothing, GoodnessOfFit(
            None, None, False), Curve((), (), (), (), (), ()), signal=signals[axis])
        found.append(_unfitted(base, finished, axis, points, dt) if fitted is None
                     else _fitted(base, fitted, finished, axis, points, dt))
    return found


def _unfitted(base: AxisResult, finished: Estimator, axis: int, points: Octaves, dt: float
              ) -> tuple[AxisResult, list[Finding]]:
    """Return an axis that could not be fitted, with its fault and the finding about it."""
    base = replace(base, curve=_curve(points, axis, dt, {}))
    match faults.axis_fault(finished, finished.periodogram.sections(), axis, dt):
        case float(value):
            return base, [finding('constant_axis', value=value, unit=base.unit)]
        case Deadband(width, share) as deadband:
            return replace(base, deadband=deadband), [
                finding('deadband', share=share, width=width, unit=base.unit)]
        case Span(start_s, duration_s) as span:
            return replace(base, stood_still=span), [
                finding('stood_still', start_s=start_s, duration_s=duration_s)]
        case Saturation(value, share) as saturated:
            return replace(base, saturated=saturated), [
                finding('saturated', share=share, value=value, unit=base.unit,
                        end='highest' if value > finished.mean[axis] else 'lowest')]
    return base, []


def _fitted(base: AxisResult, found: AxisFit, finished: Estimator, axis: int, points: Octaves,
            dt: float) -> tuple[AxisResult, list[Finding]]:
    """Return an axis with all that was fitted, and the findings worth reporting."""
    fitted = found.fit
    step, noise = float(finished.census.step[axis]), float(faults.sample_noise(finished)[axis])
    coarse = 0 < noise < step < np.inf
    if coarse:
        # Isolated quantization steps leave little power below their rate, like a high-pass filter.
        fitted = replace(fitted, high_pass_hz=None)
    elif fitted.high_pass_hz is not None:
        # The slow noise that remains after such a filter is of no use to anyone.
        fitted = fitted.bounded(*SLOW_TERMS)
    remarks = [*fit_findings(fitted, base.unit)]
    if coarse:
        # An output of two values at random has a ratio of 2, however small the noise behind it.
        remarks.append(finding(
            'coarse_resolution', severity='act' if step > 1.9 * noise else 'know', step=step,
            unit=base.unit, ratio=step / noise))
    process = fitted.gauss_markov
    drift = None if fitted.high_pass_hz is not None else fit_drift_model(
        found.groups, dt, process.correlation_time_s if process else None)
    parts = _stationarity(found, axis, dt, finished)
    if parts is not None and found.steadiness is not None:
        remarks += steadiness_findings(found.steadiness, parts.segments)
    forecast = _forecast(fitted, dt, int(points.count[0]) + 1)
    coefficients = {
        key: replace(_coefficient(base.coefficients[key], fitted.estimates[key],
                                  forecast.get(key)),
                     between=fitted.between.get(key)) for key in TERMS}
    curve = _curve(points, axis, dt, fitted.values, fitted.power_law)
    if fitted.high_pass_hz is None:
        highest = interval(points.avar[:, axis], np.array(curve.edf), CERTAIN)[1]
        for key in (*SLOW_TERMS, 'rate_ramp'):
            most = most_below(np.array(curve.tau_s), highest, key, fitted.window_s)
            if most is not None and (bound := coefficients[key].upper95) is not None:
                coefficients[key] = replace(coefficients[key], upper95=min(bound, most))
    # The design column of unit white noise turns power into density, at every stage.
    density = found.with_lines.power / found.with_lines.design[:, WHITE]
    frequency = found.with_lines.frequency
    passed = () if fitted.passed is None else tuple(np.interp(frequency, *fitted.passed).tolist())
    return with_model_curve(replace(
        base, band_limit_s=fitted.window_s, band_edge_hz=fitted.edge_hz,
        high_passed_hz=fitted.high_pass_hz, tones=tuple(found.lines), coefficients=coefficients,
        goodness_of_fit=GoodnessOfFit(fitted.p_value, fitted.misfit, fitted.acceptable),
        curve=curve, drift_model=drift, gauss_markov=process, power_law=fitted.power_law,
        spectrum=Spectrum(tuple(frequency.tolist()), tuple(density.tolist()), passed),
        trend=fitted.trend, stationarity=parts, coarse_step=step if coarse else None)), remarks


def _forecast(fitted: AxisReport, dt: float, samples: int) -> dict[str, float | None]:
    """Return how much longer to record, for those coefficients that this would help."""
    if fitted.power_law is not None:
        # A longer record would also improve a power law, but there is no forecast of that.
        return {}
    # Of slow terms after a filter, and of a walk that something hides, the size is not known.
    hopeless = SLOW_TERMS if fitted.high_pass_hz is not None else ['rate_random_walk'] * (
        fitted.random_walk_unclear or fitted.bias_step is not None)
    return further_times(
        {key: e.value if e.presence > POSSIBLE else 0.0 for key, e in fitted.estimates.items()},
        {key: e.observable for key, e in fitted.estimates.items()}, dt, samples * dt
    ) | dict.fromkeys(hopeless)


def _stationarity(found: AxisFit, axis: int, dt: float, finished: Estimator
                  ) -> Stationarity | None:
    """Return the segments of an axis, each with its own mean, density and drift."""
    powers, steady = found.segments, found.steadiness
    if powers is None or steady is None or finished.reference is None:
        return None
    frequency = powers.frequency / dt
    density = found.fit.estimates['noise_density']
    model_of = FittedModel(found.fit.values, power_law=found.fit.power_law)
    ratio = white_ratio(powers, axis, density.value**2, model_of.density(frequency, dt),
                        frequency < (found.fit.edge_hz or np.inf)) if density.observable else None
    # White noise in the means of n parts adds (n - 1)/n of its variance to their spread.
    share = 1 - powers.drift_samples / powers.duration
    white = density.value**2 / (powers.drift_samples * dt) * share
    drift = np.sqrt(np.maximum(powers.drift[axis]**2 - white, 0.0))
    mean = finished.reference[axis] + powers.mean[axis]
    segments = []
    for number, (start_s, duration_s, at, moved) in enumerate(np.column_stack((
            powers.start * dt, powers.duration * dt, mean, drift)).tolist()):
        own, interval = None, None
        if ratio is not None:
            own = float(density.value * ratio[0][number])
            error = NORMAL95 * float(ratio[1][number])
            interval = own * (1 - error), own * (1 + error)
        segments.append(Segment(start_s, duration_s, at, own, interval, moved))
    return Stationarity(steady.steady, steady.p_value, tuple(segments))


def _coefficient(unknown: Coefficient, estimate: Estimate, further_s: float | None
                 ) -> Coefficient:
    if estimate.observable:
        return replace(unknown, observable=True, value=estimate.value, ci95=estimate.interval,
                       ci_halves_in_s=further_s, presence=estimate.presence)
    return replace(unknown, upper95=estimate.upper if np.isfinite(estimate.upper) else None,
                   observable_in_s=further_s, presence=estimate.presence)


def _signals(finished: Estimator, dt: float) -> list[Signal | None]:
    """Return the signal of every axis over time; None before the first sample."""
    if finished.reference is None:
        return [None] * finished.axes
    columns = finished.signal.columns()
    signals: list[Signal | None] = []
    for axis, reference in enumerate(finished.reference.tolist()):
        spread = float(np.nanmax(columns.high[axis]) - np.nanmin(columns.low[axis]))
        # 1e-5 of the range is far below what a plot shows, and short in JSON.
        digits = min(max(0, 5 - floor(log10(spread))), 64) if spread > 0 else 17
        rows = np.stack((columns.low[axis], columns.mean[axis], columns.high[axis])) + reference
        shown = rows.round(digits).astype(object)
        shown[np.isnan(rows)] = None
        signals.append(Signal(columns.width * dt, *map(tuple, shown.tolist())))
    return signals


def _curve(points: Octaves, axis: int, dt: float, values: Mapping[str, float],
           law: PowerLaw | None = None) -> Curve:
    """Return the Allan deviation of one axis, with intervals by the fitted terms."""
    tau: Array = (points.size * dt).astype(np.float64)
    avar = points.avar[:, axis]
    dof = np.array([edf(values, int(m), int(s), int(c), dt, law)
                    for m, s, c in zip(points.size, points.stride, points.count, strict=True)])
    return Curve(tuple(tau.tolist()), tuple(np.sqrt(avar).tolist()), tuple(dof.tolist()),
                 _pairs(avar, dof, 0.6827), _pairs(avar, dof, 0.95),
                 (0.0,) * len(tau))


def _pairs(avar: Array, dof: Array, level: float) -> tuple[Interval, ...]:
    low, high = interval(avar, dof, level)
    return tuple(zip(low.tolist(), high.tolist(), strict=True))
