# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Filters with the numbers of one recording, run over another: another day, or motors on.

They see one-second means of the data at rest, and restart after every interruption. A robot that
has moved in between has another attitude to gravity and the earth's rotation, which is not drift.
For the same reason, the factors come from the spectrum within the stops. They are the likeliest
factors on white noise and drift of the first recording's model, and the pair that these would have
been tuned to. The interval of the drift's factor contains how poorly a short first recording knows
the shape of its drift.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from imu_allan.argument_checks import drift_model_of
from imu_allan.errors import ImuAllanError
from imu_allan.noise import chi_square
from imu_allan.noise.drift_model import MISFIT
from imu_allan.noise.gauss_markov_means import dct_power
from imu_allan.noise.posterior.maximum import maximise, Solution
from imu_allan.noise.record.bins import Bins, bins_of
from imu_allan.noise.record.groups import grouped, Groups, RANDOM_WALK, WHITE
from imu_allan.noise.record.periodogram import SHORTEST, SpectrumSection
from imu_allan.noise.terms import AXES, line_power
from imu_allan.result import AxisResult, Coast, DriftModel, GaussMarkov, Innovations, Interval
from imu_allan.tuning.backtest import filtered, Met, MOST_STEPS, section_of, segments
from imu_allan.tuning.means import Means
from imu_allan.tuning.tune import Bias, FilterTuning, tune
from imu_allan.tuning.uncertainty import coast_bands, widened
import numpy as np
from scipy.optimize import brentq


@dataclass(frozen=True)
class Outcome:
    """Performance of one filter."""

    # Over means of 1, 10 and 60 s, if the stops are long enough
    innovations: tuple[Innovations, ...]
    coasts: tuple[Coast, ...]    # over 10, 60 and 300 s
    # Where 95 % of the observed deviations should lie, given the recording's own unsteadiness and
    # the number of outages
    bands: tuple[Interval, ...]


@dataclass(frozen=True)
class FieldTest:
    """Numbers of one axis, tested in another recording."""

    tested_s: float    # duration at rest there
    stops: int    # number of parts at rest
    # Of the tuned pair, and of the whole drift model
    tuned: Outcome
    full: Outcome
    # Factors that make the tuned N and K right there; for a filter with a Gauss-Markov process N
    # and its sigma, with the same correlation time
    noise_factor: float
    random_walk_factor: float
    noise_ci95: Interval
    random_walk_ci95: Interval


def field_test(axes: Mapping[str, AxisResult], means: Means, aiding_interval_s: float = 0.1,
               coast_s: float = 60.0, bias: Bias = 'random_walk') -> dict[str, FieldTest]:
    """Run filters with the numbers of axes, which have drift models, over another recording."""
    names = [list(AXES)[column] for column in means.columns]
    whole = segments(means.series, means.cell)
    # A constant axis has no noise to compare.
    rows = [i for i, name in enumerate(names)
            if name in axes and any(np.ptp(part[i]) > 0 for part in whole)]
    kept = {names[i]: axes[names[i]] for i in rows}
    parts = [part[rows] for part in whole if part.shape[1] >= SHORTEST]
    if not kept:
        return {}
    if not parts:
        raise ImuAllanError(f'nothing is at rest for {SHORTEST * means.cell_s:g} s in a row: too '
                            'short to run a filter over')
    fed = [(model, tones) for axis in kept.values() for model, tones in (
        (_as_model(tune(axis, aiding_interval_s, coast_s, bias)), ()),
        (drift_model_of(axis), axis.tones))]
    # Long parts are split, too, as filters keep much for every step.
    met = filtered(fed, (np.repeat(part[:, at:at + MOST_STEPS], 2, axis=0) for part in parts
                         for at in range(0, part.shape[1], MOST_STEPS)), means.cell_s)
    sections = [section_of(part) for part in parts]
    bins = bins_of(sections, means.cell_s)
    found = {}
    for i, (name, axis) in enumerate(kept.items()):
        predicted = _as_predicted(bins, sections, axis, means.cell_s)
        spectrum = grouped(predicted, i).capped(MISFIT)
        found[name] = FieldTest(
            sum(part.shape[1] for part in parts) * means.cell_s, len(parts),
            _outcome(met, 2 * i, axis), _outcome(met, 2 * i + 1, axis),
            *_factors(axis, _scales(spectrum), aiding_interval_s, coast_s, bias))
    return found


def _as_model(tuning: FilterTuning) -> DriftModel:
    """Return the drift model that a filter with these numbers assumes."""
    process = () if tuning.sigma is None or tuning.correlation_time_s is None else (
        GaussMarkov(tuning.sigma, tuning.correlation_time_s),)
    return DriftModel(tuning.noise_density, tuning.random_walk or 0.0, process, 0.0, 0.0)


def _outcome(met: Met, lane: int, axis: AxisResult) -> Outcome:
    innovations, coasts = met.of(lane)
    outages = [met.coasts[coast.horizon_s][2] for coast in coasts]
    return Outcome(innovations, coasts, coast_bands(axis, coasts, outages))


def _as_predicted(bins: Bins, sections: Sequence[SpectrumSection], axis: AxisResult, step_s: float
                  ) -> Bins:
    """Return the spectrum with two design columns: predicted noise, and predicted drift."""
    model = drift_model_of(axis)
    lines = step_s * float(line_power(axis.tones, step_s))
    drift = bins.design[:, RANDOM_WALK] * model.rate_random_walk**2
    for process in model.processes:
        # A stop is short compared with a slow process, so the spectrum of an endless record does
        # not apply.
        power = {length: dct_power(process.correlation_time_s, step_s, length)
                 for length in {section.length for section in sections}}
        drift = drift + process.sigma**2 * np.concatenate(
            [power[section.length][section.first - 1:section.last - 1] for section in sections])
    white = bins.design[:, WHITE] * (model.noise_density**2 + lines)
    return replace(bins, design=np.stack((white, drift), axis=1))


def _scales(spectrum: Groups) -> list[tuple[float, Interval]]:
    """Return the likeliest factors on white noise and on drift, with intervals."""
    drifting = bool(spectrum.design[:, 1].any())
    scaled = spectrum if drifting else replace(spectrum, design=spectrum.design[:, :1])
    best = maximise(scaled)
    found = [(float(np.sqrt(best.theta[i])), _interval(scaled, best, i))
             for i in range(scaled.design.shape[1])]
    return found if drifting else [*found, (1.0, (0.0, float('inf')))]


def _interval(spectrum: Groups, best: Solution, column: int) -> Interval:
    """Return the factors at which the likelihood ratio reaches the 95 % of chi-square(1)."""
    threshold = float(chi_square.upper(0.05, 1))

    def excess(log_factor: float) -> float:
        held = maximise(spectrum, best.theta, fixed={column: float(np.exp(2 * log_factor))})
        return 2 * (held.loss - best.loss) - threshold

    farthest = 1e3   # factor on an amplitude; rules of thumb go up to ten times K
    far = float(np.log(farthest))
    middle = np.log(max(float(np.sqrt(best.theta[column])), 1 / farthest))
    low, high = 0.0, float('inf')
    if excess(-far) > 0:
        low = float(np.exp(brentq(excess, -far, middle, xtol=1e-4)))
    # A factor certainly beyond that still has an upper end.
    highest = max(far, middle + np.log(10)) if low > 0 else far
    if highest > middle and excess(highest) > 0:
        high = float(np.exp(brentq(excess, middle, highest, xtol=1e-4)))
    return low, high


def _factors(axis: AxisResult, scales: Sequence[tuple[float, Interval]], aiding_s: float,
             coast_s: float, bias: Bias) -> tuple[float, float, Interval, Interval]:
    """Return the factors on the tuned numbers due to scaled noise and drift, with intervals."""
    (noise, noises), (drift, drifts) = scales
    time = tune(axis, aiding_s, coast_s, bias).correlation_time_s

    def pair(noise: float, drift: float) -> tuple[float, float]:
        tuning = tune(_scaled(axis, noise, drift), aiding_s, coast_s, bias,
                      correlation_time_s=time)
        return tuning.noise_density, tuning.sigma or tuning.random_walk or 0.0

    (n, k), (own_n, own_k) = pair(noise, drift), pair(1.0, 1.0)
    n_low, n_high = (pair(end, drift)[0] / own_n if end < np.inf else end for end in noises)
    k_low, k_high = (pair(noise, end)[1] / own_k if 0 < end < np.inf else end for end in drifts)
    return (n / own_n, k / own_k, (n_low, n_high),
            widened(k / own_k, (k_low, k_high), axis, coast_s))


def _scaled(axis: AxisResult, noise: float, drift: float) -> AxisResult:
    """Return the axis with its white noise and drift scaled."""
    model, curve = drift_model_of(axis), axis.curve
    more = replace(
        model, noise_density=noise * model.noise_density,
        rate_random_walk=drift * model.rate_random_walk,
        processes=tuple(replace(process, sigma=drift * process.sigma)
                        for process in model.processes))
    tones = tuple(replace(tone, amplitude=noise * tone.amplitude) for tone in axis.tones)
    # Only the curve above the band is used, which is noise.
    return replace(axis, drift_model=more, tones=tones, curve=replace(
        curve, adev=tuple(noise * value for value in curve.adev)))
