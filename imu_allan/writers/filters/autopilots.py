# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Parameters of autopilots, safe to load as they are.

At rest a sensor shows less noise than in flight, where vibration dominates. A file that is loaded
as it is must therefore not hold less than the autopilot's own defaults: the larger of both stands
in it, and the measured value beside it.
"""

from collections.abc import Callable, Iterator
from math import sqrt

from imu_allan.writers.filters.chosen_numbers import K, N, Numbers
from imu_allan.writers.filters.layout import (
    heading,
    joined,
    Pair,
    real,
    SAMPLE_UNITS,
    worst,
)

PX4_HZ = 100.0
"""EKF2_PREDICT_US is 10000 by default."""
ARDUPILOT_HZ = 83.0
"""EKF_TARGET_DT in AP_NavEKF3_core.h is 0.012 s."""

_Parameters = dict[Pair, tuple[str, float, float]]


def px4(numbers: Numbers) -> str:
    """
    PX4's EKF2 parameters as QGroundControl loads them: N sqrt(F), K sqrt(F), F = 100 Hz.

    ``predictCovariance`` (covariance.cpp) squares ``dt value``; defaults and ranges are those of
    the parameters' metadata.
    """
    names: _Parameters = {('accel', N): ('EKF2_ACC_NOISE', 0.35, 1.0),
                          ('accel', K): ('EKF2_ACC_B_NOISE', 0.003, 0.01),
                          ('gyro', N): ('EKF2_GYR_NOISE', 0.015, 0.1),
                          ('gyro', K): ('EKF2_GYR_B_NOISE', 0.001, 0.01)}
    lines = [*heading(numbers), '# Vehicle-Id Component-Id Name Value Type']
    lines += _parameters(numbers, 'PX4', numbers.rate(PX4_HZ), names,
                         lambda name, value: f'1\t1\t{name}\t{value}\t9')
    return joined(lines)


def ardupilot(numbers: Numbers) -> str:
    """
    Write ArduPilot's EKF3 parameters: N sqrt(F), K sqrt(F), F = 83 Hz.

    ``NavEKF3_core::CovariancePrediction`` (AP_NavEKF3_core.cpp) squares ``dt value`` for the
    noises and ``dt^2 value`` for the biases, which are those of an angle or a velocity over dt;
    defaults and ranges are those of the parameters' metadata (AP_NavEKF3.cpp).
    """
    names: _Parameters = {('accel', N): ('EK3_ACC_P_NSE', 0.35, 1.0),
                          ('accel', K): ('EK3_ABIAS_P_NSE', 0.02, 0.02),
                          ('gyro', N): ('EK3_GYRO_P_NSE', 0.015, 0.1),
                          ('gyro', K): ('EK3_GBIAS_P_NSE', 0.001, 0.001)}
    lines = heading(numbers)
    lines += _parameters(numbers, 'ArduPilot', numbers.rate(ARDUPILOT_HZ), names,
                         lambda name, value: f'{name},{value}')
    return joined(lines)


def _parameters(numbers: Numbers, name: str, rate: float, names: _Parameters,
                line: Callable[[str, str], str]) -> Iterator[str]:
    yield f'# Per prediction step at F = {rate:g} Hz: N sqrt(F) and K sqrt(F).'
    yield '# Measured at rest, they are LOWER BOUNDS: in flight vibration dominates. This file is'
    yield f"# safe to load: where {name}'s default is larger, the default stands. Go towards the"
    yield "# measured value only as far as the logs' innovation test ratios allow. What is"
    yield '# expected above is of the numbers at rest.'
    root = sqrt(rate)
    for (sensor, key), (parameter, usual, highest) in names.items():
        entry = worst(numbers, sensor, key, lambda value: value * root, 'sqrt(F)',
                      SAMPLE_UNITS[sensor, key])
        yield ''
        yield from (f'# {remark}' for remark in entry.remarks)
        if entry.value is None:
            yield f'# {parameter}'
            continue
        value = min(max(entry.value, usual), highest)
        yield f"# at rest {real(entry.value)}; {name}'s default {usual:g}, at most {highest:g}"
        yield line(parameter, real(value))
