# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Filters with the numbers of one recording, run over another: another day, or motors on.

They see means of about a second of the data at rest, and restart after every interruption. A robot
that has moved in between has another attitude to gravity and the earth's rotation, which is not
drift.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import log2, sqrt

from imu_allan.argument_checks import drift_model_of
from imu_allan.noise import chi_square
from imu_allan.noise.record.cells import coarser
from imu_allan.noise.record.periodogram import Periodogram, SHORTEST
from imu_allan.result import AxisResult, Coast, DriftModel, GaussMarkov, Innovations, Interval
from imu_allan.tuning.backtest import filtered, INTERVALS_S, Met, MOST_STEPS, segments
from imu_allan.tuning.tune import Bias, FilterTuning, tune
from imu_allan.tuning.uncertainty import coast_bands
import numpy as np


@dataclass(frozen=True)
class Outcome:
    """Performance of one filter."""

    # Over means of 1, 10 and 60 s, if the stops are long enough
    innovations: tuple[Innovations, ...]
    coasts: tuple[Coast, ...]    # over 10, 60 and 300 s
    # Where 95 % of the observed deviations should lie, given how much a sensor's drift usually
    # changes, and the number of outages
    bands: tuple[Interval, ...]


@dataclass(frozen=True)
class FieldTest:
    """Numbers of one axis, tested in another recording."""

    tested_s: float    # duration at rest there
    stops: int    # number of parts at rest
    # Of the tuned pair, and of the whole drift model
    tuned: Outcome
    full: Outcome

    @property
    def noise_factor(self) -> tuple[float, Interval]:
        """Return the factor that makes N right over the shortest interval, with its interval."""
        shortest = self.tuned.innovations[0]
        low, high = (sqrt(shortest.nis * shortest.steps / float(of(0.025, shortest.steps)))
                     for of in (chi_square.upper, chi_square.lower))
        return sqrt(shortest.nis), (low, high)

    @property
    def drift_factor(self) -> tuple[float, Interval] | None:
        """Return observed over predicted drift after the longest outage, with its interval."""
        if not self.tuned.coasts:
            return None
        longest, (low, high) = self.tuned.coasts[-1], self.tuned.bands[-1]
        observed = longest.observed_rms
        return observed / longest.predicted_sigma, (observed / high, observed / low)


def field_test(axes: Mapping[str, AxisResult], names: Sequence[str], spectrum: Periodogram,
               dt: float, aiding_interval_s: float = 0.1, coast_s: float = 60.0,
               bias: Bias = 'random_walk') -> dict[str, FieldTest]:
    """
    Run filters with the numbers of axes, which have drift models, over another recording.

    `names`, `spectrum`, `dt`: axes of the other recording, its finished spectrum and sample
    interval. Returns: none if nothing is at rest for 16 means in a row.
    """
    times = 2**max(0, round(log2(INTERVALS_S[0] / (spectrum.cell * dt))))
    cell, series = spectrum.cell * times, coarser(spectrum.series, times)
    whole = segments(series, cell)
    # A constant axis has no noise to compare.
    rows = [i for i, name in enumerate(names)
            if name in axes and any(np.ptp(part[i]) > 0 for part in whole)]
    kept = {names[i]: axes[names[i]] for i in rows}
    parts = [part[rows] for part in whole if part.shape[1] >= SHORTEST]
    if not kept or not parts:
        return {}
    fed = [(model, tones) for axis in kept.values() for model, tones in (
        (_as_model(tune(axis, aiding_interval_s, coast_s, bias)), ()),
        (drift_model_of(axis), axis.tones))]
    # Long parts are split, too, as filters keep much for every step.
    met = filtered(fed, (np.repeat(part[:, at:at + MOST_STEPS], 2, axis=0) for part in parts
                         for at in range(0, part.shape[1], MOST_STEPS)), cell * dt)
    return {name: FieldTest(sum(part.shape[1] for part in parts) * cell * dt, len(parts),
                            _outcome(met, 2 * i, axis), _outcome(met, 2 * i + 1, axis))
            for i, (name, axis) in enumerate(kept.items())}


def _as_model(tuning: FilterTuning) -> DriftModel:
    """Return the drift model that a filter with these numbers assumes."""
    process = () if tuning.sigma is None or tuning.correlation_time_s is None else (
        GaussMarkov(tuning.sigma, tuning.correlation_time_s),)
    return DriftModel(tuning.noise_density, tuning.random_walk or 0.0, process, 0.0, 0.0)


def _outcome(met: Met, lane: int, axis: AxisResult) -> Outcome:
    innovations, coasts = met.of(lane)
    outages = [met.coasts[coast.horizon_s][2] for coast in coasts]
    return Outcome(innovations, coasts, coast_bands(axis, coasts, outages))
