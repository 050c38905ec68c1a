# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What a filter needs, and what it met elsewhere, as plain numbers for JSON."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict
from typing import Any

from imu_allan.result import Result
from imu_allan.tuning.field_test import FieldTest
from imu_allan.tuning.forecast import FORECAST_S, predicted_drift
from imu_allan.tuning.tune import Bias
from imu_allan.tuning.verification import Verification
from imu_allan.writers.tuning_table import Choice, choices, known_axes
import numpy as np

SCHEMA = 'imu_allan.tuning/1'


def tuning_document(result: Result, aiding_s: float, coast_s: float, bias: Bias,
                    calibration_s: float = 60.0) -> dict[str, Any]:
    """Return what the tables show."""
    axes: dict[str, Any] = {}
    for name, axis in known_axes(result).items():
        forecast = predicted_drift(axis, FORECAST_S, calibration_s)
        axes[name] = {'choices': [_plain(choice) for choice in
                                  choices(axis, aiding_s, coast_s, bias)],
                      'forecast': {'calibration_s': forecast.calibration_s,
                                   'horizons_s': list(forecast.horizons_s),
                                   'integral': list(forecast.integral),
                                   'integral_ci95': _lists(forecast.integral_ci95),
                                   'position': forecast.position and list(forecast.position),
                                   'position_ci95': forecast.position_ci95 and _lists(
                                       forecast.position_ci95),
                                   'known_to_s': forecast.known_to_s}}
    return {'schema': SCHEMA, 'aiding_interval_s': aiding_s, 'coast_s': coast_s, 'bias': bias,
            'axes': axes}


def _plain(choice: Choice) -> dict[str, Any]:
    line: dict[str, Any] = {'numbers': choice.name, 'nis': choice.nis,
                            'coast_ratio': choice.coast_ratio, 'coast_sigma': choice.coast_sigma}
    if choice.tuning is not None:
        tuning = choice.tuning
        line.update(noise_density=tuning.noise_density, random_walk=tuning.random_walk,
                    sigma=tuning.sigma, correlation_time_s=tuning.correlation_time_s,
                    consistency=[list(row) for row in tuning.consistency],
                    known_from_s=tuning.known_from_s, known_to_s=tuning.known_to_s)
    return line


def _lists(pairs: Iterable[tuple[float, float]]) -> list[list[float]]:
    return [list(pair) for pair in pairs]


def field_test_document(found: Mapping[str, FieldTest], against: Mapping[str, Verification],
                        bias: Bias = 'random_walk') -> dict[str, Any]:
    """Return what the tables show."""
    axes: dict[str, Any] = {}
    second = 'walk' if bias == 'random_walk' else 'sigma'
    for name, one in against.items():
        axes[name] = {'noise_factor': one.noise_factor, 'noise_ci95': _finite(one.noise_ci95),
                      f'{second}_factor': one.walk_factor,
                      f'{second}_ci95': _finite(one.walk_ci95),
                      'excess': [asdict(excess) for excess in one.excess]}
        if name in found:
            test = found[name]
            axes[name] |= {'tested_s': test.tested_s, 'stops': test.stops,
                           'tuned': asdict(test.tuned), 'full': asdict(test.full)}
    return axes


def _finite(ends: tuple[float, float]) -> list[float | None]:
    return [end if np.isfinite(end) else None for end in ends]
