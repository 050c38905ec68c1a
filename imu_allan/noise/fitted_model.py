# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Allan variance and spectrum of the fitted model of one axis."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from imu_allan.arrays import Array
from imu_allan.noise import spectrum, terms
from imu_allan.result import AxisResult, GaussMarkov, PowerLaw, Tone
import numpy as np
from numpy.typing import ArrayLike

_SHAPES: dict[str, Callable[[ArrayLike, float], Array]] = dict(zip(terms.SPECTRAL_TERMS, (
    spectrum.quantization, spectrum.white, spectrum.flicker, spectrum.random_walk), strict=True))


@dataclass(frozen=True)
class FittedModel:
    """
    Sum of noise terms, optionally with filtered white noise, and of Gauss-Markov processes.

    Equations (1) and (8) of docs/statistics.md, which (2) relates to each other.

    Attributes
    ----------
    coefficients : mapping
        SI coefficient by key of `TERMS`; a missing key means zero.
    passed : tuple of array_like or None
        Frequencies in Hz, and the share of the white noise that a low-pass lets pass there.
    processes : tuple of GaussMarkov
    lines : tuple of Tone
        Lines, which enter the Allan variance but not the density.
    power_law : PowerLaw or None
        Slow noise with another exponent than flicker.

    Examples
    --------
    >>> model = FittedModel({'noise_density': 0.01}, ((1.0, 50.0), (1.0, 0.0)))
    >>> model.allan_variance([1, 1000], dt=0.01).round(5)
    array([1.05e-03, 1.00e-05])
    >>> model.density([0.1, 10.0], dt=0.01).round(6)
    array([1.0e-04, 4.1e-05])

    """

    coefficients: Mapping[str, float]
    passed: tuple[ArrayLike, ArrayLike] | None = None
    processes: tuple[GaussMarkov, ...] = ()
    lines: tuple[Tone, ...] = ()
    power_law: PowerLaw | None = None

    def allan_variance(self, size: ArrayLike, dt: float) -> Array:
        """
        Allan variance over clusters.

        `size`, shape (n,): samples in a cluster. Returns shape (n,): in the squared unit of a
        sample.
        """
        size = np.asarray(size)
        tau = size * dt
        values = dict(self.coefficients)
        total = values.pop('noise_density', 0.0)**2 / tau
        if self.passed is not None and size.size:
            frequency_hz, share = self.passed
            total = total * terms.filtered_share(size, np.asarray(frequency_hz) * dt, share)
        for process in self.processes:
            total = total + terms.gauss_markov_avar(process.sigma, process.correlation_time_s, tau)
        for line in self.lines:
            total = total + terms.line_avar(line.frequency_hz, line.amplitude, tau)
        if self.power_law is not None:
            total = total + terms.power_law_avar(
                self.power_law.amplitude, self.power_law.exponent, tau)
        return np.asarray(total + terms.allan_variance(values, tau))

    def density(self, frequency_hz: ArrayLike, dt: float) -> Array:
        """
        Two-sided power spectral density of the samples.

        `frequency_hz`, shape (n,): above zero, up to half the sample rate. Returns shape (n,): in
        squared sample units per Hz. The ramp is deterministic and has no spectrum.
        """
        nu = np.asarray(frequency_hz, dtype=np.float64) * dt
        total = np.zeros(nu.shape)
        for key, value in self.coefficients.items():
            if key in _SHAPES:
                own = value**2 * dt * _SHAPES[key](nu, dt)
                if key == 'noise_density' and self.passed is not None:
                    frequency, share = map(np.asarray, self.passed)
                    own = own * np.interp(np.log(nu), np.log(frequency * dt), share)
                total = total + own
        for process in self.processes:
            total = total + process.sigma**2 * dt * spectrum.gauss_markov(
                nu, dt, process.correlation_time_s)
        if (law := self.power_law) is not None:
            total = total + law.amplitude**2 * dt * spectrum.power_law(nu, dt, law.exponent)
        return total


def reported_model(axis: AxisResult) -> FittedModel:
    """
    Return the model of an axis from the reported terms only, and its lines.

    Filters are tuned with the drift model instead, which describes the slow end whatever its
    cause; see `imu_allan.predicted_drift`.
    """
    process, law = axis.gauss_markov, axis.power_law
    values = {key: found.value for key, found in axis.coefficients.items()
              if found.observable and found.value is not None}
    if axis.high_passed_hz is not None or (not values and process is None and law is None):
        return FittedModel({})
    seen = axis.spectrum
    passed = (seen.frequency_hz, seen.passed) if seen is not None and seen.passed else None
    return FittedModel(values, passed, () if process is None else (process,), axis.tones, law)


def hidden_avar(axis: AxisResult, tau: Array) -> Array:
    """Return the largest Allan variance among the terms that are reported as bounds only."""
    hidden = np.zeros(len(tau))
    for key in terms.LASTING_TERMS:
        found = axis.coefficients.get(key)
        # Noise of another exponent replaces flicker, so the bound of flicker does not apply.
        replaced = key == 'bias_instability' and axis.power_law is not None
        if found is not None and found.upper95 is not None and not replaced:
            hidden = np.maximum(hidden, terms.TERMS[key].adev(found.upper95, tau)**2)
    return hidden


def with_model_curve(axis: AxisResult) -> AxisResult:
    """Return an axis with the model curve of its reported terms, unless it has no curve."""
    if not axis.curve.tau_s:
        return axis
    # The shortest averages are the samples themselves.
    dt = axis.curve.tau_s[0]
    size = np.rint(np.array(axis.curve.tau_s) / dt)
    model = np.sqrt(reported_model(axis).allan_variance(size, dt))
    return replace(axis, curve=replace(axis.curve, model_adev=tuple(model.tolist())))
