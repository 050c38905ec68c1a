# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Numbers that no sensor of the kind has at rest, and what they are likely to be instead.

The limits are argued from physics, not from datasheets, and lie an order of magnitude beyond what
is in use: what passes them is another unit, raw counts, or was moved.
"""

from collections.abc import Mapping
from math import degrees

from imu_allan.finding import Finding, finding
from imu_allan.result import AxisResult
from imu_allan.sensor.units import STANDARD_GRAVITY

# Largest mean and noise density, and how many times too large a number is in the unit that is most
# often taken for SI, which has the name behind it.
LIMITS = {
    # A turn in six seconds is no bias, 13,000 times the Earth's rate. 2000 deg/s in 16 bits at
    # 100 Hz round by 4e-5 rad/s/sqrt(Hz): this is a hundred times as much, 17 deg/sqrt(h).
    'angular_velocity': (1.0, 5e-3, degrees(1), 'deg/s'),
    # At rest an axis has gravity, 9.81 m/s^2, at most, and a bias of as much again. This noise is
    # a tilt of four degrees from sample to sample at 100 Hz.
    'linear_acceleration': (20.0, 0.1, 1e3 / STANDARD_GRAVITY, 'mg'),
}


def implausible(axes: Mapping[str, AxisResult]) -> list[Finding]:
    """
    Find axes whose mean or noise density is beyond `LIMITS`; code `implausible`.

    Examples
    --------
    >>> implausible({})
    []

    """
    found = []
    for name, axis in axes.items():
        largest_mean, largest_density, factor, unit = LIMITS[axis.quantity]
        noise = axis.coefficients.get('noise_density')
        for what, value, most, of in (
                ('noise_density', noise.value if noise is not None else None, largest_density,
                 f'{axis.unit}/sqrt(Hz)'), ('mean', axis.mean, largest_mean, axis.unit)):
            if value is not None and abs(value) > most:
                found.append(finding(
                    'implausible', (name,), what=what, value=value, limit=most, unit=of,
                    likely=unit if abs(value) <= factor * most else 'counts'))
                break
    return found
