# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A result made from a datasheet, so that configurations can be written without measurements."""

from collections.abc import Mapping

from imu_allan import result as schema
from imu_allan.errors import ImuAllanError, printable
from imu_allan.noise.terms import AXES, TERMS
from imu_allan.sensor.noise_model import NoiseModel
from imu_allan.version import __version__


def result_of_datasheet(datasheet: NoiseModel, path: str, rate_hz: float | None = None
                        ) -> schema.Result:
    """Return the coefficients of a datasheet as a result without curves or intervals."""
    axes = {name: _axis(name, datasheet.axes[name]) for name in AXES
            if 'noise_density' in datasheet.axes.get(name, {})}
    if not axes:
        raise ImuAllanError(f'{printable(path)}: a datasheet without noise_density; a filter '
                            'needs one, such as gyro: {noise_density: 0.03 deg/s/sqrt(Hz)}')
    return schema.Result(
        imu_allan_version=__version__,
        source=schema.Source('datasheet', path, None, None, None, None),
        timeline=schema.Timeline(rate_hz, 0, 0.0), axes=axes)


def _axis(name: str, values: Mapping[str, float]) -> schema.AxisResult:
    quantity = AXES[name]
    return schema.AxisResult(
        quantity=quantity.value, unit=quantity.unit, mean=None, band_limit_s=None, tones=(),
        coefficients={key: schema.Coefficient(
            term.symbol, term.unit(quantity), key in values,
            None if key not in values else abs(values[key]), None, None)
            for key, term in TERMS.items()},
        goodness_of_fit=schema.GoodnessOfFit(None, None, True),
        curve=schema.Curve((), (), (), (), (), ()))
