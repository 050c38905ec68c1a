# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether numbers from one recording hold in another: on another day, or with the motors on.

The other recording's own drift model says what a filter with these numbers would meet there; its
Allan curve says, band by band, how much more there is than the first recording predicts, with the
interval of the curve. To that of the drift's factor is added that a short first recording knows
the shape of its drift badly.
"""

from dataclasses import dataclass

from imu_allan.noise.drift_model import drift_avar
from imu_allan.result import AxisResult, Interval
from imu_allan.tuning.arguments import drift_model_of
from imu_allan.tuning.tune import assess, FilterTuning, tune
from imu_allan.tuning.uncertainty import widened
import numpy as np

_BANDS_S = ((0.0, 0.3), (0.3, 3.0), (3.0, 30.0), (30.0, float('inf')))
"""A decade each: of cameras and lidars, of satellites, of an outage, and what lies beyond."""


@dataclass(frozen=True)
class Excess:
    """Allan deviation of the other recording over what the first one predicts, in one band."""

    # Averaging times of the band that both recordings know
    from_s: float
    to_s: float
    ratio: float
    ci95: Interval


@dataclass(frozen=True)
class Verification:
    """Numbers from one recording held against another."""

    met: FilterTuning    # the numbers, with what they meet in the other recording
    # By which to multiply N and K, to be right there; N and sigma of a Gauss-Markov process
    noise_factor: float
    random_walk_factor: float
    # Intervals of the factors, from that of the other's curve at the two ends; that of the drift
    # as far as the first recording knows its own
    noise_ci95: Interval
    random_walk_ci95: Interval
    excess: tuple[Excess, ...]


def verify(axis: AxisResult, other: AxisResult, tuning: FilterTuning) -> Verification:
    """
    Hold a tuning of an axis against the same axis of another recording.

    Raises
    ------
    ImuAllanError
        If an axis has no drift model.

    """
    drift_model_of(axis)
    times = tuning.aiding_interval_s, tuning.coast_s
    time = tuning.correlation_time_s
    drive, mine = tuning.random_walk, tuning.random_walk
    if time is not None and tuning.sigma is not None:
        drive, mine = tuning.sigma * float(np.sqrt(2 / time)), tuning.sigma
    assert drive is not None
    assert mine is not None
    met = assess(other, tuning.noise_density, drive, *times, correlation_time_s=time)
    own = tune(other, *times, 'random_walk' if time is None else 'gauss_markov',
               correlation_time_s=time)
    theirs = own.random_walk if time is None else own.sigma
    assert theirs is not None
    noise, walk = own.noise_density / tuning.noise_density, theirs / mine
    return Verification(met, noise, walk, _scaled(noise, other, times[0]),
                        widened(walk, _scaled(walk, other, times[1]), axis, times[1]),
                        _excess(axis, other))


def _scaled(factor: float, other: AxisResult, tau_s: float) -> Interval:
    """Interval of a factor, as wide as that of the other's curve at an averaging time."""
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
    for low, high in _BANDS_S:
        here = np.flatnonzero(known & (tau >= low) & (tau < high))
        if not len(here):
            continue
        ratio = float(np.exp(np.mean(np.log(np.array(curve.adev)[here] / predicted[here]))))
        # Neighbouring octaves are correlated: the interval is that of the best known of them.
        best = here[int(np.argmax(np.array(curve.edf)[here]))]
        scale = ratio / curve.adev[best]
        found.append(Excess(float(tau[here[0]]), float(tau[here[-1]]), ratio,
                            (curve.ci95[best][0] * scale, curve.ci95[best][1] * scale)))
    return tuple(found)
