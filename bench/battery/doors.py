# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
How the battery asks a checkout: the only module that knows what the estimator is called there.

The package is the one that comes first on the path. Its own `bench/drawn_spectra.py` draws the
spectra, as what they are made of is the package's matter too.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
import time
from types import ModuleType
from typing import Any

from battery.sensors import Array, Sensor, TERMS
import imu_allan
from imu_allan.characterization.axis import axis_results
from imu_allan.noise.posterior.posterior import posteriors
from imu_allan.noise.posterior.report import AxisReport, reported
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.terms import Quantity
from imu_allan.result import AxisResult
import numpy as np

CHECKOUT = Path(imu_allan.__file__).parents[1]


@dataclass(frozen=True)
class Said:
    """What is said of a term: a value with its interval, or an upper bound, or nothing."""

    value: float | None
    interval: tuple[float, float] | None
    bound: float | None


@dataclass(frozen=True)
class Answer:
    """
    What is said of one axis.

    Attributes
    ----------
    terms : mapping
        By key.
    codes : tuple of str
        Of the warnings, and the words of the result.
    cpu_s : float
        What it took, from the samples or from the spectrum.

    """

    terms: Mapping[str, Said]
    codes: tuple[str, ...]
    cpu_s: float


def of_samples(samples: Array, rate_hz: float, quantity: str = 'angular_velocity') -> Answer:
    """Characterize a record as `imu_allan.characterize` does, and keep the warnings too."""
    began = time.process_time()
    estimator = Estimator()
    estimator.update(samples)
    [(axis, remarks)] = axis_results(estimator.finished(), rate_hz, [Quantity(quantity)])
    cpu_s = time.process_time() - began
    terms = {key: Said(c.value, c.ci95, c.upper95) for key, c in axis.coefficients.items()
             if key in TERMS}
    codes = {*(remark.code for remark in remarks), *_words(axis)}
    return Answer(terms, tuple(sorted(codes)), cpu_s)


def _words(axis: AxisResult) -> list[str]:
    """Name what the result itself says, in the words of the warnings."""
    trend = axis.trend
    said = {'power_law': axis.power_law, 'gauss_markov': axis.gauss_markov,
            'high_passed': axis.high_passed_hz, 'band_limited': axis.band_limit_s,
            'ramp': trend and trend.ramp, 'tones': axis.tones or None}
    return [word for word, found in said.items() if found is not None]


def of_spectra(sensor: Sensor, records: int, seed: int) -> list[Answer]:
    """Draw spectra of a sensor and fit them."""
    drawn, dt = _drawn_spectra(), 1 / sensor.rate_hz
    through = sensor.through and (sensor.through.numerator, sensor.through.denominator)
    spectra = drawn.draw(drawn.shape_of(sensor.samples),
                         [sensor.terms.get(key, 0.0)**2 for key in TERMS], dt, records,
                         np.random.default_rng(seed), (sensor.mean,) if sensor.mean else (),
                         sensor.process, sensor.law, through)
    return [_of_spectrum(one, dt) for one in spectra]


def _of_spectrum(spectrum: Any, dt: float) -> Answer:
    """Ask the posterior of one spectrum."""
    began = time.process_time()
    [posterior] = posteriors([spectrum.groups()], dt, [spectrum])
    return _of_report(reported(posterior, dt), time.process_time() - began)


def _of_report(found: AxisReport, cpu_s: float) -> Answer:
    trend = found.trend
    words = {'power_law': found.power_law, 'gauss_markov': found.gauss_markov,
             'high_passed': found.high_pass_hz, 'band_limited': found.window_s,
             'warm_up': trend.warm_up, 'slow_cycle': trend.cycle_s, 'ramp': trend.ramp,
             'bias_step': found.bias_step}
    codes = [word for word, said in words.items() if said is not None]
    codes += ['trend_or_walk'] * found.random_walk_unclear + ['poor_fit'] * (not found.acceptable)
    return Answer(_said(found.estimates), tuple(codes), cpu_s)


def _said(estimates: Mapping[str, Any]) -> dict[str, Said]:
    return {key: Said(float(one.value), (float(one.low), float(one.high)), None)
            if one.observable
            else Said(None, None, float(one.upper) if np.isfinite(one.upper) else None)
            for key, one in ((key, estimates[key]) for key in TERMS)}


def _drawn_spectra() -> ModuleType:
    spec = spec_from_file_location('drawn_spectra', CHECKOUT / 'bench' / 'drawn_spectra.py')
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
