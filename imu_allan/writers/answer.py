# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The answer: what somebody who configures a filter wants to know of a sensor, before anything else.

The worst axis counts. What recording on would bring is said here, too. Report, terminal and demo
say first what is made here, so that they say the same.
"""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from math import pi

from imu_allan import wording
from imu_allan.characterization.mean import error_of_mean
from imu_allan.errors import ImuAllanError
from imu_allan.noise.chi_square import NORMAL95
from imu_allan.result import AxisResult, Coefficient, Interval, Result
from imu_allan.sensor.units import convert
from imu_allan.tuning.forecast import predicted_drift
from imu_allan.tuning.tune import FilterTuning, tune

AIDING_S = 0.1
"""A camera or a wheel of 10 Hz corrects the filter."""
COAST_S = 60.0
"""As where nobody says anything to an exporter: an outage in a tunnel."""
CALIBRATION_S = 60.0
"""What a robot is left standing for before a run."""
_VAGUE = 10.0
"""Where a bound of a forecast is further off than by this factor, it says nothing."""
UNCERTAIN = f'not known to a factor of {_VAGUE:g}'
"""What is said instead of such an interval."""

STEADY, UNSTEADY, WARMING = 'steady', 'not steady', 'still warming up'
MISFIT, UNKNOWN, CONSTANT = 'does not fit', 'cannot tell', 'constant'
FITS = 'fits'
"""Where the record is too short to be cut into parts: all that is known is that the model fits."""
GOOD = (STEADY, FITS)
TOO_SHORT = 'too short'
SHORTEST_GOOD_S = 60.0
"""Of less rest nothing is called good: N is known to some percent, and nothing slower shows."""


@dataclass(frozen=True)
class Figure:
    """
    One coefficient of the worst axis.

    Attributes
    ----------
    axis : str
    word : str
        One of the words above.
    coefficient : Coefficient

    """

    axis: str
    word: str
    coefficient: Coefficient


@dataclass(frozen=True)
class Tuned:
    """
    The numbers for a filter of one bias state, SI, of the axis where each is largest.

    Attributes
    ----------
    noise_density, random_walk : str
    units : (str, str)
    tunings : mapping of axis name to FilterTuning

    """

    noise_density: str
    random_walk: str
    units: tuple[str, str]
    tunings: Mapping[str, FilterTuning]


@dataclass(frozen=True)
class Answer:
    """
    What is said of one sensor.

    Attributes
    ----------
    sensor, title : str
    word : str
        The worst that is to be said of its noise and its drift; where some axes do not measure,
        which and why: ``z constant``.
    noise, drift : Figure or None
        N and K of the worst axis.
    tuned : Tuned or None
        For a filter that is corrected every `AIDING_S` and alone for `COAST_S` at most.
    forecast : str
        How far off it is after `COAST_S` unaided, its bias averaged over
        `CALIBRATION_S` before; a standard deviation, empty where the data cannot tell.
    forecast_interval : str
        Of an accelerometer that of the position; empty where `UNCERTAIN` is all that is known.
    extrapolated : bool
        Whether `COAST_S` is beyond what the recording knows: the model goes further than it saw.

    """

    sensor: str
    title: str
    word: str
    noise: Figure | None
    drift: Figure | None
    tuned: Tuned | None
    forecast: str
    forecast_interval: str = ''
    extrapolated: bool = False


def answers(result: Result) -> list[Answer]:
    """
    Return the answer for each sensor of a result.

    Parameters
    ----------
    result : Result
        Of one recording.

    """
    found, rest_s = [], result.timeline.rest_s
    for sensor, title in wording.SENSORS.items():
        axes = {name: axis for name, axis in result.axes.items() if name.startswith(sensor)}
        if axes:
            noise, drift = (_figure(axes, key, rest_s)
                            for key in ('noise_density', 'rate_random_walk'))
            word = _overall(axes, noise)
            if rest_s < SHORTEST_GOOD_S and word in GOOD:
                word = f'{TOO_SHORT}, {wording.duration(rest_s)} at rest'
            found.append(Answer(sensor, title, word, noise, drift,
                                _tuned(axes), *_forecast(sensor, axes), any(
                                    axis.drift_model.to_s * (1 + 1e-6) < COAST_S
                                    for axis in axes.values()
                                    if axis.drift_model is not None and not axis.constant)))
    return found


def word_of(axis: AxisResult) -> str:
    """
    Say in a word how far the noise density of an axis is to be trusted.

    Parameters
    ----------
    axis : AxisResult
        What was found of it.

    """
    if axis.constant:
        return CONSTANT
    if not axis.coefficients['noise_density'].observable:
        return UNKNOWN
    if not axis.goodness_of_fit.acceptable:
        return MISFIT
    if axis.trend is not None and axis.trend.warm_up is not None:
        return WARMING
    if axis.stationarity is None:
        return FITS
    return STEADY if axis.stationarity.steady else UNSTEADY


def _overall(axes: Mapping[str, AxisResult], noise: Figure | None) -> str:
    words = {word_of(axis) for axis in axes.values()}
    faults = [axis.fault for axis in axes.values()]
    if any(faults) and words != {CONSTANT}:
        return ', '.join(
            wording.listed([name[-1] for name, axis in axes.items() if axis.fault == fault])
            + f' {fault}'
            for fault in dict.fromkeys(faults) if fault is not None)
    if words == {CONSTANT} or noise is None:
        return CONSTANT if words == {CONSTANT} else UNKNOWN
    return next(word for word in (UNKNOWN, MISFIT, WARMING, UNSTEADY, FITS, STEADY)
                if word in words)


def worst_of(axes: Mapping[str, AxisResult], key: str) -> str | None:
    """Return the axis with the largest value, or where none shows one the largest bound."""
    seen = {name: axis.coefficients[key] for name, axis in axes.items()}
    values = {name: c.value for name, c in seen.items() if c.value is not None}
    if not values:
        values = {name: c.upper95 for name, c in seen.items() if c.upper95 is not None}
    return max(values, key=values.__getitem__, default=None)


def _figure(axes: Mapping[str, AxisResult], key: str, rest_s: float) -> Figure | None:
    worst = worst_of(axes, key)
    if worst is None:
        return None
    found = axes[worst].coefficients[key]
    word = word_of(axes[worst]) if found.observable else UNKNOWN
    if rest_s < SHORTEST_GOOD_S and word in GOOD:
        word = TOO_SHORT
    return Figure(worst[-1], word, found)


def _tuned(axes: Mapping[str, AxisResult]) -> Tuned | None:
    tunings = {}
    for name, axis in axes.items():
        if axis.drift_model is not None and not axis.constant:
            # The reasons are those for which it cannot be tuned at all: nothing to show.
            with suppress(ImuAllanError):
                tunings[name] = tune(axis, AIDING_S, COAST_S)
    if not tunings:
        return None
    axis = next(iter(axes.values()))
    units = (axis.coefficients['noise_density'].unit, axis.coefficients['rate_random_walk'].unit)
    return Tuned(f'{max(t.noise_density for t in tunings.values()):#.3g}',
                 f'{max(t.random_walk or 0.0 for t in tunings.values()):#.3g}', units, tunings)


def _forecast(sensor: str, axes: Mapping[str, AxisResult]) -> tuple[str, str]:
    """Write what integrating the worst axis comes to, and between what that lies."""
    found = []
    for axis in axes.values():
        if axis.drift_model is not None and not axis.constant:
            with suppress(ImuAllanError):
                found.append(predicted_drift(axis, (COAST_S,), CALIBRATION_S))
    if not found:
        return '', ''
    angle = max(found, key=lambda drift: drift.integral[0])
    if sensor == 'gyro':
        degrees = (('deg', 180 / pi),)
        return _with_unit(angle.integral[0], angle.integral_ci95[0], degrees)
    place = max(found, key=lambda drift: drift.position or (0.0,))
    if place.position is None or place.position_ci95 is None:
        return '', ''
    speed, _ = _with_unit(angle.integral[0], angle.integral_ci95[0],
                          (('m/s', 1.0), ('cm/s', 100.0), ('mm/s', 1000.0)))
    text, interval = _with_unit(place.position[0], place.position_ci95[0],
                                (('km', 1e-3), ('m', 1.0), ('cm', 100.0), ('mm', 1000.0)))
    return f'{text} ({speed})', interval


def _with_unit(value: float, interval: Interval, units: tuple[tuple[str, float], ...]
               ) -> tuple[str, str]:
    """Write a standard deviation in the largest unit in which it is one at least, two digits."""
    unit, factor = next((pair for pair in units if float(wording.number(value * pair[1], 2)) >= 1),
                        units[-1])
    text, low, high = (wording.rounded(factor * v, 2) for v in (value, *interval))
    known = interval[1] <= _VAGUE**2 * interval[0]
    return f'{text} {unit}', f'{low} .. {high} {unit}' if known else ''


def outlook_of(result: Result) -> str:
    """Say what a longer recording would bring, by the Fisher information of the fitted model."""
    halves = [c.ci_halves_in_s for axis in result.axes.values()
              for c in axis.coefficients.values() if c.ci_halves_in_s]
    waiting: dict[str, list[tuple[float, str]]] = {}
    for name, axis in result.axes.items():
        for coefficient in axis.coefficients.values():
            if coefficient.observable_in_s:
                waiting.setdefault(coefficient.symbol, []).append(
                    (coefficient.observable_in_s, name))
    parts = []
    if halves:
        parts.append(f'all intervals half as wide after another {wording.about(max(halves))}')
    if waiting:
        first = {symbol: min(times) for symbol, times in waiting.items()}
        parts.append(wording.listed([
            f'{symbol} of {wording.named([name])} after {wording.about(wait)}'
            for symbol, (wait, name) in first.items()]) + ' at the earliest')
    return f'Recording on: {"; ".join(parts)}.' if parts else ''


def written_mean(axis: AxisResult, mean: float, duration_s: float, unit: str
                 ) -> tuple[str, str, str]:
    """
    Return a mean and its 95 % interval, which the fitted terms give it, as text.

    Parameters
    ----------
    axis : AxisResult
        Whose mean; one that shows no term has no interval, and four digits.
    mean : float
        Over all of the record or a part of it, in the unit of a sample.
    duration_s : float
        Of the record or the part.
    unit : str
        To write it in.

    Returns
    -------
    value, low, high : str

    """
    half = NORMAL95 * error_of_mean(axis, duration_s)
    return wording.measured(*(convert(value, axis.unit, unit)
                              for value in (mean, mean - half, mean + half)))
