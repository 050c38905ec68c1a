# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Results whose every number is known: exact model curves with intervals of a realistic width."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from browser import Browser, running_browser
from imu_allan import result as schema
from imu_allan.block import ImuBlock
from imu_allan.characterization import Characterization
from imu_allan.finding import finding
from imu_allan.noise.terms import allan_variance, AXES, TERMS
from imu_allan.result import AxisResult, Result
import numpy as np
import pytest

RATE_HZ = 200.0
DURATION_S = 3600.0 * 3

GYRO = {'noise_density': 7.0e-4, 'bias_instability': 1.2e-4, 'rate_random_walk': 4.0e-6}
ACCEL = {'noise_density': 4.0e-3, 'bias_instability': 4.0e-4, 'rate_random_walk': 1.5e-5}


def axis_result(name: str, coefficients: Mapping[str, float],
                upper: Mapping[str, float] | None = None, **fields: Any) -> AxisResult:
    """Return an axis with the exact curve of `coefficients`; `upper` bounds the other terms."""
    quantity = AXES[name]
    widths = {'quantization_noise': .05, 'noise_density': .002, 'bias_instability': .08,
              'rate_random_walk': .3, 'rate_ramp': .5}
    entries = {}
    for key, term in TERMS.items():
        unit = term.unit(quantity)
        if key in coefficients:
            value, half = coefficients[key], abs(coefficients[key]) * widths[key]
            entries[key] = schema.Coefficient(
                term.symbol, unit, True, value, (value - half, value + half), None)
        else:
            bound = (upper or {}).get(key, GYRO.get(key, 1e-5) * .05)
            entries[key] = schema.Coefficient(term.symbol, unit, False, None, None, bound)
    tau = 2.0 ** np.arange(21) / RATE_HZ
    tau = tau[tau < DURATION_S / 2]
    adev = np.sqrt(allan_variance(dict(coefficients), tau))
    edf = np.maximum(1.0, 1.5 * DURATION_S / tau - 1)
    wobble = adev * (1 + np.sin(np.arange(len(tau)) * 2.3) * 0.5 / np.sqrt(edf))
    spread = np.minimum(0.6, 1 / np.sqrt(2 * edf))

    def interval(z: float) -> tuple[tuple[float, float], ...]:
        low, high = wobble * (1 - np.minimum(.9, z * spread)), wobble * (1 + 1.4 * z * spread)
        return tuple((float(a), float(b)) for a, b in zip(low, high, strict=True))

    curve = schema.Curve(tuple(tau.tolist()), tuple(wobble.tolist()), tuple(edf.tolist()),
                         interval(1.0), interval(1.96), tuple(adev.tolist()))
    return AxisResult(**{
        'quantity': quantity.value, 'unit': quantity.unit, 'coefficients': entries,
        'mean': 0.01 if name != 'accel_z' else 9.80665, 'band_limit_s': None, 'tones': (),
        'goodness_of_fit': schema.GoodnessOfFit(0.4, 0.01, True), 'curve': curve, **fields})


def build_result(scale: float = 1.0, **fields: Any) -> Result:
    """Six axes: x as in GYRO and ACCEL times `scale`, y 10 % more, z without K."""
    axes = {}
    for name in AXES:
        factor = scale * {'x': 1.0, 'y': 1.1, 'z': 0.95}[name[-1]]
        values = {key: value * factor
                  for key, value in (GYRO if name.startswith('gyro') else ACCEL).items()}
        upper = {}
        if name.endswith('z'):
            upper['rate_random_walk'] = values.pop('rate_random_walk') * 0.5
        drift = schema.DriftModel(values['noise_density'], values.get('rate_random_walk', 0.0), (
            schema.GaussMarkov(values['bias_instability'], 30.0),), 0.1, DURATION_S / 3)
        tones = (schema.Tone(23.4, 2e-4), schema.Tone(46.8, 1e-4)) if name == 'gyro_z' else ()
        axes[name] = axis_result(name, values, upper, tones=tones, drift_model=drift)
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


@pytest.fixture(scope='session')
def make_axis() -> Callable[..., AxisResult]:
    return axis_result


@pytest.fixture(scope='session')
def make_result() -> Callable[..., Result]:
    return build_result


@pytest.fixture(scope='session')
def result() -> Result:
    """Return a three-hour recording at 200 Hz of six axes with N, B and K (z without K)."""
    return build_result()


@pytest.fixture(scope='session')
def filtered(result: Result) -> Result:
    """Return the same recording with drift models, segments, signal and backtest."""
    axes, horizons = {}, (0.1, 1.0, 10.0, 60.0, 600.0)
    for name, axis in result.axes.items():
        n = axis.coefficients['noise_density'].value or 0.0
        k = axis.coefficients['rate_random_walk'].value or 0.0
        # Eight parts whose noise is the same throughout.
        segments = tuple(
            schema.Segment(place * DURATION_S / 8, DURATION_S / 8, 0.01 * (1 + 1e-3 * place),
                           n * (1 + 0.002 * wobble), (n * 0.99, n * 1.012),
                           n * 0.05 * (1.2 + wobble))
            for place, wobble in enumerate((0, 1, -1, .5, -.5, .2, -.8, .9)))
        # Columns with a hole, whose mean wanders.
        sigma = n * RATE_HZ**0.5
        columns = [None if 120 <= i < 130 else (axis.mean or 0) + 0.05 * sigma * float(
            np.sin(i / 40)) for i in range(400)]
        signal = schema.Signal(DURATION_S / 400, *(
            tuple(None if mean is None else mean + side * 4 * sigma for mean in columns)
            for side in (-1, 0, 1)))
        axes[name] = replace(
            axis, signal=signal, trend=schema.Trend(),
            stationarity=schema.Stationarity(True, 0.4, segments),
            drift_model=schema.DriftModel(
                n, k, (schema.GaussMarkov(n * 0.1, 100.0),), 0.01, 4000.0),
            backtest=schema.Backtest(DURATION_S / 2, DURATION_S / 2, tuple(
                schema.Innovations(h, 1 + 0.02 * i, int(5000 / h))
                for i, h in enumerate(horizons)), tuple(
                schema.Coast(h, n * (h**-0.5), n * (h**-0.5) * 1.1) for h in horizons)))
    return replace(result, axes=axes)


@pytest.fixture(scope='session')
def streamed() -> Callable[..., Characterization]:
    """Characterize samples of gyro x, or of axes in columns."""
    def streamed(samples: np.ndarray, rate_hz: float) -> Characterization:
        rows = np.full((len(samples), 6), np.nan)
        rows[:, :samples.size // len(samples)] = samples.reshape(len(samples), -1)
        stamps = np.int64(1.7e18) + np.arange(len(rows)) * np.int64(1e9 / rate_hz)
        stream = Characterization(kind='topic', topic='/imu')
        stream.update(ImuBlock(stamps, stamps, rows, np.tile([False, True], (len(rows), 1)),
                               'imu'))
        return stream
    return streamed


@pytest.fixture(scope='module')
def browser() -> Iterator[Browser]:
    with running_browser() as browser:
        yield browser
