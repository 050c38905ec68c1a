# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""One-line verdicts on the sensors, shown first by terminal, report and the node's log."""

from collections.abc import Mapping
from typing import Literal

from imu_allan.result import AxisResult, Result, SensorVerdict
from imu_allan.sensor.units import engineering
from imu_allan.verdict import concerns, FAULTS, SHORTEST_GOOD_S, verdicts
from imu_allan.wording import about, counted, duration, listed, measured, SENSORS
from imu_allan.writers.curves import axes_of
from imu_allan.writers.sentences import WORDS
from imu_allan.writers.words import presented, title_of

Units = Literal['datasheet', 'si']
SAID = {'good': 'good', 'with_care': 'use with care', 'not_usable': 'not usable'}


def verdicts_of(result: Result) -> dict[str, SensorVerdict]:
    """Return the verdict on each sensor that a result has axes of, stored or newly derived."""
    return {sensor: result.sensors.get(sensor, own) for sensor, own in verdicts(result).items()}


def verdict_lines(result: Result, units: Units = 'datasheet') -> list[str]:
    """
    Return a line with the verdict on each sensor, based on its worst axis.

    Example: ``Gyroscope: N is good (+-0.6 %). B: 34 deg/h (27 to 42). K: not visible in 3 h.``
    """
    lines = []
    for sensor, verdict in verdicts_of(result).items():
        axes = axes_of(result, sensor)
        title = SENSORS.get(sensor, sensor)
        if verdict.verdict == 'good':
            lines.append(f'{title}: {_numbers(axes, result.timeline.rest_s, units)}')
        else:
            lines.append(f'{title}: {SAID[verdict.verdict]}: '
                         f'{_reason(result, sensor, verdict.because)}.')
    return lines


def findings_line(result: Result) -> str:
    """Return ``6 findings: low-pass, poor fit, ...``, in the order of all front ends, or ''."""
    found = presented(result.warnings)
    titles = dict.fromkeys(map(title_of, found))
    return f'{counted(len(found), "finding")}: {", ".join(titles)}' if found else ''


def _numbers(axes: Mapping[str, AxisResult], rest_s: float, units: Units) -> str:
    """Return the precision of N, and the values of B and K, as text."""
    widths = [(c.ci95[1] - c.ci95[0]) / 2 / c.value for axis in axes.values()
              if (c := axis.coefficients['noise_density']).value and c.ci95 is not None]
    parts = [f'N is good (+-{100 * max(widths):.2g} %)' if widths else 'N does not show']
    for key in ('bias_instability', 'rate_random_walk'):
        cells = [axis.coefficients[key] for axis in axes.values()]
        shown = [(c.value, c.ci95) for c in cells if c.value is not None and c.ci95 is not None]
        scale, unit = (1.0, cells[0].unit) if units == 'si' else engineering(1.0, cells[0].unit)
        symbol = cells[0].symbol
        if shown:
            value, ends = max(shown)
            text, low, high = measured(*(scale * number for number in (value, *ends)))
            parts.append(f'{symbol}: {text} {unit} ({low} to {high})')
            continue
        waits = [c.observable_in_s for c in cells if c.observable_in_s]
        longer = f'; record about {about(rest_s + min(waits))}' if waits else ''
        hidden = f': not visible in {duration(rest_s)}{longer}'
        if parts[-1].endswith(hidden):
            symbol = f'{parts.pop().removesuffix(hidden)} and {symbol}'
        parts.append(symbol + hidden)
    return '. '.join(parts) + '.'


def _reason(result: Result, sensor: str, because: tuple[str, ...]) -> str:
    """Return the reason in a few words; the findings themselves are shown below."""
    rest_s = result.timeline.rest_s
    if rest_s < SHORTEST_GOOD_S and because[:1] == ('short_recording',):
        return f'{duration(rest_s)} at rest'
    reasons: dict[str, set[str]] = {WORDS[code].title: set() for code in because if code in WORDS}
    for one in presented(result.warnings):
        if one.code in because and concerns(one, sensor):
            reasons.setdefault(title_of(one), set()).update(
                axis[-1] for axis in one.axes if axis.startswith(sensor))
    for name, axis in axes_of(result, sensor).items():
        if axis.fault is not None and FAULTS[axis.fault] in because:
            reasons[WORDS[FAULTS[axis.fault]].title].add(name[-1])
    return ', '.join(f'{title} ({listed(sorted(axes))})' if axes else title
                     for title, axes in reasons.items()) or 'N does not show'
