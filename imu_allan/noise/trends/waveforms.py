# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Functions of time that describe trends of the mean: bends, steps, warm-ups, cycles."""

from imu_allan.noise.trends.leakage import Waveform
import numpy as np


def legendre(order: int, duration_s: float) -> Waveform:
    """Return a Legendre polynomial over the record."""
    coefficients = [0.0] * order + [1.0]
    return lambda time: np.asarray(
        np.polynomial.legendre.legval(2 * time / duration_s - 1, coefficients))


def step(at_s: float) -> Waveform:
    """Return a step from 0 to 1."""
    return lambda time: np.asarray(time > at_s, np.float64)


def warming(time_constant_s: float) -> Waveform:
    """Return an exponential decay from 1 at the beginning of the record to 0."""
    return lambda time: np.exp(-time / time_constant_s)


def cycle(frequency_hz: float, zero_s: float = 0.0) -> tuple[Waveform, Waveform]:
    """Return cosine and sine of a frequency, of phase zero at a time."""
    omega = 2 * np.pi * frequency_hz
    return (lambda time: np.cos(omega * (time - zero_s)),
            lambda time: np.sin(omega * (time - zero_s)))
