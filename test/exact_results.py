# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Results whose every number is known, exact model curves, and results changed from them."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from imu_allan import result as schema
from imu_allan.finding import finding
from imu_allan.noise.drift_model import drift_avar
from imu_allan.noise.terms import allan_variance, AXES, TERMS
from imu_allan.result import AxisResult, Result
import numpy as np

RATE_HZ = 200.0
DURATION_S = 3600.0 * 3

GYRO = {'noise_density': 7.0e-4, 'bias_instability': 1.2e-4, 'rate_random_walk': 4.0e-6}
ACCEL = {'noise_density': 4.0e-3, 'bias_instability': 4.0e-4, 'rate_random_walk': 1.5e-5}
FLICKER = tuple((3e-4 * np.sqrt(np.log(4) / np.pi), 0.01 * 4.0**k) for k in range(16))
"""Processes that together are flicker of 3e-4."""
UNSEEN: dict[str, Any] = {'observable': False, 'value': None, 'ci95': None}
"""What is known of a coefficient that does not show; its bound comes beside it."""


def axis_result(name: str, coefficients: Mapping[str, float],
                upper: Mapping[str, float] | None = None, **fields: Any) -> AxisResult:
    """Return an axis with the exact curve of `coefficients`; `upper` bounds the other terms."""
    quantity = AXES[name]
    widths = {'quantization_noise': .05, 'noise_density': .002, 'bias_instability': .08,
              'rate_random_walk': .3, 'rate_ramp': .5}
    entries = {}
    for key, term in TERMS.items():
        value = coefficients.get(key)
        half = abs(value or 0.0) * widths[key]
        entries[key] = schema.Coefficient(
            term.symbol, term.unit(quantity), value is not None, value,
            None if value is None else (value - half, value + half),
            (upper or {}).get(key, GYRO.get(key, 1e-5) * .05) if value is None else None)
    tau = 2.0 ** np.arange(21) / RATE_HZ
    adev = np.sqrt(allan_variance(dict(coefficients), tau))
    edf = np.maximum(1.0, 1.5 * DURATION_S / tau - 1)
    spread = np.minimum(0.6, 1 / np.sqrt(2 * edf))
    ci68, ci95 = (tuple(zip((adev * (1 - np.minimum(.9, z * spread))).tolist(),
                            (adev * (1 + 1.4 * z * spread)).tolist(), strict=True))
                  for z in (1.0, 1.96))
    curve = schema.Curve(tuple(tau.tolist()), tuple(adev.tolist()), tuple(edf.tolist()), ci68,
                         ci95, tuple(adev.tolist()))
    return AxisResult(**{
        'quantity': quantity.value, 'unit': quantity.unit, 'coefficients': entries,
        'mean': 0.01 if name != 'accel_z' else 9.80665, 'band_limit_s': None, 'tones': (),
        'goodness_of_fit': schema.GoodnessOfFit(0.4, 0.01, True), 'curve': curve, **fields})


def full_axis(name: str, values: dict[str, float]) -> AxisResult:
    """Return an axis with drift model, segments, signal and backtest; z without K."""
    n, horizons = values['noise_density'], (0.1, 1.0, 10.0, 60.0, 600.0)
    mean = 0.01 if name != 'accel_z' else 9.80665
    upper = {'rate_random_walk': values.pop('rate_random_walk') * 0.5} if name[-1] == 'z' else {}
    # Eight parts whose noise is the same throughout.
    segments = tuple(schema.Segment(
        place * DURATION_S / 8, DURATION_S / 8, 0.01 * (1 + 1e-3 * place),
        n * (1 + 0.002 * wobble), (n * 0.99, n * 1.012), n * 0.05 * (1.2 + wobble))
        for place, wobble in enumerate((0, 1, -1, .5, -.5, .2, -.8, .9)))
    # Columns with a hole, whose mean wanders.
    sigma = n * RATE_HZ**0.5
    columns = [None if 120 <= i < 130 else mean + 0.05 * sigma * float(np.sin(i / 40))
               for i in range(400)]
    return axis_result(
        name, values, upper, trend=schema.Trend(),
        tones=(schema.Tone(23.4, 2e-4), schema.Tone(46.8, 1e-4)) if name == 'gyro_z' else (),
        signal=schema.Signal(DURATION_S / 400, *(
            tuple(None if mean is None else mean + side * 4 * sigma for mean in columns)
            for side in (-1, 0, 1))),
        stationarity=schema.Stationarity(True, 0.4, segments),
        drift_model=schema.DriftModel(n, values.get('rate_random_walk', 0.0), (
            schema.GaussMarkov(n * 0.1, 100.0),), 0.01, 4000.0),
        backtest=schema.Backtest(DURATION_S / 2, DURATION_S / 2, tuple(
            schema.Innovations(h, 1 + 0.02 * i, int(5000 / h)) for i, h in enumerate(horizons)),
            tuple(schema.Coast(h, n * (h**-0.5), n * (h**-0.5) * 1.1) for h in horizons)))


def build_result(scale: float = 1.0, **fields: Any) -> Result:
    """Three hours at 200 Hz: x as in GYRO and ACCEL times `scale`, y 10 % more, z 5 % less."""
    factors = {'x': scale, 'y': 1.1 * scale, 'z': 0.95 * scale}
    axes = {name: full_axis(name, {
        key: value * factors[name[-1]]
        for key, value in (GYRO if name.startswith('gyro') else ACCEL).items()}) for name in AXES}
    return Result(**{
        'imu_allan_version': '0.1.0',
        'source': schema.Source('recording', 'rec/imu_2026', '/imu/data_raw', 'imu_link',
                                '2026-11-21T10:00:00Z', 'header'),
        'timeline': schema.Timeline(
            RATE_HZ, int(DURATION_S * RATE_HZ), DURATION_S, missing=1200,
            gaps=(schema.Span(1500.0, 4.0), schema.Span(7000.0, 2.0)),
            motion=(schema.Span(4000.0, 300.0), schema.Span(9000.0, 45.0))),
        'axes': axes,
        'warnings': (
            finding('motion', count=2, excluded_s=345.0),
            finding('tones', ('gyro_z',), count=2, unit='rad/s', frequency_hz=23.4,
                    amplitude=2e-4, half_rate=False)), **fields})


def only(result: Result, begin: str) -> Result:
    """Return a result of some of its axes: 'gyro', 'gyro_x', '' for all."""
    return replace(result, axes={name: axis for name, axis in result.axes.items()
                                 if name.startswith(begin)})


def without(result: Result, name: str) -> Result:
    return replace(result, axes={one: axis for one, axis in result.axes.items() if one != name})


def with_axes(result: Result, begin: str = '', **fields: Any) -> Result:
    """Return a result with other fields of its axes; a function gives the one of each axis."""
    return replace(result, axes=result.axes | {
        name: replace(axis, **{key: value(axis) if callable(value) else value
                               for key, value in fields.items()})
        for name, axis in only(result, begin).axes.items()})


def with_coefficient(result: Result, begin: str, key: str, **fields: Any) -> Result:
    def changed(axis: AxisResult) -> dict[str, Any]:
        return {**axis.coefficients, key: replace(axis.coefficients[key], **fields)}
    return with_axes(result, begin, coefficients=changed)


def axis_of(noise_density=0.0, walk=0.0, processes=(), tones=(), known=(0.01, 3000.0),
            quantity='angular_velocity', **fields):
    """Return an axis with this drift model; processes are (sigma, time), tones (hertz, a)."""
    model = schema.DriftModel(
        noise_density, walk, tuple(schema.GaussMarkov(*one) for one in processes), *known)
    lines = tuple(schema.Tone(*tone) for tone in tones)
    tau = 0.01 * 2.0 ** np.arange(19)
    adev = tuple(np.sqrt(drift_avar(model, lines, tau)).tolist())
    edf = np.maximum(1.0, 1.5 * 3 * known[1] / tau)
    pairs = tuple(zip(adev, adev, strict=True))
    curve = schema.Curve(tuple(tau.tolist()), adev, tuple(edf.tolist()), pairs, pairs, adev)
    unit = 'rad/s' if quantity == 'angular_velocity' else 'm/s^2'
    return AxisResult(quantity, unit, 0.0, None, lines, {},
                      schema.GoodnessOfFit(0.5, 0.0, True), curve, drift_model=model, **fields)
