# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Values that no such sensor has at rest, and what they are likely to be instead.

The limits lie above the worst datasheets of sensors on the market, which docs/faq.md lists. Values
beyond them are in another unit, raw counts, or due to motion. One gyroscope, of 20,000 deg/s, has
more noise: a limit above that would let many pass whose unit is deg/s.
"""

from collections.abc import Mapping
from math import degrees
from typing import NamedTuple

from imu_allan.finding import Finding, finding
from imu_allan.result import AxisResult
from imu_allan.sensor.units import STANDARD_GRAVITY


class Limits(NamedTuple):
    """Largest values at rest, in SI units."""

    noise_density: float
    mean: float
    spread: float    # between samples: Allan deviation at the shortest averaging time
    # The unit most often taken for SI, after the factor by which it makes a number too large
    factor: float
    unit: str


PLAUSIBLE = {
    'angular_velocity': Limits(2e-3, 1.5, 0.5, degrees(1), 'deg/s'),
    # The mean includes gravity, 9.81 m/s^2.
    'linear_acceleration': Limits(0.2, 20.0, 5.0, 1e3 / STANDARD_GRAVITY, 'mg'),
}


def implausible(axes: Mapping[str, AxisResult]) -> list[Finding]:
    """Find axes whose noise density, mean or spread is beyond `PLAUSIBLE`; code `implausible`."""
    beyond: dict[str, list[tuple[str, float, float, str]]] = {}
    for name, axis in axes.items():
        limits = PLAUSIBLE[axis.quantity]
        noise = axis.coefficients.get('noise_density')
        beyond[name] = [(what, value, most, of) for what, value, most, of in (
            ('noise_density', noise.value if noise is not None else None,
             limits.noise_density, f'{axis.unit}/sqrt(Hz)'),
            ('mean', axis.mean, limits.mean, axis.unit),
            ('spread', axis.curve.adev[0] if axis.curve.adev else None, limits.spread, axis.unit))
            if value is not None and abs(value) > most]
    # Gravity tells counts from mg where noise does not.
    counts = {axes[name].quantity for name, own in beyond.items() for _, value, most, _ in own
              if abs(value) > PLAUSIBLE[axes[name].quantity].factor * most}
    return [finding('implausible', (name,), what=what, value=value, limit=most, unit=of,
                    likely='counts' if (kind := axes[name].quantity) in counts
                    else PLAUSIBLE[kind].unit)
            for name, own in beyond.items() for what, value, most, of in own[:1]]
