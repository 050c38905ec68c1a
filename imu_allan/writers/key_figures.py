# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The key figures of a sensor for somebody who configures a filter.

They refer to the worst axis, and include what a longer recording would improve. Report, terminal
and demo all take them from here, so that they agree.
"""

from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import pi

from imu_allan import wording
from imu_allan.characterization.accuracy_of_mean import error_of_mean
from imu_allan.errors import ImuAllanError
from imu_allan.noise.chi_square import NORMAL95
from imu_allan.result import AxisResult, Coefficient, Result
from imu_allan.sensor.units import convert
from imu_allan.tuning.forecast import predicted_drift, VAGUE
from imu_allan.tuning.tune import FilterTuning, tune
from imu_allan.tuning.uncertainty import known_less_than
from imu_allan.writers.curves import axes_of, reported, sensors_of

AIDING_S = 0.1
"""Interval in seconds between corrections of the filter, by a camera or wheel odometry at 10
Hz."""
COAST_S = 60.0
"""Longest unaided time in seconds, the default of the exporters: an outage in a tunnel."""
CALIBRATION_S = 60.0
"""Seconds for which a robot typically stands still before a run."""
UNCERTAIN = f'not known to a factor of {VAGUE:g}'
"""Text that replaces such an interval."""


@dataclass(frozen=True)
class KeyFigures:
    """
    The key figures of one sensor.

    Attributes
    ----------
    sensor : {'gyro', 'accel'}
    constant : bool
        Whether every sample of every axis is the same.
    worst : mapping of str to (str, Coefficient)
        For the keys of N and K, the letter of the worst axis and its coefficient. Coefficients
        without even a bound are omitted.
    tunings : mapping of axis name to FilterTuning
        For a filter that is corrected every `aiding_s` and unaided for at most `coast_s`.
    for_filter : tuple of (str, float, str)
        Symbol, number and SI unit of N and K for such a filter with one bias state. Each is the
        largest of all axes; empty if no axis can be tuned.
    forecast : str
        Standard deviation of angle or position after `coast_s` unaided, with the bias averaged
        over `CALIBRATION_S` before. Empty if the data do not determine it.
    forecast_interval : str
        Its 95 % interval; empty if the forecast is `UNCERTAIN`.
    extrapolated : bool
        Whether `coast_s` is longer than the times that the drift model covers.

    """

    sensor: str
    constant: bool
    worst: Mapping[str, tuple[str, Coefficient]]
    tunings: Mapping[str, FilterTuning]
    for_filter: tuple[tuple[str, float, str], ...]
    forecast: str
    forecast_interval: str
    extrapolated: bool


def figures_of(result: Result, aiding_s: float = AIDING_S, coast_s: float = COAST_S
               ) -> list[KeyFigures]:
    """Return the key figures of each sensor in the result of one recording."""
    found = []
    for sensor in sensors_of(result):
        axes = axes_of(result, sensor)
        known = {name: axis for name, axis in axes.items()
                 if axis.drift_model is not None and not axis.constant}
        tunings = {}
        for name, axis in known.items():
            # An axis that cannot be tuned is omitted.
            with suppress(ImuAllanError):
                tunings[name] = tune(axis, aiding_s, coast_s)
        found.append(KeyFigures(
            sensor, all(axis.constant for axis in axes.values()),
            {key: (worst[-1], axes[worst].coefficients[key])
             for key in ('noise_density', 'rate_random_walk')
             if (worst := worst_of(axes, key)) is not None},
            tunings, _for_filter(axes, tunings.values()), *_forecast(sensor, known, coast_s),
            known_less_than(known, coast_s) is not None))
    return found


def worst_of(axes: Mapping[str, AxisResult], key: str) -> str | None:
    """Return the axis with the largest value or, if there are no values, the largest bound."""
    seen = {name: axis.coefficients[key] for name, axis in axes.items()}
    values = {name: c.value for name, c in seen.items() if c.value is not None}
    if not values:
        values = {name: c.upper95 for name, c in seen.items() if c.upper95 is not None}
    return max(values, key=values.__getitem__, default=None)


def _for_filter(axes: Mapping[str, AxisResult], tunings: Collection[FilterTuning]
                ) -> tuple[tuple[str, float, str], ...]:
    n, k = (next(iter(axes.values())).coefficients[key]
            for key in ('noise_density', 'rate_random_walk'))
    return () if not tunings else (
        (n.symbol, max(tuning.noise_density for tuning in tunings), n.unit),
        (k.symbol, max(tuning.random_walk or 0.0 for tuning in tunings), k.unit))


def _forecast(sensor: str, axes: Mapping[str, AxisResult], coast_s: float) -> tuple[str, str]:
    """Format angle or position of the worst axis, and its interval, in a unit that gives 1."""
    found = []
    for axis in axes.values():
        with suppress(ImuAllanError):
            drift = predicted_drift(axis, (coast_s,), CALIBRATION_S)
            if sensor == 'gyro':
                found.append((drift.integral[0], drift.integral_ci95[0]))
            elif drift.position is not None and drift.position_ci95 is not None:
                found.append((drift.position[0], drift.position_ci95[0]))
    if not found:
        return '', ''
    value, interval = max(found)
    units = {'deg': 180 / pi} if sensor == 'gyro' else {
        'km': 1e-3, 'm': 1.0, 'cm': 100.0, 'mm': 1000.0}
    unit = next((unit for unit, factor in units.items()
                 if float(wording.number(value * factor, 2)) >= 1), [*units][-1])
    text, low, high = (wording.rounded(units[unit] * v, 2) for v in (value, *interval))
    known = interval[1] <= VAGUE**2 * interval[0]
    return f'{text} {unit}', f'{low} .. {high} {unit}' if known else ''


def filter_lines(result: Result, found: Sequence[KeyFigures], width: int = 80,
                 aiding_s: float = AIDING_S, coast_s: float = COAST_S, *,
                 measured: bool = True) -> list[str]:
    """Say what to give a filter, in SI, beside it what was `measured`, and the unaided drift."""
    lines = []
    if any(figures.for_filter for figures in found):
        lines.append(f'Tuned for a filter corrected every {aiding_s:g} s, up to '
                     f'{wording.duration(coast_s)} unaided (imu_allan export)')
    for figures in found:
        if figures.for_filter:
            pair = [f'filter {symbol} {number:#.3g} {unit}'
                    for symbol, number, unit in figures.for_filter]
            beside = f'  {figures.sensor:<5}  {"  ".join(pair)}'
            lines += [beside] if len(beside) <= width else [
                f'  {figures.sensor:<5}  {pair[0]}', f'{"":9}{pair[1]}']
        elif not figures.constant and 'noise_density' in figures.worst:
            lines += [f'  {figures.sensor:<5}  worst axis {axis}: '
                      f'{worst.symbol} {reported(worst, si=True)[0]} {worst.unit}'
                      for axis, worst in figures.worst.values()]
    lines += _measured_beside(found) if measured else []
    drifts = {figures.sensor: _unaided(figures, result.timeline.rest_s) for figures in found
              if figures.forecast}
    head = f'Unaided drift after {wording.duration(coast_s)}:'
    beside = f'{head} {", ".join(dict.fromkeys(drifts.values()))}'
    # Their units say which is of which sensor, where each has one.
    unknown = [not figures.forecast_interval and figures.extrapolated for figures in found
               if figures.forecast]
    if drifts and len(beside) <= width and len(set(unknown)) == 1:
        return [*lines, beside]
    for place, (sensor, text) in enumerate(drifts.items()):
        lines.append(f'{"" if place else head:<{len(head)}} {sensor:<5} {text}')
    return lines


def _measured_beside(found: Sequence[KeyFigures]) -> list[str]:
    """Say in SI what was measured as K where a tuned one is given."""
    measured = {figures.sensor: reported(figures.worst['rate_random_walk'][1], si=True)
                for figures in found
                if figures.for_filter and 'rate_random_walk' in figures.worst}
    words = (f'{sensor} {said[0] if len(said) > 1 else f"not visible, {said[0]}"}'
             for sensor, said in measured.items())
    return [f'  measured K: {"; ".join(words)}'] if measured else []


def _unaided(figures: KeyFigures, rest_s: float) -> str:
    if figures.forecast_interval:
        low, _, high, _ = figures.forecast_interval.split()
        beyond = ', extrapolated' if figures.extrapolated else ''
        return f'{figures.forecast} rms ({low} to {high}){beyond}'
    if figures.extrapolated:
        return f'not known from {wording.duration(rest_s)}'
    return f'{figures.forecast} rms, {UNCERTAIN}'


def longer_recording_note(result: Result) -> str:
    """State what a longer recording would bring, by the Fisher information of the fitted model."""
    halves = [c.ci_halves_in_s for axis in result.axes.values()
              for c in axis.coefficients.values() if c.ci_halves_in_s]
    return (f'Recording on: all intervals half as wide after another {wording.about(max(halves))}.'
            if halves else '')


def written_mean(axis: AxisResult, mean: float, duration_s: float, unit: str
                 ) -> tuple[str, str, str]:
    """Return a mean in the unit of a sample and its 95 % interval by the fitted terms, as text."""
    half = NORMAL95 * error_of_mean(axis, duration_s)
    return wording.measured(*(convert(value, axis.unit, unit)
                              for value in (mean, mean - half, mean + half)))
