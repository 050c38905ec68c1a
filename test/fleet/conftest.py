# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A fleet whose every number is known."""

from dataclasses import replace

from imu_allan.noise.terms import AXES, TERMS
from imu_allan.result import (
    AxisResult,
    Coefficient,
    Curve,
    GoodnessOfFit,
    Result,
    Source,
    Timeline,
)
import numpy as np
import pytest

TRUTH = {'noise_density': (1e-4, 0.05, 0.002), 'bias_instability': (2e-5, 0.2, 0.08)}
"""Median, and the relative spread between units and of measuring."""


def unit(rng, **factors):
    axes = {}
    for name, quantity in AXES.items():
        coefficients = {}
        for key, term in TERMS.items():
            if key in TRUTH:
                median, between, error = TRUTH[key]
                value = median * factors.get(name, 1.0) * np.exp(
                    between * rng.normal() + error * rng.normal())
                half = 1.96 * error
                coefficients[key] = Coefficient(
                    term.symbol, term.unit(quantity), True, float(value),
                    (float(value * np.exp(-half)), float(value * np.exp(half))), None)
            else:
                coefficients[key] = Coefficient(term.symbol, term.unit(quantity), False, None,
                                                None, 1e-6)
        tau = tuple((2.0 ** np.arange(14) / 100).tolist())
        adev = tuple(float(coefficients['noise_density'].value / t**0.5) for t in tau)
        pairs = tuple((a * 0.9, a * 1.1) for a in adev)
        axes[name] = AxisResult(quantity.value, quantity.unit, float(0.01 * rng.normal()), None,
                                (), coefficients, GoodnessOfFit(0.5, 0.0, True),
                                Curve(tau, adev, adev, pairs, pairs, adev))
    return Result('0.1.0', Source('recording', 'unit', '/imu', 'imu', None, 'header'),
                  Timeline(100.0, 360_000, 3600.0), axes)


@pytest.fixture
def fleet():
    """Forty units, of which unit7 has a noisy gyro_y and unit23 a constant accel_x."""
    rng = np.random.default_rng(8)
    results = {f'unit{number}': unit(rng, **({'gyro_y': 1.6} if number == 7 else {}))
               for number in range(1, 41)}
    bad = results['unit23']
    flat = replace(bad.axes['accel_x'], curve=replace(bad.axes['accel_x'].curve, adev=(0.0,) * 14))
    results['unit23'] = replace(bad, axes={**bad.axes, 'accel_x': flat})
    return results


@pytest.fixture
def six():
    """Make six units that differ by 2 %, all gyroscope axes of unit2 noisier by a factor."""
    def units(lift=1.0):
        rng = np.random.default_rng(3)
        made = {f'unit{number}': unit(rng) for number in range(1, 7)}
        for name, result in made.items():
            for axis in AXES:
                density = result.axes[axis].coefficients['noise_density']
                value = 1e-4 * float(np.exp(0.02 * rng.normal())) * (
                    lift if name == 'unit2' and axis.startswith('gyro') else 1.0)
                result.axes[axis].coefficients['noise_density'] = replace(
                    density, value=value, ci95=(0.99 * value, 1.01 * value))
        return made
    return units
