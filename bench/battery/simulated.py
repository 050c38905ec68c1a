# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Simulated samples that owe nothing to the package which is judged by them.

Noise that goes with f^-a is a sum of first-order Gauss-Markov processes with correlation times two
octaves apart, from a 64th of a sample to 100,000 records; its spectrum ripples by less than 1 %.
Every process is averaged over the sample interval: that makes it an ARMA(1,1), which is drawn
exactly.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]

_RATIO = 4.0
_FASTEST = 1 / 64
_SLOWEST = 1e5


def white(samples: int, rng: np.random.Generator) -> Array:
    """White noise of unit density, sampled once a second."""
    return np.asarray(rng.standard_normal(samples))


def quantization(samples: int, rng: np.random.Generator) -> Array:
    """Quantization noise of unit coefficient, sampled once a second."""
    return np.asarray(np.diff(rng.standard_normal(samples + 1)), np.float64)


def walk(samples: int, rng: np.random.Generator) -> Array:
    """Random walk of unit coefficient, averaged over each second."""
    step = rng.standard_normal(samples)
    # Of its own second a mean has half the step, and the Brownian bridge between the ends.
    return np.asarray(np.cumsum(step) - step / 2 + rng.standard_normal(samples) / np.sqrt(12))


def process(samples: int, time: float, rng: np.random.Generator) -> Array:
    """Gauss-Markov process of unit variance and this correlation time, averaged over seconds."""
    decay, variance, next_one = process_covariance(time)
    # y_k = decay y_{k-1} + w_k + echo w_{k-1} has these first two covariances.
    own = (1 + decay**2) * variance - 2 * decay * next_one
    crossed = next_one - decay * variance
    ratio = own / crossed
    echo = (ratio - np.copysign(np.sqrt(ratio**2 - 4), ratio)) / 2
    power = crossed / echo
    start = np.sqrt(max(variance - power, 0.0)) * rng.standard_normal(1)
    drawn, _ = lfilter([1.0, echo], [1.0, -decay],
                       np.sqrt(power) * rng.standard_normal(samples), zi=start)
    return np.asarray(drawn)


def process_covariance(time: float) -> tuple[float, float, float]:
    """
    Give decay over a second, variance of the means over seconds, and covariance of neighbours.

    Every further covariance is the one before times the decay.
    """
    rate = 1 / time
    decay, gain = float(np.exp(-rate)), float(-np.expm1(-rate) / rate)
    # Of slow processes the closed form is a small difference of large numbers.
    variance = (1 - rate / 3 + rate**2 / 12 - rate**3 / 60 if rate < 1e-3
                else 2 / rate * (1 - gain))
    return decay, variance, gain**2


def power_law(samples: int, exponent: float, rng: np.random.Generator) -> Array:
    """Noise of two-sided density (2 pi f)^-exponent, averaged over seconds: flicker where 1."""
    octaves = np.log(_SLOWEST * samples / _FASTEST) / np.log(_RATIO)
    times = _FASTEST * _RATIO ** np.arange(np.ceil(octaves))
    size = np.sin(np.pi * exponent / 2) * np.log(_RATIO) / np.pi
    # The members still faster are white in the samples: a geometric sum.
    faster = 2 * size * _FASTEST**exponent / (_RATIO**exponent - 1)
    total = np.sqrt(faster) * rng.standard_normal(samples)
    for time in times:
        total += np.sqrt(size * time**(exponent - 1)) * process(samples, time, rng)
    return np.asarray(total - total[0])
