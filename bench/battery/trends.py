# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Trends of the mean over an hour or two, in units of B; times in seconds."""

from battery.sensors import Array, Trend
import numpy as np

_HOUR = 3600.0


def ramp(rise: float) -> Trend:
    """Return a ramp that rises by so much in an hour."""
    return lambda time: rise * time / _HOUR


def settling(size: float, time_s: float) -> Trend:
    """Return a warm-up."""
    return lambda time: np.asarray(size * np.exp(-time / time_s))


def step(size: float, hours: float) -> Trend:
    """Return a step."""
    return lambda time: np.asarray(size * (time > hours * _HOUR))


def two_steps(size: float) -> Trend:
    """Return a step up and a larger one down."""
    return lambda time: np.asarray(step(size, 0.23)(time) - step(1.5 * size, 0.71)(time))


def cycle(size: float, period_s: float) -> Trend:
    """Return a sine."""
    return lambda time: np.asarray(size * np.sin(2 * np.pi * time / period_s))


def bump(size: float) -> Trend:
    """Return a bump of a few minutes."""
    def trend(time: Array) -> Array:
        return np.asarray(size * np.exp(-((time - 0.41 * _HOUR) / 300)**2 / 2))

    return trend
