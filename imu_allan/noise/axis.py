# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""From a finished estimator to the result of every axis."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from imu_allan.noise.curve import edf, interval, Octaves, octaves
from imu_allan.noise.estimator import Estimator
from imu_allan.noise.fit import Estimate, Fit, fit
from imu_allan.noise.likelihood import bins_of, grouped, maximise, WHITE
from imu_allan.noise.outlook import outlook
from imu_allan.noise.terms import (
    allan_variance,
    gauss_markov_avar,
    low_passed_avar,
    Quantity,
    TERMS,
)
from imu_allan.noise.tones import find_lines, Line
from imu_allan.result import (
    AxisResult,
    Coefficient,
    Curve,
    GaussMarkov,
    GoodnessOfFit,
    Interval,
    Remark,
    Spectrum,
    Tone,
)
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

SHORTEST_RECORD = 64
"""Samples below which no coefficient is estimated."""


def characterize(samples: ArrayLike, sample_rate_hz: float,
                 quantity: str = 'angular_velocity') -> AxisResult:
    """
    Characterize one axis from evenly spaced samples.

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

    """
    if not sample_rate_hz > 0 or not np.isfinite(sample_rate_hz):
        raise ValueError(f'sample_rate_hz must be positive, not {sample_rate_hz}')
    array = np.asarray(samples, dtype=np.float64)
    if array.ndim != 1:
        raise ValueError(f'samples must have one dimension, not {array.ndim}')
    estimator = Estimator()
    estimator.update(array)
    return axis_results(estimator, sample_rate_hz, [Quantity(quantity)])[0][0]


@dataclass(frozen=True)
class AxisFit:
    """What the spectrum of one axis says: the fitted terms, the lines left out, and itself."""

    fit: Fit
    lines: list[Line]
    spectrum: Spectrum


def fit_axes(finished: Estimator, dt: float) -> list[AxisFit | None]:
    """
    Fit the spectrum of every axis.

    Parameters
    ----------
    finished : Estimator
        As `Estimator.finished` returns it.
    dt : float
        Sample interval in seconds.

    Returns
    -------
    list of AxisFit or None
        None for an axis that is constant, or a record that is too short.

    """
    pieces = finished.periodogram.pieces() if finished.samples >= SHORTEST_RECORD else []
    if not pieces:
        return [None] * finished.axes
    bins = bins_of(pieces, dt, finished.bridged / finished.samples)
    found: list[AxisFit | None] = []
    for axis in range(finished.axes):
        if finished.lowest[axis] == finished.highest[axis]:
            found.append(None)
            continue
        whole = grouped(bins, axis)
        first = maximise(whole, ramp=None)
        lines, keep = find_lines(pieces, bins, axis, dt, first)
        fitted = fit(whole if keep.all() else grouped(bins, axis, keep), dt, first)
        # A column for unit white noise turns power into density, whatever stage it comes from.
        density = whole.power / whole.design[:, WHITE]
        found.append(AxisFit(fitted, lines, Spectrum(tuple(whole.frequency.tolist()),
                                                     tuple(density.tolist()))))
    return found


def axis_results(estimator: Estimator, sample_rate_hz: float, quantities: Sequence[Quantity]
                 ) -> list[tuple[AxisResult, list[Remark]]]:
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

    Returns
    -------
    list of (AxisResult, list of Remark)
        What is worth telling the user beside each axis; messages do not name the axis.

    """
    finished = estimator.finished()
    dt = 1.0 / sample_rate_hz
    points = octaves(finished)
    mean = finished.mean
    noise = sample_noise(finished)
    found = []
    for axis, (quantity, fitted_axis) in enumerate(
            zip(quantities, fit_axes(finished, dt), strict=True)):
        base = _empty(quantity, float(mean[axis]) if finished.samples else None)
        remarks: list[Remark] = []
        if fitted_axis is None:
            if finished.samples and finished.lowest[axis] == finished.highest[axis]:
                remarks.append(Remark('constant_axis',
                                      f'every sample is {mean[axis]:g} {quantity.unit}: '
                                      'there is no noise to measure'))
                curve = _flat_curve(points, dt)
            else:
                curve = _curve(points, axis, dt, {}, None)
            found.append((replace(base, curve=curve), remarks))
            continue
        fitted, lines = fitted_axis.fit, fitted_axis.lines
        remarks += _fit_remarks(fitted, quantity)
        step = finished.step[axis]
        if np.isfinite(step) and step > noise[axis] > 0:
            remarks.append(Remark(
                'coarse_resolution',
                f'the output steps by {step:.3g} {quantity.unit}, {step / noise[axis]:.1f} times '
                'the noise of one sample: what lies below the step is hidden'))
        values = {key: estimate.value for key, estimate in fitted.estimates.items()}
        forecast = outlook(values, {key: e.observable for key, e in fitted.estimates.items()},
                           dt, finished.samples * dt)
        coefficients = {
            key: _coefficient(key, quantity, estimate, forecast.get(key, (None, None)))
            for key, estimate in fitted.estimates.items()}
        found.append((replace(
            base,
            band_limit_s=fitted.window_s,
            tones=tuple(Tone(line.frequency_hz, line.amplitude) for line in lines),
            coefficients={key: coefficients[key] for key in TERMS},
            goodness_of_fit=GoodnessOfFit(fitted.p_value, fitted.misfit, fitted.acceptable),
            curve=_curve(points, axis, dt, values, fitted),
            gauss_markov=GaussMarkov(*fitted.gauss_markov) if fitted.gauss_markov else None,
            spectrum=fitted_axis.spectrum,
        ), remarks))
    return found


def _empty(quantity: Quantity, mean: float | None) -> AxisResult:
    nothing = {key: Coefficient(term.symbol, term.unit(quantity), False, None, None, None)
               for key, term in TERMS.items()}
    return AxisResult(quantity.value, quantity.unit, mean, None, (), nothing,
                      GoodnessOfFit(None, None, False), Curve((), (), (), (), (), ()))


def _coefficient(key: str, quantity: Quantity, estimate: Estimate,
                 forecast: tuple[float | None, float | None]) -> Coefficient:
    term = TERMS[key]
    unit = term.unit(quantity)
    if estimate.observable:
        return Coefficient(term.symbol, unit, True, float(estimate.value),
                           (float(estimate.low), float(estimate.high)), None, None, forecast[1])
    upper = float(estimate.upper) if np.isfinite(estimate.upper) else None
    return Coefficient(term.symbol, unit, False, None, None, upper, forecast[0], None)


def _fit_remarks(fitted: Fit, quantity: Quantity) -> list[Remark]:
    remarks = []
    if fitted.window_s is not None and fitted.edge_hz is not None:
        remarks.append(Remark(
            'band_limited',
            f'the spectrum is bent above {fitted.edge_hz:.3g} Hz (a low-pass in sensor or driver, '
            'or noise that no term describes); the coefficients are fitted below'))
    elif fitted.window_s is not None:
        remarks.append(Remark(
            'band_limited',
            'the noise rolls off towards the highest frequencies (a low-pass in sensor or '
            f'driver): its effective window is {fitted.window_s:.3g} s'))
    if not fitted.acceptable:
        remarks.append(Remark(
            'poor_fit',
            'no sum of noise terms describes this spectrum (worst half-octave off by '
            f'{100 * fitted.misfit:.0f} %); the intervals are widened accordingly'))
    if fitted.gauss_markov:
        sigma, time = fitted.gauss_markov
        remarks.append(Remark(
            'gauss_markov',
            f'a first-order Gauss-Markov process of {sigma:.3g} {quantity.unit} with a '
            f'correlation time of {time:.3g} s is part of the noise'))
    return remarks


def sample_noise(finished: Estimator) -> Array:
    """Return the noise of one sample about its neighbours, shape (axes,); 0 when unknown."""
    pyramid = finished.pyramid
    # White noise: the mean squared second difference of phase over single samples is 2 sigma^2.
    return np.asarray(np.sqrt(pyramid.sums[0] / max(2 * pyramid.counts[0], 1)))


def _flat_curve(points: Octaves, dt: float) -> Curve:
    """Deviation 0 at every averaging time: a constant signal."""
    n = len(points.size)
    dof = tuple(edf({'noise_density': 1.0}, int(m), int(s), int(c), dt)
                for m, s, c in zip(points.size, points.stride, points.count, strict=True))
    zero = (0.0,) * n
    nothing = ((0.0, 0.0),) * n
    return Curve(tuple((points.size * dt).tolist()), zero, dof, nothing, nothing, zero)


def _curve(points: Octaves, axis: int, dt: float, values: dict[str, float], fitted: Fit | None
           ) -> Curve:
    """Allan deviation of one axis with the intervals of the fitted terms."""
    if not len(points.size):
        return Curve((), (), (), (), (), ())
    tau: Array = (points.size * dt).astype(np.float64)
    avar = points.avar[:, axis]
    dof = np.array([edf(values, int(m), int(s), int(c), dt)
                    for m, s, c in zip(points.size, points.stride, points.count, strict=True)])
    return Curve(tuple(tau.tolist()), tuple(np.sqrt(avar).tolist()), tuple(dof.tolist()),
                 _pairs(avar, dof, 0.6827), _pairs(avar, dof, 0.95),
                 tuple(np.sqrt(_model_avar(points.size, dt, values, fitted)).tolist()))


def _pairs(avar: Array, dof: Array, level: float) -> tuple[Interval, ...]:
    low, high = interval(avar, dof, level)
    return tuple(zip(low.tolist(), high.tolist(), strict=True))


def _model_avar(size: NDArray[np.int64], dt: float, values: dict[str, float], fitted: Fit | None
                ) -> Array:
    """Allan variance of the fitted model, roll-off and Gauss-Markov process included."""
    tau = size * dt
    if fitted is None:
        return allan_variance(values, tau)
    total = np.zeros(len(size))
    if fitted.window_s is not None:
        density = values['noise_density']
        values = {**values, 'noise_density': 0.0}
        total = total + low_passed_avar(density, fitted.window_s, size, dt)
    if fitted.gauss_markov:
        total = total + gauss_markov_avar(*fitted.gauss_markov, tau)
    return np.asarray(total + allan_variance(values, tau))
