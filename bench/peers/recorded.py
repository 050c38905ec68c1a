# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What every tool is given, and what it answers."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

N, B, K = 'noise_density', 'bias_instability', 'rate_random_walk'
Q, R = 'quantization_noise', 'rate_ramp'
FILTER_N, FILTER_K = 'filter_noise_density', 'filter_random_walk'
"""What a tool gives to a filter, where it says something else than the coefficients."""
CORRECTED_S = 10.0
"""How often something else corrects the filter that tries the numbers."""
AXES = ('gyro_x', 'gyro_y', 'gyro_z', 'accel_x', 'accel_y', 'accel_z')


class RefusedError(Exception):
    """The tool gives no numbers for this recording; the message says why, in its own words."""


@dataclass(frozen=True)
class Recorded:
    """
    One recording of an IMU at rest.

    Attributes
    ----------
    path : Path
        Recording that a program can open: a rosbag2 folder with MCAP.
    samples : ndarray, shape (n, 6)
        Its samples in the order in which they were recorded, columns as in AXES, rad/s and m/s^2.
    rate_hz : float
        Sample rate.

    """

    path: Path
    samples: Array
    rate_hz: float


@dataclass(frozen=True)
class Estimate:
    """A coefficient in SI units, None where the tool reports none; a 95 % interval if it has."""

    value: float | None
    low: float | None = None
    high: float | None = None


Answer = Mapping[str, Mapping[str, Estimate]]
"""By axis and coefficient."""


def overlapped(samples: Array, rate_hz: float, sizes: NDArray[np.int64]) -> tuple[Array, Array]:
    """Return averaging times in s and overlapped Allan variances, those of each axis a row."""
    phase = np.vstack([np.zeros(samples.shape[1]),
                       np.cumsum(samples - samples[0], axis=0)]) / rate_hz
    variances = [np.mean((phase[2 * m:] - 2 * phase[m:-m] + phase[:-2 * m])**2, axis=0)
                 / (2 * (m / rate_hz)**2) for m in sizes.tolist()]
    return sizes / rate_hz, np.array(variances).T


def log_sizes(largest: int, count: int) -> NDArray[np.int64]:
    """Return up to `count` cluster sizes, evenly spaced on a logarithmic scale."""
    return np.unique(np.ceil(np.logspace(0, np.log10(largest), count)).astype(np.int64))
