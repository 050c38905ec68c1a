# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Arrays to draw for a result, shared by pictures and page so that they agree.

They are curves, spectra and axis limits; nothing here depends on how they are drawn.
"""

from collections.abc import Iterable, Mapping
from math import inf
from typing import NamedTuple, TypeVar

from imu_allan.arrays import Array
from imu_allan.noise import chi_square
from imu_allan.noise.fitted_model import FittedModel, hidden_avar, reported_model
from imu_allan.noise.terms import AXES, gauss_markov_avar, power_law_avar, Term, TERMS
from imu_allan.result import AxisResult, Coefficient, Signal, Spectrum, Timeline
from imu_allan.sensor.units import engineering, typeset
from imu_allan.wording import bounded, duration, measured, number, SENSORS
import numpy as np

T = TypeVar('T')


def by_sensor(axes: Mapping[str, T]) -> dict[str, dict[str, T]]:
    """Return what is known of axes, apart for gyro and accel, if there is any of them."""
    return {sensor: own for sensor in SENSORS if (own := axes_of(axes, sensor))}


def axes_of(axes: Mapping[str, T], sensor: str) -> dict[str, T]:
    """Return what is known of the axes of gyro or accel, in order."""
    return {name: axes[name] for name in AXES if name.startswith(sensor) and name in axes}


def coefficients_of(axis: AxisResult) -> dict[str, float]:
    """Return the observable coefficients of an axis by key, in SI units."""
    return {key: axis.coefficients[key].value or 0.0 for key in TERMS
            if axis.coefficients[key].observable}


def worst_of(axes: Mapping[str, AxisResult], key: str) -> str | None:
    """Return the axis with the largest value or, if there are no values, the largest bound."""
    seen = {name: axis.coefficients[key] for name, axis in axes.items()}
    values = {name: c.value for name, c in seen.items() if c.value is not None}
    if not values:
        values = {name: c.upper95 for name, c in seen.items() if c.upper95 is not None}
    return max(values, key=values.__getitem__, default=None)


def rate_of(axis: AxisResult, timeline: Timeline) -> float | None:
    """Return the sample rate of an axis, which may differ between the two sensors."""
    return axis.sample_rate_hz or timeline.sample_rate_hz


class ModelCurve(NamedTuple):
    """
    The Allan deviation of a fitted model.

    Attributes
    ----------
    tau : ndarray, shape (n,)
        Averaging times in seconds, from the shortest one that was fitted. Empty if there is no
        model.
    adev : ndarray, shape (n,)
        Allan deviation of the reported terms, in the unit of a sample; NaN where it is zero.
    bound : ndarray, shape (n,)
        Allan deviation with the largest unobservable term at its upper bound; NaN where that makes
        hardly any difference.

    """

    tau: Array
    adev: Array
    bound: Array


def model_curve(axis: AxisResult, timeline: Timeline) -> ModelCurve:
    """Return the Allan deviation of the model on a fine grid, or at the points without a rate."""
    rate = rate_of(axis, timeline)
    tau, coarse = np.array(axis.curve.tau_s), np.array(axis.curve.model_adev)
    model = reported_model(axis) if coarse.any() else FittedModel({})
    if not (coarse.any() or hidden_avar(axis, tau).any()):
        return ModelCurve(tau[:0], coarse[:0], coarse[:0])
    # The first averaging time is never longer than a million samples in results of this package.
    if rate is None or len(tau) < 2 or not 0.5 < tau[0] * rate < 1e6:
        return ModelCurve(tau, coarse, np.full(len(tau), np.nan))
    fine = 161   # points of a line, two pixels apart in a report
    between = 8   # finer points per point to average lobes over
    # Averaging times are whole numbers of samples. Sidelobes of tones that are finer than the grid
    # are averaged.
    size = np.unique(np.rint(np.geomspace(tau[0], tau[-1], fine * between) * rate))
    avar = model.allan_variance(size, 1 / rate)
    if axis.tones:
        window = min(between, len(avar))
        smooth = np.convolve(avar, np.ones(window) / window, 'same')
        avar = np.where(size > size[0] * 64, smooth, avar)
        avar[-window:] = model.allan_variance(size[-window:], 1 / rate)
    keep = np.unique(np.searchsorted(size, np.geomspace(size[0], size[-1], fine).round()))
    keep = keep[size[keep] / rate >= shortest_fitted_s(axis)]
    size, avar = size[keep], avar[keep]
    bound = avar + hidden_avar(axis, size / rate)
    # A bound that adds less than a tenth to the variance would coincide with the line of the
    # model.
    return ModelCurve(size / rate, np.sqrt(np.where(avar > 0, avar, np.nan)),
                      np.sqrt(np.where(bound > 1.1 * avar, bound, np.nan)))


def expected_band(axis: AxisResult, tau: Array, adev: Array) -> tuple[Array, Array]:
    """Return the band in which 95 % of the points should fall if the model is right."""
    curve = axis.curve
    dof = np.exp(np.interp(np.log(tau), np.log(curve.tau_s), np.log(np.maximum(curve.edf, 1e-3))))
    return (np.asarray(np.sqrt(chi_square.lower(0.025, dof) / dof) * adev),
            np.asarray(np.sqrt(chi_square.upper(0.025, dof) / dof) * adev))


def shortest_fitted_s(axis: AxisResult) -> float:
    """Return the period of the band edge; shorter averages include noise above the fitted band."""
    return 1 / (axis.band_edge_hz or inf)


def model_density(axis: AxisResult, timeline: Timeline, points: int) -> tuple[Array, Array]:
    """
    Return frequencies up to half the rate, and the two-sided density of the model at them.

    It is in squared sample units per Hz; NaN above the fitted band, which the model does not
    describe, and for an axis without a model. The ramp is deterministic and has no spectrum.
    Both are empty if the rate is unknown, or no time has passed.
    """
    rate = rate_of(axis, timeline)
    if rate is None or timeline.duration_s <= 0:
        return np.zeros(0), np.zeros(0)
    frequency = np.geomspace(min(1 / timeline.duration_s, rate / 4), rate / 2, points)
    if not any(axis.curve.model_adev):
        return frequency, np.full(points, np.nan)
    density = reported_model(axis).density(frequency, 1 / rate)
    return frequency, np.where(frequency > (axis.band_edge_hz or inf), np.nan, density)


def in_bands(spectrum: Spectrum) -> tuple[Array, Array]:
    """
    Return the mean density of a spectrum in equal bands on a logarithmic axis.

    A band is a quarter of an octave wide. At the lowest frequencies each bin is a band of its own,
    and may be a hundred times too high or too low.
    """
    frequency, power = np.array(spectrum.frequency_hz), np.array(spectrum.psd)
    if not len(frequency):
        return frequency, power
    # 80 bands in all; half the width gives 1.4 times the scatter, twice the width hides a hump.
    bands = np.floor(np.log2(frequency) / 0.25)
    _, starts, counts = np.unique(bands, return_index=True, return_counts=True)
    return (np.exp(np.add.reduceat(np.log(frequency), starts) / counts),
            np.add.reduceat(power, starts) / counts)


def few_degrees(axis: AxisResult) -> list[bool]:
    """Return for each point of the curve whether it has too few degrees of freedom."""
    # Below 3, the 95 % interval of a deviation spans more than a factor of five.
    return [dof < 3.0 for dof in axis.curve.edf]


def reading_point(term: Term, axis: AxisResult, tau: Array) -> float:
    """
    Return the averaging time at which a coefficient is read from its line.

    For the bias instability it is the middle of the flat part of the model. `tau` holds the
    averaging times to choose from.
    """
    if term.read_at is not None:
        return term.read_at
    model = reported_model(axis)
    # Omit tones and low-pass, which distort the short end; the sum of the other noise has the flat
    # part.
    total = FittedModel(model.coefficients, None, model.processes).allan_variance(tau, 1.0)
    flat = tau[total <= 1.1 * total.min()]
    return float(np.sqrt(flat[0] * flat[-1]))


def reported(coefficient: Coefficient, *, si: bool = False) -> tuple[str, ...]:
    """Return value and interval ends, only the bound, or nothing, in datasheet or SI units."""
    scale = 1.0 if si else engineering(1.0, coefficient.unit)[0]
    if coefficient.value is not None and coefficient.ci95 is not None:
        return measured(*(scale * one for one in (coefficient.value, *coefficient.ci95)))
    if coefficient.upper95 is None:
        return ()
    return (bounded(scale * coefficient.upper95, coefficient.symbol),)


def labelled(coefficient: Coefficient) -> str:
    """Return the magnitude of an observable coefficient with symbol and unit: ``N = 2.4 °/√h``."""
    value, unit = engineering(abs(coefficient.value or 0.0), coefficient.unit)
    # The true value of a simulated sensor has no interval.
    shown = reported(coefficient)[0].lstrip('-') if coefficient.ci95 else number(value)
    return f'{coefficient.symbol} = {shown} {typeset(unit)}'


def limits_of(axes: Iterable[AxisResult], *, rings: bool = False) -> tuple[float, float]:
    """Return the lowest and highest Allan deviation to show; with `rings`, with reading points."""
    low, high = inf, 0.0
    reading = []
    for axis in axes:
        few = few_degrees(axis)
        sure = not all(few)
        for value, model, band, unsure in zip(axis.curve.adev, axis.curve.model_adev,
                                              axis.curve.ci95, few, strict=True):
            if value > 0 and not (sure and unsure):
                low = min(low, max(band[0], value / 2))
                high = max(high, min(band[1], value * 2))
            if model > 0:
                # Without the terms that are only bounded, the line may lie far below the points.
                low, high = min(low, max(model, value / 3) / 1.3), max(high, model * 1.3)
        reading += [abs(value) for key, value in coefficients_of(axis).items()
                    if TERMS[key].read_at and value]
    if high == 0:
        return 0.1, 10.0
    if rings:
        low = min([low, *(value / 1.8 for value in reading if value > low / 60)])
    return low / 1.3, high * 1.3


def beyond(axes: Iterable[AxisResult], limits: tuple[float, float]) -> bool:
    """Return whether a point of the curves lies outside the limits."""
    low, high = limits
    return any(0 < value < low or value > high for axis in axes for value in axis.curve.adev)


def density_limits(axes: Iterable[AxisResult], timeline: Timeline) -> tuple[float, float]:
    """Return the density limits to show: about the model, with strong lines cut off."""
    shown: list[float] = []
    for axis in axes:
        _, model = model_density(axis, timeline, 60)
        shown += model[model > 0].tolist()
        if seen := [value for value in (axis.spectrum.psd if axis.spectrum else ()) if value > 0]:
            shown += np.quantile(seen, (0.1, 0.95)).tolist()
    return (min(shown) / 4, max(shown) * 8) if shown else (0.1, 10.0)


def over_time(signal: Signal | None) -> tuple[Array, Array]:
    """
    Return a signal as arrays: time in seconds, and rows of lowest, mean and highest values.

    The time is the middle of each segment; a segment that lacks one of the three is NaN. The
    arrays are empty if there is no signal, or if no segment has all three.
    """
    if signal is None:
        return np.zeros(0), np.zeros((3, 0))
    rows: Array = np.array([signal.low, signal.mean, signal.high], dtype=np.float64)
    rows[:, ~np.isfinite(rows).all(axis=0)] = np.nan
    if np.isnan(rows).all():
        rows = np.zeros((3, 0))
    return np.asarray((np.arange(rows.shape[1]) + 0.5) * signal.step_s), rows


def mean_over_time(axis: AxisResult) -> tuple[Array, Array]:
    """Return the middle of each segment in seconds, and its mean less the overall mean."""
    time, (_, mean, _) = over_time(axis.signal)
    return time, np.asarray(mean - np.nanmean(mean)) if len(mean) else mean


def time_unit(length_s: float) -> tuple[float, str]:
    """Return the largest unit, in seconds and by name, of which `length_s` is at least two."""
    return next(((size, name) for size, name in ((86_400.0, 'days'), (3600.0, 'h'), (60.0, 'min'))
                 if length_s >= 2 * size), (1.0, 's'))


def other_noise(axis: AxisResult, tau: Array) -> list[tuple[Array, int, list[str]]]:
    """Return other noise than the standard terms: deviation at `tau`, index of label, label."""
    found = []
    if (process := axis.gauss_markov) is not None:
        line = np.sqrt(gauss_markov_avar(process.sigma, process.correlation_time_s, tau))
        sigma, unit = engineering(process.sigma, axis.unit)
        found.append((line, int(np.argmax(line)), [
            f'Gauss-Markov, {number(sigma, 3)} {typeset(unit)}',
            f'correlated over {duration(process.correlation_time_s)}']))
    if (law := reported_model(axis).power_law) is not None:
        found.append((np.sqrt(power_law_avar(law.amplitude, law.exponent, tau)), len(tau) // 2, [
            f'1/f^{law.exponent:.2f}', 'no flicker']))
    return found


def power_law_note(axis: AxisResult, key: str) -> str:
    """Return briefly which power law replaces a term of an axis; '' if none does."""
    law = axis.power_law
    return f'no flicker, 1/f^{law.exponent:.2f}' if law and key == 'bias_instability' else ''
