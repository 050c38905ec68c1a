# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Noise coefficients from several records of one sensor, by their joint likelihood.

The records are independent given the coefficients, so their likelihoods multiply, and their
spectra are fitted side by side. All records share the noise. The trends of the mean are determined
from each record alone; they enter the joint model as separate regressors, like each ramp.

References
----------
H. D. Patterson and R. Thompson, Biometrika 58 (1971): restricted likelihood.

"""

from collections.abc import Sequence
from dataclasses import replace

from imu_allan.noise.axis_fit import AxisFit
from imu_allan.noise.posterior.posterior import Posterior, posteriors
from imu_allan.noise.posterior.random_walk_persists import random_walk_persists
from imu_allan.noise.posterior.report import reported
from imu_allan.noise.record.groups import joined_groups
from imu_allan.result import TemperatureDependence, Tone, Trend
import numpy as np


def joint_fit(records: Sequence[AxisFit], dt: float) -> AxisFit:
    """
    Fit one axis to several records at once: equation (7) of docs/statistics.md, summed over them.

    Parameters
    ----------
    records : sequence of AxisFit
        Results of `fit_axes` for the axis in each record, all of the same sample interval.
    dt : float
        Sample interval in seconds.

    Returns
    -------
    AxisFit
        There is no joint ramp or step. The most precise warm-up represents all.

    Examples
    --------
    >>> from imu_allan.noise.axis_fit import fit_axes
    >>> from imu_allan.noise.record.estimator import Estimator
    >>> from imu_allan.noise.simulate import simulate
    >>> fits = []
    >>> for seed in range(2):
    ...     estimator = Estimator()
    ...     estimator.update(simulate({'noise_density': 1e-3}, 20_000, 100.0, seed))
    ...     fits += fit_axes(estimator.finished(), 0.01)
    >>> density = joint_fit(fits, 0.01).fit.estimates['noise_density']
    >>> bool(density.low < 1e-3 < density.high)
    True

    """
    groups = joined_groups([one.record.groups() for one in records if one.record is not None])
    [posterior] = posteriors([groups], dt, [None])
    report = reported(posterior, dt)
    if report.estimates['rate_random_walk'].observable and not _shows_in_parts(
            posterior, records, dt):
        report = report.without_random_walk()
    corners_hz = [one.fit.high_pass_hz for one in records if one.fit.high_pass_hz is not None]
    if corners_hz:
        report = report.behind_high_pass(max(corners_hz))
    report = replace(report, trend=_trend([one.fit.trend for one in records]))
    return AxisFit(report, _lines(records), groups,
                   joined_groups([one.whole for one in records]))


def _shows_in_parts(posterior: Posterior, records: Sequence[AxisFit], dt: float) -> bool:
    """Return whether a random walk persists without any one quarter, and without any record."""
    quarters = [own for one in records if one.parts is not None and (own := one.parts())]
    splits = [quarters] if len(quarters) > 2 else []
    if len(quarters) == len(records):
        splits.append([list(same) for same in zip(*quarters, strict=True)])
    return all(random_walk_persists(posterior, split, dt) for split in splits)


def _trend(trends: Sequence[Trend]) -> Trend:
    """Combine those trends of the records that are properties of the sensor."""
    warm = min((one for one in trends if one.warm_up is not None), key=_error_of_warm_up,
               default=Trend())
    cycles = [one.cycle_s for one in trends if one.cycle_s is not None]
    heat = [one.temperature for one in trends if one.temperature is not None]
    return Trend(warm_up=warm.warm_up, second_warm_up=warm.second_warm_up,
                 temperature=_mean_dependence(heat) if heat else None,
                 cycle_s=float(np.median(cycles)) if cycles else None)


def _error_of_warm_up(trend: Trend) -> float:
    """Return the relative width of the interval of the amplitude."""
    assert trend.warm_up is not None
    low, high = trend.warm_up.ci95
    return abs((high - low) / (trend.warm_up.amplitude or 1e-300))


def _mean_dependence(known: Sequence[TemperatureDependence]) -> TemperatureDependence:
    """Return the mean dependence on temperature, weighted by precision."""
    half = np.array([(one.ci95[1] - one.ci95[0]) / 2 for one in known])
    weight = half**-2.0
    slope = float(np.average([one.per_kelvin for one in known], weights=weight))
    error = float(weight.sum()**-0.5)
    best = known[int(np.argmax(weight))]
    return replace(best, per_kelvin=slope, ci95=(slope - error, slope + error),
                   lowest_c=min(one.lowest_c for one in known),
                   highest_c=max(one.highest_c for one in known))


def _lines(records: Sequence[AxisFit]) -> list[Tone]:
    """Return the lines of all records by amplitude, each once with its largest amplitude."""
    kept: list[Tone] = []
    for line in sorted((line for one in records for line in one.lines),
                       key=lambda line: -line.amplitude):
        # The lines of a sensor drift by this much between records.
        if all(abs(line.frequency_hz - other.frequency_hz) > 2e-3 * other.frequency_hz
               for other in kept):
            kept.append(line)
    return kept
