# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Choice of the numbers for a configuration.

They are tuned from the drift model for the measurements that correct the consumer, unless the
measured coefficients are requested. If a coefficient is not observable, its 95 % upper bound is
used and a comment says so: a filter needs a number, and this one is not too small. Dead axes are
named. The numbers of a datasheet replace a result where there are no measurements.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from math import sqrt
from statistics import median_high
from typing import get_args, Literal

from imu_allan import result as schema
from imu_allan.errors import ImuAllanError, printable
from imu_allan.noise.terms import (
    allan_variance,
    AXES,
    FLICKER_FLOOR,
    gauss_markov_avar,
    SLOW_TERMS,
    TERMS,
)
from imu_allan.noise.uncertainty import value_or_bound
from imu_allan.result import AxisResult, Interval, Result
from imu_allan.sensor.noise_model import NoiseModel
from imu_allan.tuning.tune import Bias, FilterTuning, tune
from imu_allan.version import __version__
from imu_allan.writers.curves import axes_of
from imu_allan.writers.supported_filters import CONSUMERS

Key = Literal['N', 'K', 'sigma', 'Tc']
Sensor = Literal['accel', 'gyro']
Scale = Callable[[float], float]

SENSORS: dict[Sensor, str] = {'accel': 'accelerometer', 'gyro': 'gyroscope'}
_SIGMA, _PEAK = 1.08, 1.89
"""Sigma of a process as large as flicker of B = 1, and the averaging time of its largest Allan
deviation, in correlation times: J. Farrell et al., IEEE Control Systems 42(6), 2022."""


def times(factor: float) -> Scale:
    """Return a function that multiplies by a factor."""
    return lambda value: value * factor


@dataclass(frozen=True)
class ExportOptions:
    """
    The user's options for a configuration.

    Attributes
    ----------
    rate_hz : float or None
        Rate at which the consumer takes samples or predicts, if not the usual one.
    as_measured : bool
        Whether to use the measured coefficients instead of tuned numbers.
    aiding_s, coast_s : float or None
        Time between corrections, and the longest time without; by default those of the consumer.
    conservative : bool
        Whether to tune for the upper end of the 95 % interval of the expected error.
    inflate : mapping
        Additional factors on ``N`` and ``K``.

    """

    rate_hz: float | None = None
    as_measured: bool = False
    aiding_s: float | None = None
    coast_s: float | None = None
    conservative: bool = False
    inflate: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Number:
    """
    One number for one axis.

    Attributes
    ----------
    value : float
    bound : bool
        Whether it is an upper bound.
    interval : (float, float) or None
        95 % interval, if it was measured.
    of_flicker : bool
        Whether it stands for slow noise of another kind, such as flicker.

    """

    value: float
    bound: bool = False
    interval: Interval | None = None
    of_flicker: bool = False


class Numbers:
    """
    The numbers of all axes for one consumer.

    Parameters
    ----------
    result : Result
    name : str
        Name of the consumer in the command.
    options : ExportOptions

    Raises
    ------
    ImuAllanError
        If no axis has any number, or the options contradict each other.

    """

    def __init__(self, result: Result, name: str, options: ExportOptions) -> None:
        self.result, self.name, self.options = result, name, options
        self.consumer = consumer = CONSUMERS[name]
        self.aiding_s = options.aiding_s or consumer.aiding.interval_s
        self.coast_s = options.coast_s or max(consumer.aiding.coast_s, self.aiding_s or 0.0)
        if self.of_datasheet and options.conservative:
            raise ImuAllanError('a datasheet has no intervals to be conservative about; '
                                '--inflate N=2,K=5 makes its numbers larger')
        if options.as_measured and options.conservative:
            raise ImuAllanError('--conservative is a way to tune, --as-measured does without: '
                                'give one of the two')
        self.tunings = self._tunings()
        self.coefficients = {axis: _measured(found, consumer.bias, self.coast_s)
                             for axis, found in result.axes.items()}
        if self.of_datasheet and self.aiding_s is not None and not options.as_measured:
            self._let_the_bias_follow_slow_noise()
        self.of_axis: dict[str, dict[Key, Number]] = {
            axis: {} if found.high_passed_hz is not None else self._numbers(axis)
            for axis, found in result.axes.items()}
        if consumer.one_time:
            self._agree_on_a_time()
        if not any(self.of_axis.values()):
            why = ('a filter has taken out the slow part of every axis that has noise); take the '
                   'raw topic' if any(axis.high_passed_hz is not None
                                      for axis in result.axes.values()) else
                   'constant or too short); look at the driver, or record longer')
            raise ImuAllanError(f'no configuration for {name}: no axis of this result has a '
                                f'noise density ({why}')

    def known(self, sensor: Sensor, key: Key) -> dict[str, Number]:
        """Return this number for the axes of a sensor that have it."""
        return {name: numbers[key] for name, numbers in axes_of(self.of_axis, sensor).items()
                if key in numbers}

    def worst(self, sensor: Sensor, key: Key) -> tuple[str, Number] | None:
        """
        Return the axis with the largest number, or None if no axis has one.

        Correlation time and driving density are those of the axis with the largest sigma.
        Parameters from different axes would describe a process of none of them.
        """
        known = self.known(sensor, key)
        if not known:
            return None
        by = (self.known(sensor, 'sigma') if key in ('K', 'Tc') else None) or known
        name = max(by, key=lambda axis: by[axis].value)
        return name, known[name]

    def measured(self, name: str, key: Key, scale: Scale = float) -> str:
        """Return the measured value and interval, or the bound, of an axis as text."""
        found = self.coefficients[name].get(key)
        if found is None:
            return 'not measured'
        value = f'{scale(found.value):.4g}'
        if found.bound:
            return f'measured below {value}, not observable'
        if self.of_datasheet:
            terms = ', '.join(_slow_noise(self.result.axes[name], self.coast_s))
            return f'{f"from {terms}" if found.of_flicker else "datasheet"} {value}'
        ends = '' if found.interval is None else (
            f' ({scale(max(found.interval[0], 0.0)):.4g} to {scale(found.interval[1]):.4g})')
        return f'measured {value}{ends}{", of flicker B" if found.of_flicker else ""}'

    @property
    def of_datasheet(self) -> bool:
        """Return whether the numbers come from a datasheet instead of a measurement."""
        return self.result.source.kind == 'datasheet'

    @property
    def no_value(self) -> str:
        """Say that there is no number."""
        return f'{"the datasheet" if self.of_datasheet else "this result"} has no value for it'

    def given(self, sensor: Sensor, name: str) -> dict[Key, Number]:
        """Return the numbers that an axis gets: its own, or those shared with other axes."""
        if self.consumer.share == 'axis':
            return self.of_axis[name]
        found = {key: one[1] for key in get_args(Key)
                 if (one := self.worst(sensor, key)) is not None}
        if self.consumer.share == 'both' and 'K' in found:
            measured = [one[1] for each in SENSORS if (one := self.worst(each, 'K')) is not None]
            found['K'] = max(measured, key=lambda number: number.value)
        return found

    def rate(self, sensor: Sensor | None = None) -> float:
        """Return the rate of the consumer, or of the messages of a sensor."""
        of_messages = None if sensor is None or not self.consumer.per_message else next(
            (axis.sample_rate_hz for axis in axes_of(self.result.axes, sensor).values()
             if axis.sample_rate_hz is not None), None)
        rate = (self.options.rate_hz or of_messages or self.consumer.predicts_hz
                or self.result.timeline.sample_rate_hz)
        if rate is None:
            raise ImuAllanError(f'the configuration for {self.name} needs the sample rate, '
                                'which this result does not have; give it with --rate HZ')
        return rate

    def _tunings(self) -> dict[str, FilterTuning]:
        """Return the tuned numbers of axes with a drift model; none if measured ones are asked."""
        aiding_s, options = self.aiding_s, self.options
        if options.as_measured or aiding_s is None:
            return {}

        def tuned(time_s: float | None = None) -> dict[str, FilterTuning]:
            return {name: tune(axis, aiding_s, self.coast_s, self.consumer.bias,
                               options.conservative, time_s)
                    for name, axis in self.result.axes.items() if axis.drift_model is not None}

        found = tuned()
        if not (self.consumer.one_time and found):
            return found
        # Of the correlation times that the axes choose separately.
        return tuned(median_high(one.correlation_time_s or 0.0 for one in found.values()))

    def _let_the_bias_follow_slow_noise(self) -> None:
        """Give axes the bias that is as large as all their slow noise after the unaided time."""
        for name, numbers in self.coefficients.items():
            axis = self.result.axes[name]
            parts = _slow_noise(axis, self.coast_s)
            level = sqrt(sum(parts.values()))
            if self.consumer.bias == 'random_walk' and {*parts} - {'K'}:
                numbers['K'] = Number(level * sqrt(3 / self.coast_s), of_flicker=True)
            elif self.consumer.bias == 'gauss_markov' and parts and axis.gauss_markov is None:
                sigma, time_s = _SIGMA / FLICKER_FLOOR * level, self.coast_s / _PEAK
                numbers |= _of_process(Number(sigma, of_flicker=True),
                                       Number(time_s, of_flicker=True))

    def _agree_on_a_time(self) -> None:
        """Give all axes the correlation time of the gyroscope axis with the largest drift."""
        found = self.worst('gyro', 'Tc') or self.worst('accel', 'Tc')
        for numbers in self.of_axis.values():
            if found is not None and 'sigma' in numbers:
                numbers |= _of_process(numbers['sigma'], found[1])

    def _numbers(self, name: str) -> dict[Key, Number]:
        found = _tuned(self.tunings[name]) if name in self.tunings else self.coefficients[name]
        k = self.options.inflate.get('K', 1.0)
        factors = {'N': self.options.inflate.get('N', 1.0), 'K': k, 'sigma': k, 'Tc': 1.0}
        return {key: replace(number, value=number.value * factors[key])
                for key, number in found.items()}


def _tuned(tuning: FilterTuning) -> dict[Key, Number]:
    found: dict[Key, Number] = {'N': Number(tuning.noise_density)}
    if tuning.random_walk is not None:
        found['K'] = Number(tuning.random_walk)
    elif tuning.sigma is not None and tuning.correlation_time_s is not None:
        found |= _of_process(Number(tuning.sigma), Number(tuning.correlation_time_s))
    return found


def _of_process(sigma: Number, time: Number) -> dict[Key, Number]:
    """Return the parameters of a Gauss-Markov process, with its driving density K."""
    return {'sigma': sigma, 'Tc': time,
            'K': replace(sigma, value=sigma.value * sqrt(2 / time.value), interval=None)}


def _measured(axis: AxisResult, bias: Bias, coast_s: float) -> dict[Key, Number]:
    """Return measured coefficients or their bounds; empty for an axis without a noise density."""
    found: dict[Key, Number] = {}
    keys: dict[Key, str] = {'N': 'noise_density', 'K': 'rate_random_walk'}
    for key, name in keys.items():
        coefficient = axis.coefficients[name]
        if value := value_or_bound(axis, name):
            found[key] = Number(value, not coefficient.observable, coefficient.ci95)
    if 'N' not in found:
        return {}
    if bias == 'gauss_markov' and (process := _process(axis, coast_s)) is not None:
        found |= _of_process(*process)
    return found


def _process(axis: AxisResult, coast_s: float) -> tuple[Number, Number] | None:
    """Return sigma and correlation time of the process, or of one that approximates flicker."""
    if (process := axis.gauss_markov) is not None:
        return (Number(process.sigma, interval=process.sigma_ci95),
                Number(process.correlation_time_s, interval=process.correlation_time_ci95))
    flat = axis.coefficients['bias_instability']
    level = value_or_bound(axis, 'bias_instability')
    curve = axis.curve
    if not level:
        return None
    above = [tau for tau, adev in zip(curve.tau_s, curve.adev, strict=True)
             if adev <= 1.1 * max(min(curve.adev), FLICKER_FLOOR * level)]
    # A datasheet has no curve, and the process is as large as the flicker after the unaided time.
    peak = (sqrt(above[0] * above[-1]) if above else curve.tau_s[-1] if curve.tau_s else coast_s)
    ends = None if flat.ci95 is None else (_SIGMA * flat.ci95[0], _SIGMA * flat.ci95[1])
    return (Number(_SIGMA * level, not flat.observable, ends, of_flicker=True),
            Number(peak / _PEAK, of_flicker=True))


def _slow_noise(axis: AxisResult, tau_s: float) -> dict[str, float]:
    """Return the Allan variance of each slow noise of a datasheet, by its symbol."""
    parts = {TERMS[key].symbol: float(allan_variance({key: value}, tau_s))
             for key in SLOW_TERMS if (value := axis.coefficients[key].value)}
    if (process := axis.gauss_markov) is not None:
        parts['sigma'] = float(gauss_markov_avar(
            process.sigma, process.correlation_time_s, tau_s))
    return parts


def result_of_datasheet(datasheet: NoiseModel, path: str, rate_hz: float | None = None) -> Result:
    """Return the coefficients of a datasheet as a result without curves or intervals."""
    axes = {name: _axis(name, datasheet) for name in AXES
            if 'noise_density' in datasheet.axes.get(name, {})}
    if not axes:
        raise ImuAllanError(f'{printable(path)}: a datasheet without noise_density; a filter '
                            'needs one, such as gyro: {noise_density: 0.03 deg/s/sqrt(Hz)}')
    return Result(
        imu_allan_version=__version__,
        source=schema.Source('datasheet', path, None, None, None, None),
        timeline=schema.Timeline(rate_hz, 0, 0.0), axes=axes)


def _axis(name: str, datasheet: NoiseModel) -> AxisResult:
    quantity, values = AXES[name], datasheet.axes[name]
    return AxisResult(
        quantity=quantity.value, unit=quantity.unit, mean=None, band_limit_s=None, tones=(),
        coefficients={key: schema.Coefficient(
            term.symbol, term.unit(quantity), key in values,
            None if key not in values else abs(values[key]), None, None)
            for key, term in TERMS.items()},
        goodness_of_fit=schema.GoodnessOfFit(None, None, True),
        curve=schema.Curve((), (), (), (), (), ()), gauss_markov=datasheet.gauss_markov.get(name))
