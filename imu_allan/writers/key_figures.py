# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What is said first of a result: a line on each sensor, and key figures for a filter.

They refer to the worst axis, and include what a longer recording would improve. Report, terminal,
the node's log and demo all take them from here, so that they agree.
"""

from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import inf, pi

from imu_allan import wording
from imu_allan.errors import ImuAllanError
from imu_allan.finding import Finding
from imu_allan.finding_messages import for_display, in_full, reasons_of, sensor_verdicts, title_of
from imu_allan.noise.chi_square import NORMAL95
from imu_allan.noise.uncertainty import error_of_mean
from imu_allan.result import AxisResult, Coefficient, Interval, Result
from imu_allan.sensor.units import convert, engineering
from imu_allan.tuning.forecast import known_less_than, predicted_drift, VAGUE
from imu_allan.tuning.tune import FilterTuning, tune
from imu_allan.writers.curves import axes_of, by_sensor, reported, worst_of

AIDING_S = 0.1
"""Interval in seconds between corrections of the filter, by a camera or wheel odometry at 10
Hz."""
COAST_S = 60.0
"""Longest unaided time in seconds, the default of the exporters: an outage in a tunnel."""
CALIBRATION_S = 60.0
"""Seconds for which a robot typically stands still before a run."""
COLUMNS = 80
"""Of the narrowest terminal that has a whole screen."""
VERDICT_TEXT = {'good': 'good', 'with_care': 'use with care', 'not_usable': 'not usable'}
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
    for sensor, axes in by_sensor(result.axes).items():
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


def _for_filter(axes: Mapping[str, AxisResult], tunings: Collection[FilterTuning]
                ) -> tuple[tuple[str, float, str], ...]:
    n, k = (next(iter(axes.values())).coefficients[key]
            for key in ('noise_density', 'rate_random_walk'))
    return () if not tunings else (
        (n.symbol, max(tuning.noise_density for tuning in tunings), n.unit),
        (k.symbol, max(tuning.random_walk or 0.0 for tuning in tunings), k.unit))


def _forecast(sensor: str, axes: Mapping[str, AxisResult], coast_s: float) -> tuple[str, str]:
    """Format angle or position of the worst axis, and its interval, in a unit that gives 1."""
    found: list[tuple[float, Interval]] = []
    for axis in axes.values():
        with suppress(ImuAllanError):
            drift = predicted_drift(axis, (coast_s,), CALIBRATION_S)
            values, intervals = ((drift.integral, drift.integral_ci95) if sensor == 'gyro' else
                                 (drift.position, drift.position_ci95))
            found += zip(values or (), intervals or (), strict=True)
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
    drifts = {figures.sensor: _unaided(figures, result.rest_of(figures.sensor))
              for figures in found if figures.forecast}
    head = f'Unaided drift after {wording.duration(coast_s)}:'
    beside = f'{head} {", ".join(dict.fromkeys(drifts.values()))}'
    # Their units say which is of which sensor, where each has one.
    clear = len({*drifts.values()}) == 1 or not any(
        not figures.forecast_interval and figures.extrapolated for figures in found
        if figures.forecast)
    if drifts and len(beside) <= width and clear:
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
    """Return a mean in the unit of a sample and its 95 % interval, as text."""
    half = NORMAL95 * error_of_mean(axis, duration_s)
    return wording.measured(*(convert(value, axis.unit, unit)
                              for value in (mean, mean - half, mean + half)))


def verdict_lines(result: Result, *, si: bool = False) -> list[str]:
    """
    Return a line with the verdict on each sensor, based on its worst axis.

    Example: ``Gyroscope: N is good (+-0.6 %). B: 34 deg/h (27 to 42). K: not visible in 3 h.``
    """
    lines = []
    for sensor, verdict in sensor_verdicts(result).items():
        if verdict.verdict == 'good':
            numbers = _numbers(axes_of(result.axes, sensor), result.rest_of(sensor), si=si)
            lines.append(f'{wording.SENSORS[sensor]}: {numbers}')
        else:
            said = [f'{wording.SENSORS[sensor]}: {VERDICT_TEXT[verdict.verdict]}: {reason}.'
                    for reason in reasons_of(result, sensor, verdict.because)]
            # Figures where they leave it a line.
            lines.append(next((line for line in said if len(line) <= COLUMNS), said[-1]))
    return lines


def findings_line(result: Result) -> str:
    """Return ``6 findings: low-pass, poor fit, ...``, in the order of all front ends, or ''."""
    found = for_display(result.warnings)
    titles = dict.fromkeys(map(title_of, found))
    return f'{wording.counted(len(found), "finding")}: {", ".join(titles)}' if found else ''


def good_to_know(findings: Sequence[Finding], more: str = 'imu_allan explain NAME') -> str:
    """Return a sentence that counts and names what is not said in full, or ''."""
    titles = dict.fromkeys(map(title_of, findings))
    return f'Good to know ({len(titles)}): {", ".join(titles)} ({more}).' if findings else ''


def closing_lines(result: Result, aiding_s: float, coast_s: float) -> list[str]:
    """
    Return what a running node says at its end, as the first screen of a terminal does.

    The verdicts, numbers for a filter that is corrected every `aiding_s` and unaided for `coast_s`
    at most, what is to be acted upon, and the names of the other findings.
    """
    found = for_display(result.warnings)
    act = [one for one in found if one.severity == 'act']
    return [*verdict_lines(result),
            *filter_lines(result, figures_of(result, aiding_s, coast_s), 200, aiding_s, coast_s),
            *(text for _, text in in_full(act, together=True, live=True)),
            *filter(None, [good_to_know([one for one in found if one.severity != 'act'])])]


def _numbers(axes: Mapping[str, AxisResult], rest_s: float, *, si: bool) -> str:
    """Return the precision of N, and the values of B and K, as text."""
    widths = [(c.ci95[1] - c.ci95[0]) / 2 / c.value for axis in axes.values()
              if (c := axis.coefficients['noise_density']).value and c.ci95 is not None]
    # Of a minute at rest, N is known to a few percent.
    parts = [f'N is {"good" if max(widths) < 0.2 else "known roughly"} '
             f'(+-{100 * max(widths):.2g} %)' if widths else 'N does not show']
    for key in ('bias_instability', 'rate_random_walk'):
        cells = [axis.coefficients[key] for axis in axes.values()]
        shown = [(c.value, c.ci95) for c in cells if c.value is not None and c.ci95 is not None]
        scale, unit = (1.0, cells[0].unit) if si else engineering(1.0, cells[0].unit)
        symbol = cells[0].symbol
        if shown:
            value, ends = max(shown)
            text, low, high = wording.measured(*(scale * number for number in (value, *ends)))
            parts.append(f'{symbol}: {text} {unit} ({low} to {high})')
            continue
        # For all axes; one alone may look promising by chance.
        waits = [c.observable_in_s or inf for c in cells]
        longer = '' if inf in waits else f'; record about {wording.about(rest_s + max(waits))}'
        hidden = f': not visible in {wording.duration(rest_s)}{longer}'
        if parts[-1].endswith(hidden):
            symbol = f'{parts.pop().removesuffix(hidden)} and {symbol}'
        parts.append(symbol + hidden)
    return '. '.join(parts) + '.'
