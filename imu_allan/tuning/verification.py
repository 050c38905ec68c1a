# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Verification of numbers from one recording in another: on another day, or with motors on.

The drift model of the other recording shows what a filter with these numbers would meet there. Its
Allan curve shows, band by band, how much more there is than the first recording predicts, with the
interval of the curve. The interval of the drift's factor also contains how poorly a short first
recording knows the shape of its drift.
"""

from dataclasses import dataclass

from imu_allan.arguments import drift_model_of
from imu_allan.noise.drift_model import drift_avar
from imu_allan.result import AxisResult, Interval
from imu_allan.tuning.tune import assess, FilterTuning, tune
from imu_allan.tuning.uncertainty import widened
import numpy as np


@dataclass(frozen=True)
class Excess:
    """Ratio of the other recording's Allan deviation to the prediction, in one band."""

    # Averaging times of the band that both recordings cover
    from_s: float
    to_s: float
    ratio: float
    ci95: Interval


@dataclass(frozen=True)
class Verification:
    """Numbers from one recording, verified in another."""

    met: FilterTuning    # the numbers, assessed in the other recording
    # Factors that make N and K right there, or N and sigma of a Gauss-Markov process
    noise_factor: float
    random_walk_factor: float
    # Intervals of the factors, from that of the other curve at aiding interval and unaided time.
    # That of the drift includes how well the first recording knows its own drift
    noise_ci95: Interval
    random_walk_ci95: Interval
    excess: tuple[Excess, ...]


def verify(axis: AxisResult, other: AxisResult, tuning: FilterTuning) -> Verification:
    """Verify a tuning of an axis with the same axis of another recording."""
    times = tuning.aiding_interval_s, tuning.coast_s
    time = tuning.correlation_time_s
    own = tune(other, *times, 'random_walk' if time is None else 'gauss_markov',
               correlation_time_s=time)
    mine, theirs = (one.sigma or one.random_walk or 0.0 for one in (tuning, own))
    met = assess(other, tuning.noise_density,
                 mine if time is None else mine * float(np.sqrt(2 / time)), *times, time)
    noise, drift = own.noise_density / tuning.noise_density, theirs / mine
    return Verification(met, noise, drift, _scaled(noise, other, times[0]),
                        widened(drift, _scaled(drift, other, times[1]), axis, times[1]),
                        _excess(axis, other))


def _scaled(factor: float, other: AxisResult, tau_s: float) -> Interval:
    """Return the interval of a factor, relatively as wide as the other curve's at `tau_s`."""
    curve = other.curve
    at = int(np.argmin(np.abs(np.log(np.array(curve.tau_s) / tau_s))))
    low, high = curve.ci95[at]
    return factor * low / curve.adev[at], factor * high / curve.adev[at]


def _excess(axis: AxisResult, other: AxisResult) -> tuple[Excess, ...]:
    model, curve = drift_model_of(axis), other.curve
    tau = np.array(curve.tau_s)
    known = (tau >= model.from_s * (1 - 1e-6)) & (tau <= model.to_s) & (np.array(curve.edf) >= 3)
    predicted = np.sqrt(drift_avar(model, axis.all_tones, tau))
    found = []
    # A decade each: of cameras and lidars, of satellites, of an outage, and beyond.
    bands_s = ((0.0, 0.3), (0.3, 3.0), (3.0, 30.0), (30.0, float('inf')))
    for low, high in bands_s:
        here = np.flatnonzero(known & (tau >= low) & (tau < high))
        if not len(here):
            continue
        ratio = float(np.exp(np.mean(np.log(np.array(curve.adev)[here] / predicted[here]))))
        # Neighbouring octaves are correlated, so the interval is that of the best known one.
        best = here[int(np.argmax(np.array(curve.edf)[here]))]
        scale = ratio / curve.adev[best]
        found.append(Excess(float(tau[here[0]]), float(tau[here[-1]]), ratio,
                            (curve.ci95[best][0] * scale, curve.ci95[best][1] * scale)))
    return tuple(found)
