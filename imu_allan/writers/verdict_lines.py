# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""One-line verdicts on the sensors, shown first by terminal, report and the node's log."""

from collections.abc import Mapping, Sequence
import math
from typing import Literal

from imu_allan.finding import Finding
from imu_allan.finding_messages import brief, for_display, in_full, title_of, together
from imu_allan.finding_texts import WORDS
from imu_allan.result import AxisResult, Result
from imu_allan.sensor.units import engineering
from imu_allan.sensor_verdicts import concerns, FAULTS, sensor_verdicts, SHORTEST_GOOD_S
from imu_allan.wording import about, counted, duration, listed, measured, SENSORS
from imu_allan.writers.curves import axes_of
from imu_allan.writers.key_figures import figures_of, filter_lines

Units = Literal['datasheet', 'si']
COLUMNS = 80
"""Of the narrowest terminal that has a whole screen."""
VERDICT_TEXT = {'good': 'good', 'with_care': 'use with care', 'not_usable': 'not usable'}


def verdict_lines(result: Result, units: Units = 'datasheet') -> list[str]:
    """
    Return a line with the verdict on each sensor, based on its worst axis.

    Example: ``Gyroscope: N is good (+-0.6 %). B: 34 deg/h (27 to 42). K: not visible in 3 h.``
    """
    lines = []
    for sensor, verdict in sensor_verdicts(result).items():
        if verdict.verdict == 'good':
            numbers = _numbers(axes_of(result, sensor), result.timeline.rest_s, units)
            lines.append(f'{SENSORS[sensor]}: {numbers}')
        else:
            said = [f'{SENSORS[sensor]}: {VERDICT_TEXT[verdict.verdict]}: {reason}.'
                    for reason in _reasons(result, sensor, verdict.because)]
            # Figures where they leave it a line.
            lines.append(next((line for line in said if len(line) <= COLUMNS), said[-1]))
    return lines


def findings_line(result: Result) -> str:
    """Return ``6 findings: low-pass, poor fit, ...``, in the order of all front ends, or ''."""
    found = for_display(result.warnings)
    titles = dict.fromkeys(map(title_of, found))
    return f'{counted(len(found), "finding")}: {", ".join(titles)}' if found else ''


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


def _numbers(axes: Mapping[str, AxisResult], rest_s: float, units: Units) -> str:
    """Return the precision of N, and the values of B and K, as text."""
    widths = [(c.ci95[1] - c.ci95[0]) / 2 / c.value for axis in axes.values()
              if (c := axis.coefficients['noise_density']).value and c.ci95 is not None]
    # Of a minute at rest, N is known to a few percent.
    parts = [f'N is {"good" if max(widths) < 0.2 else "known roughly"} '
             f'(+-{100 * max(widths):.2g} %)' if widths else 'N does not show']
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
        # For all axes; one alone may look promising by chance.
        waits = [c.observable_in_s or math.inf for c in cells]
        longer = '' if math.inf in waits else f'; record about {about(rest_s + max(waits))}'
        hidden = f': not visible in {duration(rest_s)}{longer}'
        if parts[-1].endswith(hidden):
            symbol = f'{parts.pop().removesuffix(hidden)} and {symbol}'
        parts.append(symbol + hidden)
    return '. '.join(parts) + '.'


def _reasons(result: Result, sensor: str, because: tuple[str, ...]) -> tuple[str, ...]:
    """Return the reasons with figures, and by name; the findings themselves are shown below."""
    rest_s = result.timeline.rest_s
    found = [one for one in for_display(result.warnings) if concerns(one, sensor)]
    if (rest_s < SHORTEST_GOOD_S and because[:1] == ('short_recording',)
            and not any('samples' in one.values for one in found if one.code in because)):
        return f'{duration(rest_s)} at rest',
    said: list[tuple[str, str]] = []
    for code in because:
        same = [one for one in found if one.code == code]
        letters = {axis[-1] for one in same for axis in one.axes if axis.startswith(sensor)} | {
            name[-1] for name, axis in axes_of(result, sensor).items()
            if FAULTS.get(axis.fault or '') == code}
        axes = f' ({listed(sorted(letters))})' if letters else ''
        if same:
            said.append((f'{brief(together(same, sensor))}{axes}', f'{title_of(same[0])}{axes}'))
        elif code in WORDS:
            said.append((f'{WORDS[code].title}{axes}',) * 2)
    return tuple(map(', '.join, zip(*said, strict=True))) or ('N does not show',)
