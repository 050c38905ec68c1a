# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Predicted drift against integrals of the covariance on a fine grid."""

from drifting_axes import axis_of
from imu_allan.tuning.forecast import predicted_drift
import numpy as np
import pytest

BEFORE, AFTER, POINTS = 7.0, 20.0, 2700


def by_quadrature(kernel, position=False):
    """Root of the variance of what is integrated after zero, calibrated before."""
    step = (BEFORE + AFTER) / POINTS
    u = -BEFORE + (np.arange(POINTS) + 0.5) * step
    weight = np.where(u > 0, AFTER - u if position else 1.0,
                      -(AFTER**2 / 2 if position else AFTER) / BEFORE)
    return float(np.sqrt(weight @ kernel(u[:, None], u[None, :]) @ weight) * step)


def white(u, v):
    return (u == v) * 4.0 * POINTS / (BEFORE + AFTER)


def walk(u, v):
    return 0.09 * np.where(u * v > 0, np.minimum(np.abs(u), np.abs(v)), 0)


def markov(time):
    return lambda u, v: 0.25 * np.exp(-np.abs(u - v) / time)


CASES = [({'noise_density': 2.0}, white), ({'walk': 0.3}, walk)] + [
    ({'processes': ((0.5, time),)}, markov(time)) for time in (0.8, 15.0, 300.0, 1e4)]


@pytest.mark.parametrize(('terms', 'kernel'), CASES)
def test_angle_and_position_are_those_of_the_integrated_covariance(terms, kernel):
    axis = axis_of(**terms, quantity='linear_acceleration')
    forecast = predicted_drift(axis, [AFTER], BEFORE)
    assert forecast.integral[0] == pytest.approx(by_quadrature(kernel), rel=2e-3)
    assert forecast.position[0] == pytest.approx(by_quadrature(kernel, True), rel=2e-3)


def test_the_band_holds_the_value_and_widens_with_the_horizon():
    forecast = predicted_drift(axis_of(1e-3, 1e-5), [1.0, 60.0, 2000.0])
    widths = [high / low for low, high in forecast.integral_ci95]
    assert widths == sorted(widths)
    for value, (low, high) in zip(forecast.integral, forecast.integral_ci95, strict=True):
        assert low < value < high
    # A gyroscope has no position.
    assert forecast.position is forecast.position_ci95 is None
    assert predicted_drift(axis_of(1e-3)).horizons_s == (1.0, 10.0, 60.0, 600.0)
