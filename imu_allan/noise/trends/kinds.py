# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Kinds of deterministic drift of the mean that are added to the noise models.

A trend has one column, a cycle two, and a nuisance on a grid.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from imu_allan.arrays import Array
from imu_allan.noise.trends.leakage import Waveform
from imu_allan.noise.trends.temperature_series import TemperatureSeries
import numpy as np


@dataclass(frozen=True)
class TrendKind:
    """
    A kind of deterministic drift of the mean.

    Attributes
    ----------
    key : str
    prior : float
        Prior probability of presence per unit of the logarithm of the amplitude.
    grid : callable
        Equally likely values of the nuisance, given the duration in seconds. It may lie between
        them, unless there is only one.
    columns : callable
        Functions of time, given the nuisance and the duration.
    most : int
        Most trends of this kind in one model: a die and its housing warm up separately.
    smooth : bool
        Whether the columns change smoothly with the logarithm of the nuisance.

    """

    key: str
    prior: float
    grid: Callable[[float], Array]
    columns: Callable[[float, float], tuple[Waveform, ...]]
    most: int = 1
    smooth: bool = False

    def slopes(self, value: float, duration_s: float) -> tuple[Waveform, ...]:
        """Return the derivatives of the columns by the log nuisance, if they are smooth in it."""
        # The relative step of the numerical derivative is 0.01.
        def slope(more: Waveform, less: Waveform) -> Waveform:
            return lambda time: np.asarray((more(time) - less(time)) / 0.02)

        return tuple(map(slope, self.columns(1.01 * value, duration_s),
                         self.columns(0.99 * value, duration_s))) if self.smooth else ()


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


TRENDS = (
    TrendKind('warm_up', 0.10, lambda duration: duration * np.geomspace(0.003, 4.0, 23),
              lambda time, _: (warming(time),), most=2, smooth=True),
    TrendKind('bias_step', 0.02, lambda duration: duration * np.arange(1, 128) / 128,
              lambda time, _: (step(time),), most=2),
    TrendKind('slow_cycle', 0.10, lambda duration: np.arange(1.5, 32.1, 0.25) / duration,
              lambda frequency, _: cycle(frequency), smooth=True),
    # The polynomial of order 2 is a warm-up that is slower than the record.
    TrendKind('bend', 0.05, lambda _: np.array([3.0]),
              lambda order, duration: (legendre(int(order), duration),)),
)


def lags_of(temperature: TemperatureSeries) -> Array:
    """Return the thermometer lags that a record can resolve, in seconds behind the sensor."""
    # A lag of more than an eighth of the record cannot be distinguished from the ramp.
    longest = temperature.duration_s / 8
    # The thermometer may lag behind the sensor or be ahead. Less than 20 s count as no lag.
    lags = (20.0, 40.0, 80.0, 160.0, 320.0, 640.0, 1280.0)
    return np.sort([0.0, *(sign * lag for lag in lags if lag < longest for sign in (1, -1))])


def kinds_of_trends(temperature: TemperatureSeries | None) -> tuple[TrendKind, ...]:
    """Return `TRENDS`, preceded by the lagged temperature if it is known."""
    if temperature is None:
        return TRENDS
    lags = lags_of(temperature)
    return (TrendKind('temperature', 0.15, lambda _: lags,
                      lambda lag, _: (temperature.of_sensor(lag).trend,)), *TRENDS)


@dataclass(frozen=True)
class Found:
    """
    A trend at one value of its nuisance.

    Attributes
    ----------
    kind : TrendKind
    value : float
    interval : (float, float)
        95 % interval of the nuisance.
    share : float
        Log of the factor by which the integral over the nuisance changes the evidence.

    """

    kind: TrendKind
    value: float
    interval: tuple[float, float]
    share: float

    @property
    def width(self) -> int:
        """Return the number of columns."""
        return len(self.kind.columns(self.value, 1.0))


def waveforms(trends: Sequence[Found], duration_s: float) -> list[Waveform]:
    """Return trends as functions of time."""
    return [column for trend in trends for column in trend.kind.columns(trend.value, duration_s)]
