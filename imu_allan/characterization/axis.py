# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""From an estimator to the result of every axis, in one module as a field takes a few lines."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import floor, log10

from imu_allan.characterization.findings import (
    constant_remark,
    deadband_remark,
    fit_remarks,
    leaving_remark,
    saturated_remark,
    steadiness_remarks,
    step_remarks,
    still_remark,
)
from imu_allan.finding import Finding
from imu_allan.noise.axis_fit import AxisFit, fit_axes
from imu_allan.noise.chi_square import NORMAL95
from imu_allan.noise.curve import edf, interval, Octaves, octaves
from imu_allan.noise.drift_level import drift_levels, drift_of_means
from imu_allan.noise.drift_model import fit_drift_model
from imu_allan.noise.faults.axis_fault import (
    axis_fault,
    AxisFault,
    Constant,
    sample_noise,
    StoodStill,
)
from imu_allan.noise.faults.saturation import CutOff
from imu_allan.noise.fitted_model import FittedModel, with_model_curve
from imu_allan.noise.outlook import outlook
from imu_allan.noise.posterior.answer import Estimate
from imu_allan.noise.posterior.report import AxisReport
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.record.groups import Groups, WHITE
from imu_allan.noise.record.signal_over_time import Columns
from imu_allan.noise.stationarity import SegmentPowers, white_ratio
from imu_allan.noise.terms import Quantity, SLOW_TERMS, TERMS
from imu_allan.noise.tones import strongest
from imu_allan.result import (
    AxisResult,
    Coefficient,
    Curve,
    Deadband,
    DriftModel,
    GoodnessOfFit,
    Interval,
    Saturation,
    Segment,
    Signal,
    Span,
    Spectrum,
    Stationarity,
)
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

_CERTAIN = 0.9998
"""Level of the interval that the model has to lie in: 1 point in 5000 is outside by chance."""
_SLIGHT = 0.05
"""Relative distance from that interval that a user does not care about."""
_FEW = 64.0
"""Degrees of freedom up to which a point of the curve belongs to the slow end."""
_MOST_TOO_LOW = 0.9
"""Share: beyond, the interval has no upper end that says anything. A judgment."""
_HINTED = 0.25
"""Presence of a term from which on there is something that a longer record may show."""
_NO_DENSITY = 1e-60
"""Where none was seen: a density whose fourth power is a number."""
_DIGITS_OF_RANGE = 5
"""Decimal digits of the signal over time, counted from those of its range."""


def characterize(samples: ArrayLike, sample_rate_hz: float,
                 quantity: str = 'angular_velocity') -> AxisResult:
    """
    Characterize one axis from evenly spaced samples.

    The coefficients of equation (1) of docs/statistics.md, by (7); the curve is (4).

    Parameters
    ----------
    samples : array_like, shape (n,)
        In rad/s or m/s^2, the sensor at rest.
    sample_rate_hz : float
        Samples per second.
    quantity : {'angular_velocity', 'linear_acceleration'}, optional
        What the axis measures.

    Returns
    -------
    AxisResult
        The axis object of a result file, SI units.

    Raises
    ------
    ValueError
        If `samples` is not one-dimensional or not finite, the rate is not positive, or the
        quantity is unknown.

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
    if not sample_rate_hz > 0 or not np.isfinite(sample_rate_hz):
        raise ValueError(f'sample_rate_hz must be positive, not {sample_rate_hz}')
    if quantity not in list(Quantity):
        known = ' or '.join(repr(one.value) for one in Quantity)
        raise ValueError(f'quantity must be {known}, not {quantity!r}')
    array = np.asarray(samples, dtype=np.float64)
    if array.ndim != 1:
        raise ValueError(f'samples must have one dimension, not {array.ndim}')
    estimator = Estimator()
    estimator.update(array)
    return axis_results(estimator, sample_rate_hz, [Quantity(quantity)])[0][0]


def axis_results(estimator: Estimator, sample_rate_hz: float, quantities: Sequence[Quantity],
                 fits: Sequence[AxisFit | None] | None = None
                 ) -> list[tuple[AxisResult, list[Finding]]]:
    """
    Fit every axis of an estimator, which is left as it is.

    Parameters
    ----------
    estimator : Estimator
        What has taken in the samples.
    sample_rate_hz : float
        Samples per second.
    quantities : sequence of Quantity
        What each axis measures.
    fits : sequence of AxisFit or None, optional
        Of every axis, where they are there already, or not those of the estimator alone.

    Returns
    -------
    list of (AxisResult, list of Finding)
        What is worth telling the user beside each axis; messages do not name the axis.

    """
    finished = estimator.finished()
    dt = 1.0 / sample_rate_hz
    points = octaves(finished)
    mean = finished.mean
    noise = sample_noise(finished)
    columns = finished.signal.columns()
    signals = _signals(finished, columns, dt)
    found = []
    fits = fit_axes(finished, dt) if fits is None else fits
    for axis, (quantity, fitted_axis) in enumerate(zip(quantities, fits, strict=True)):
        base = replace(_empty(quantity, float(mean[axis]) if finished.samples else None),
                       signal=signals[axis])
        remarks: list[Finding] = []
        if fitted_axis is None:
            fault = axis_fault(finished, axis)
            curve = (_flat_curve(points, dt) if isinstance(fault, Constant)
                     else _curve(points, axis, dt, {}))
            if fault is not None:
                base, remarks = _with_fault(base, fault, quantity, dt)
            found.append((replace(base, curve=curve), remarks))
            continue
        steps = step_remarks(float(finished.census.step[axis]), float(noise[axis]), quantity)
        fitted = fitted_axis.fit
        if steps:
            # Counts that come one by one leave little below their rate, as a filter does.
            fitted = replace(fitted, high_pass_hz=None)
        named, weaker = strongest(fitted_axis.lines)
        remarks = [*fit_remarks(fitted, quantity), *steps]
        process = fitted.gauss_markov
        drift = None if fitted.high_pass_hz is not None else fit_drift_model(
            fitted_axis.groups, dt, process.correlation_time_s if process else None)
        parts = _stationarity(fitted_axis, axis, dt, finished, drift)
        if parts is not None and fitted_axis.steadiness is not None:
            remarks += steadiness_remarks(fitted_axis.steadiness, parts.segments)
        seen = {key: e.observable for key, e in fitted.estimates.items()}
        hinted = {key: e.value if e.presence > _HINTED else 0.0
                  for key, e in fitted.estimates.items()}
        # A longer record would know a power law better, too: of that there is no forecast.
        forecast = ({} if fitted.power_law is not None
                    else outlook(hinted, seen, dt, finished.samples * dt))
        if fitted.walk_unclear or fitted.bias_step is not None:
            # A longer record shows what it is, not how large.
            forecast['rate_random_walk'] = None, None
        if fitted.high_pass_hz is not None:
            forecast |= dict.fromkeys(SLOW_TERMS, (None, None))
        coefficients = {
            key: replace(_coefficient(key, quantity, estimate, forecast.get(key, (None, None))),
                         between=fitted.between.get(key))
            for key, estimate in fitted.estimates.items()}
        curve = _curve(points, axis, dt, fitted.values, _law_of(fitted))
        if fitted.high_pass_hz is None:
            highest = interval(points.avar[:, axis], np.array(curve.edf), _CERTAIN)[1]
            coefficients |= {key: _below_curve(coefficients[key], key, curve, highest)
                             for key in SLOW_TERMS}
        leaves_at = None if fitted.mean_moves or fitted.high_pass_hz else _leaves_at(
            points, axis, curve, [_fitted(fitted_axis, drift), _fitted(fitted_axis, None)], dt)
        if leaves_at is not None and fitted.acceptable:
            remarks.append(leaving_remark(leaves_at))
        found.append((with_model_curve(replace(
            base,
            band_limit_s=fitted.window_s,
            band_edge_hz=fitted.edge_hz,
            tones=named,
            weaker_tones=weaker,
            coefficients={key: coefficients[key] for key in TERMS},
            goodness_of_fit=GoodnessOfFit(fitted.p_value, fitted.misfit,
                                          fitted.acceptable and leaves_at is None),
            curve=curve,
            drift_model=drift,
            gauss_markov=fitted.gauss_markov,
            power_law=fitted.power_law,
            high_passed_hz=fitted.high_pass_hz,
            spectrum=_spectrum(fitted_axis.whole),
            trend=fitted.trend,
            stationarity=parts,
            coarse_step=float(finished.census.step[axis]) if steps else None,
        )), remarks))
    return found


def _with_fault(axis: AxisResult, fault: AxisFault, quantity: Quantity, dt: float
                ) -> tuple[AxisResult, list[Finding]]:
    """Enter into an axis why it does not measure, and say so."""
    match fault:
        case Constant(value):
            return axis, [constant_remark(value, quantity)]
        case Deadband():
            return replace(axis, deadband=fault), [deadband_remark(fault, quantity)]
        case StoodStill(first, samples):
            span = Span(first * dt, samples * dt)
            return replace(axis, stood_still=span), [still_remark(span)]
        case CutOff(value, share):
            return (replace(axis, saturated=Saturation(value, share)),
                    [saturated_remark(fault, quantity)])


def bounded(axis: AxisResult) -> AxisResult:
    """Return an axis whose slow terms are upper bounds: something else may have made them."""
    return with_model_curve(replace(axis, coefficients=dict(axis.coefficients) | {
        key: _upper_bound(axis.coefficients[key]) for key in SLOW_TERMS}))


def unsteady(axis: AxisResult) -> AxisResult:
    """
    Return an axis whose noise is known not to stay the same, whatever its segments say.

    Its intervals stay as they are: it is drift over a filter's horizon that differs, of which no
    coefficient alone speaks.
    """
    if axis.stationarity is None:
        return axis
    return replace(axis, stationarity=replace(axis.stationarity, steady=False))


def widened(axis: AxisResult, too_low: float, too_high: float) -> AxisResult:
    """Return an axis whose noise density may be off by such shares, too, beside chance."""
    if not (too_low or too_high):
        return axis
    found = axis.coefficients['noise_density']
    most = 1 / (1 - min(too_low, _MOST_TOO_LOW))
    if found.ci95 is not None:
        low, high = found.ci95
        found = replace(found, ci95=(low / (1 + too_high), high * most))
    if found.upper95 is not None:
        found = replace(found, upper95=found.upper95 * most)
    return replace(axis, coefficients=dict(axis.coefficients) | {'noise_density': found})


def _upper_bound(found: Coefficient) -> Coefficient:
    """Return what was found as the most that it may be."""
    if not found.observable or found.ci95 is None:
        return found
    return replace(found, observable=False, value=None, ci95=None, upper95=found.ci95[1],
                   observable_in_s=None, ci_halves_in_s=None)


def _empty(quantity: Quantity, mean: float | None) -> AxisResult:
    nothing = {key: Coefficient(term.symbol, term.unit(quantity), False, None, None, None)
               for key, term in TERMS.items()}
    return AxisResult(quantity.value, quantity.unit, mean, None, (), nothing,
                      GoodnessOfFit(None, None, False), Curve((), (), (), (), (), ()))


def _law_of(fitted: AxisReport) -> tuple[float, float] | None:
    """Give amplitude and exponent of slow noise that is no flicker."""
    law = fitted.power_law
    return None if law is None else (law.amplitude, law.exponent)


def _stationarity(found: AxisFit, axis: int, dt: float, finished: Estimator,
                  model: DriftModel | None) -> Stationarity | None:
    """Give the segments of an axis, each with its own mean, density and drift."""
    powers, steady = found.segments, found.steadiness
    if powers is None or steady is None or finished.reference is None:
        return None
    frequency = powers.frequency / dt
    density = found.fit.estimates['noise_density']
    model_of = FittedModel(found.fit.values, power_law=_law_of(found.fit))
    ratio = white_ratio(powers, axis, density.value**2, model_of.density(frequency, dt),
                        frequency < (found.fit.edge_hz or np.inf)) if density.observable else None
    drift = _drift_levels(powers, axis, dt, max(density.value, _NO_DENSITY)**2, model)
    segments = []
    for number, (start, count) in enumerate(zip(powers.start, powers.duration, strict=True)):
        own, interval = None, None
        if ratio is not None:
            own = float(density.value * ratio[0][number])
            error = NORMAL95 * float(ratio[1][number])
            interval = own * (1 - error), own * (1 + error)
        segments.append(Segment(
            float(start * dt), float(count * dt),
            float(finished.reference[axis] + powers.mean[axis, number]), own, interval,
            *drift[number]))
    return Stationarity(steady.steady, steady.p_value, tuple(segments))


def _drift_levels(powers: SegmentPowers, axis: int, dt: float, white: float,
                  model: DriftModel | None) -> list[tuple[float, Interval]]:
    """Tell the level of the drift in every segment; most of them have parts of one length."""
    found: dict[int, tuple[float, Interval]] = {}
    for length in np.unique(powers.drift_samples):
        here = np.flatnonzero(powers.drift_samples == length)
        parts = round(float(powers.duration[here[0]] / length))
        shape = np.zeros((parts, parts)) if model is None else drift_of_means(
            model, float(length) * dt, parts)
        levels = drift_levels(powers.drift[axis, here]**2, white / (float(length) * dt), shape)
        found |= dict(zip(here.tolist(), levels, strict=True))
    return [found[number] for number in range(len(powers.start))]


def _spectrum(groups: Groups) -> Spectrum:
    return Spectrum(tuple(groups.frequency.tolist()), tuple(_density(groups).tolist()))


def _density(groups: Groups) -> Array:
    """Density of an axis: a column for unit white noise turns power into it, at every stage."""
    return groups.power / groups.design[:, WHITE]


def _coefficient(key: str, quantity: Quantity, estimate: Estimate,
                 forecast: tuple[float | None, float | None]) -> Coefficient:
    term = TERMS[key]
    unit = term.unit(quantity)
    if estimate.observable:
        return Coefficient(term.symbol, unit, True, float(estimate.value),
                           (float(estimate.low), float(estimate.high)), None, None, forecast[1],
                           presence=float(estimate.presence))
    upper = float(estimate.upper) if np.isfinite(estimate.upper) else None
    return Coefficient(term.symbol, unit, False, None, None, upper, forecast[0], None,
                       presence=float(estimate.presence))


def _signals(finished: Estimator, columns: Columns, dt: float) -> list[Signal | None]:
    """Return the signal of every axis over time; None before the first sample."""
    if finished.reference is None:
        return [None] * finished.axes
    signals: list[Signal | None] = []
    for axis, reference in enumerate(finished.reference):
        spread = float(np.nanmax(columns.high[axis]) - np.nanmin(columns.low[axis]))
        # A hundred thousandth of the range is far below what a picture shows, and short in JSON.
        digits = max(0, _DIGITS_OF_RANGE - floor(log10(spread))) if spread > 0 else 17

        def written(values: Array, offset: float = float(reference),
                    digits: int = digits) -> tuple[float | None, ...]:
            return tuple(None if np.isnan(value) else round(value + offset, digits)
                         for value in values.tolist())

        signals.append(Signal(columns.width * dt, written(columns.low[axis]),
                              written(columns.mean[axis]), written(columns.high[axis])))
    return signals


def _flat_curve(points: Octaves, dt: float) -> Curve:
    """Deviation 0 at every averaging time: a constant signal."""
    n = len(points.size)
    dof = tuple(edf({'noise_density': 1.0}, int(m), int(s), int(c), dt)
                for m, s, c in zip(points.size, points.stride, points.count, strict=True))
    zero = (0.0,) * n
    nothing = ((0.0, 0.0),) * n
    return Curve(tuple((points.size * dt).tolist()), zero, dof, nothing, nothing, zero)


def _fitted(found: AxisFit, drift: DriftModel | None) -> FittedModel:
    """
    Describe all that was fitted, reported or not: the drift model where there is one, or terms.

    The drift model is for the slow end of what the terms may miss; beside a power law they miss
    nothing.
    """
    values = found.fit.values
    processes: tuple[tuple[float, float], ...] = ()
    law = _law_of(found.fit)
    if drift is not None and law is None:
        values = {'quantization_noise': values['quantization_noise'],
                  'noise_density': drift.noise_density,
                  'rate_random_walk': drift.rate_random_walk}
        processes = tuple((p.sigma, p.correlation_time_s) for p in drift.processes)
    elif found.fit.gauss_markov:
        process = found.fit.gauss_markov
        processes = ((process.sigma, process.correlation_time_s),)
    return FittedModel(values, found.fit.window_s, processes, tuple(found.lines), law)


def _curve(points: Octaves, axis: int, dt: float, values: Mapping[str, float],
           law: tuple[float, float] | None = None) -> Curve:
    """Allan deviation of one axis without a model, and the intervals of the fitted terms."""
    if not len(points.size):
        return Curve((), (), (), (), (), ())
    tau: Array = (points.size * dt).astype(np.float64)
    avar = points.avar[:, axis]
    dof = np.array([edf(values, int(m), int(s), int(c), dt, law)
                    for m, s, c in zip(points.size, points.stride, points.count, strict=True)])
    return Curve(tuple(tau.tolist()), tuple(np.sqrt(avar).tolist()), tuple(dof.tolist()),
                 _pairs(avar, dof, 0.6827), _pairs(avar, dof, 0.95),
                 (0.0,) * len(tau))


def _below_curve(found: Coefficient, key: str, curve: Curve, highest: Array) -> Coefficient:
    """Return a bound that the measured curve allows: no term alone lies above it."""
    if found.upper95 is None or not len(highest):
        return found
    most = float(np.min(highest / TERMS[key].adev(1.0, np.array(curve.tau_s))))
    return replace(found, upper95=min(found.upper95, most))


def _leaves_at(points: Octaves, axis: int, curve: Curve, models: Sequence[FittedModel], dt: float
               ) -> float | None:
    """
    Averaging time from which the measured curve lies outside the bands of all models, if it does.

    The residuals of the spectrum do not show it: the slow end has only a few of them. The fast
    end is theirs. A drift model knows little of the fast noise in a short record; only where the
    fitted terms, too, lie outside there is no description.
    """
    dof = np.array(curve.edf)
    low, high = interval(points.avar[:, axis], dof, _CERTAIN)
    outside = dof < _FEW
    for model in models:
        adev = np.sqrt(model.allan_variance(points.size, dt))
        outside &= (adev < low * (1 - _SLIGHT)) | (adev > high * (1 + _SLIGHT))
    return float(curve.tau_s[int(np.argmax(outside))]) if outside.any() else None


def _pairs(avar: Array, dof: Array, level: float) -> tuple[Interval, ...]:
    low, high = interval(avar, dof, level)
    return tuple(zip(low.tolist(), high.tolist(), strict=True))
