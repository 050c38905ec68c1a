# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Options with which the user describes a recording."""

from dataclasses import dataclass
from pathlib import Path

from imu_allan.errors import brief, ImuAllanError, positive
from imu_allan.sensor.units import convert

RAD_PER_S, M_PER_S2 = 'rad/s', 'm/s^2'


@dataclass(frozen=True)
class RecordingOptions:
    """
    Options with which the user describes a recording; all are optional.

    Attributes
    ----------
    rate_hz : float or None
        Sample rate in Hz of a CSV file without a time column.
    definitions : tuple of path-like
        ``.msg`` files, or folders of them, for types that the recording does not define.
    gyro, accel : str or None
        Message field that holds the vector, and its unit: ``imu.gyro[0:3] deg/s``.
    stamp : str or None
        Field that holds the time: seconds and nanoseconds, or a number with its unit (``t us``).
    gyro_unit, accel_unit : str or None
        Unit of the samples, instead of rad/s and m/s^2.
    gyro_topic, accel_topic : str or None
        The two topics of an IMU whose gyroscope and accelerometer are published separately.
    columns : tuple of (str, str)
        Pairs of an axis (or ``time``) and a CSV column. The column is given by name or by number
        from 1, followed by its unit if that differs from SI: ``('gyro_x', '2 deg/s')``.
    accel_rate_hz : float or None
        Sample rate in Hz of an accelerometer on a separate topic.
    temperature : str or None
        Topic, message field or CSV column that holds the temperature of the IMU.

    """

    rate_hz: float | None = None
    definitions: tuple[Path | str, ...] = ()
    gyro: str | None = None
    accel: str | None = None
    stamp: str | None = None
    gyro_unit: str | None = None
    accel_unit: str | None = None
    gyro_topic: str | None = None
    accel_topic: str | None = None
    columns: tuple[tuple[str, str], ...] = ()
    accel_rate_hz: float | None = None
    temperature: str | None = None

    def __post_init__(self) -> None:
        """Raise ImuAllanError for a wrong unit or rate, or a time without samples."""
        for name in ('rate_hz', 'accel_rate_hz'):
            if (rate_hz := getattr(self, name)) is not None:
                object.__setattr__(self, name, positive(name, rate_hz))
        if self.stamp is not None and self.gyro is self.accel is None:
            raise ImuAllanError('--stamp is for messages whose fields are named: give --gyro or '
                                '--accel, too')
        self.factors  # noqa: B018

    @property
    def factors(self) -> tuple[float, float]:
        """Return the factors that convert gyroscope and accelerometer samples to SI units."""
        return (factor('--gyro unit', self.gyro_unit, RAD_PER_S),
                factor('--accel unit', self.accel_unit, M_PER_S2))


def factor(option: str, unit: str | None, si_unit: str) -> float:
    """Return the number of SI units in one `unit`, 1 for None; raise ImuAllanError if unknown."""
    if unit is None or unit == si_unit:
        return 1.0
    try:
        return convert(1.0, unit, si_unit)
    except ImuAllanError as error:
        other = 'deg/s, of counts deg/s/131' if si_unit == RAD_PER_S else 'g, of counts g/16384'
        raise ImuAllanError(f'{option} {brief(unit, 80)}: {error}; write {si_unit} '
                            f'or {other}') from error
