# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The result as a table on a terminal.

Units are spelled as model and datasheet files spell them, so that a value can be copied from the
screen into such a file. Text that comes from a recording never reaches the terminal as markup or
as a control sequence.
"""

from typing import TYPE_CHECKING

from imu_allan.errors import printable
from imu_allan.noise.terms import AXES, Term, TERMS
from imu_allan.noise.units import convert, engineering
from imu_allan.result import AxisResult, Coefficient, Result

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.table import Table
    from rich.text import Text

_SENSORS = {'gyro': 'Gyroscope', 'accel': 'Accelerometer'}
_PIPE_WIDTH = 110


def print_result(result: Result, console: 'Console | None' = None) -> None:
    """
    Print the coefficients, what was seen of the recording, and the warnings.

    Parameters
    ----------
    result : Result
        What to print.
    console : rich.console.Console, optional
        Where to; standard output by default.

    """
    from rich.console import Console

    if console is None:
        console = Console()
        if not console.is_terminal:
            console.width = _PIPE_WIDTH
    console.print(result_table(result))


def result_table(result: Result) -> 'RenderableType':
    """
    Lay the result out for a terminal.

    Returns
    -------
    rich renderable
        For `rich.console.Console.print` or `rich.live.Live`.

    """
    from rich.console import Group

    parts: list[RenderableType] = [_heading(result)]
    for sensor, title in _SENSORS.items():
        axes = {name: result.axes[name] for name in AXES
                if name.startswith(sensor) and name in result.axes}
        if axes:
            parts.append(_sensor_table(title, axes))
    parts.extend(_notes(result))
    return Group(*parts)


def _heading(result: Result) -> 'Text':
    from rich.text import Text

    source, timeline = result.source, result.timeline
    text = Text()
    text.append(printable(source.path or source.topic or 'samples'), style='bold')
    if source.path and source.topic:
        text.append(f'  {printable(source.topic)}')
    if source.frame_id:
        text.append(f'  frame {printable(source.frame_id)}')
    rate = '' if timeline.sample_rate_hz is None else f' at {timeline.sample_rate_hz:.6g} Hz'
    text.append(f'\n{timeline.samples:,} samples{rate}, {duration(timeline.duration_s)}')
    counts = {'missing': timeline.missing, 'duplicate': timeline.duplicates,
              'out of order': timeline.out_of_order, 'rejected': timeline.rejected}
    faults = [f'{count:,} {name}' for name, count in counts.items() if count]
    for spans, name in ((timeline.gaps, 'gap'), (timeline.motion, 'stretch of motion')):
        if spans:
            total = sum(span.duration_s for span in spans)
            plural = name if len(spans) == 1 else name.replace('gap', 'gaps').replace(
                'stretch', 'stretches')
            faults.append(f'{len(spans):,} {plural} ({duration(total)})')
    if faults:
        text.append('; ' + ', '.join(faults), style='yellow')
    return text


def duration(seconds: float) -> str:
    """`seconds` as a person says it: ``2 h 46 min``, ``93 s``, ``40 ms``."""
    if seconds >= 172_800:
        return f'{seconds / 86_400:.3g} days'
    if seconds >= 7200:
        hours, minutes = divmod(round(seconds / 60), 60)
        return f'{hours} h {minutes} min' if minutes else f'{hours} h'
    if seconds >= 120:
        minutes, rest = divmod(round(seconds), 60)
        return f'{minutes} min {rest} s' if rest else f'{minutes} min'
    return f'{seconds:.3g} s' if seconds >= 1 or seconds == 0 else f'{seconds * 1e3:.3g} ms'


def _sensor_table(title: str, axes: dict[str, AxisResult]) -> 'Table':
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(title=title, title_justify='left', title_style='bold', box=box.SIMPLE_HEAD,
                  padding=0)
    table.add_column('term', overflow='fold')
    table.add_column('unit', style='dim', overflow='fold')
    for name in axes:
        # Folding keeps every digit on a narrow terminal; cropping would lose some.
        table.add_column(name[-1], justify='right', overflow='fold')
    for term in TERMS.values():
        quantity = AXES[next(iter(axes))]
        unit = term.unit(quantity)
        _, shown_unit = engineering(1.0, unit)
        known = any(axis.coefficients[term.key].observable for axis in axes.values())
        label = Text(f'{term.symbol} {term.name(quantity)}', style='' if known else 'dim')
        units = Text(f'{shown_unit}\n95 % interval\n{unit}' if known else shown_unit)
        table.add_row(label, units, *(_cell(axis.coefficients[term.key], term, tall=known)
                                      for axis in axes.values()))
    if any(axis.mean is not None for axis in axes.values()):
        quantity = AXES[next(iter(axes))]
        unit = 'deg/s' if quantity.unit == 'rad/s' else quantity.unit
        table.add_row(Text('mean', style='dim'), Text(unit), *(
            Text('' if axis.mean is None else f'{convert(axis.mean, axis.unit, unit):.4g}',
                 style='dim') for axis in axes.values()))
    return table


def _cell(coefficient: Coefficient, term: Term, *, tall: bool) -> 'Text':
    from rich.text import Text

    unit = coefficient.unit
    if coefficient.observable and coefficient.value is not None and coefficient.ci95 is not None:
        value, _ = engineering(coefficient.value, unit)
        low, high = (engineering(bound, unit)[0] for bound in coefficient.ci95)
        text = Text(number(value), style='bold')
        text.append(f'\n{number(low)} .. {number(high)}', style='dim not bold')
        text.append(f'\n{coefficient.value:.4g}', style='dim not bold')
        return text
    if coefficient.upper95 is None:
        return Text('not observable', style='dim')
    bound = f'< {number(engineering(coefficient.upper95, unit)[0])}'
    sign = '|' if term.key == 'rate_ramp' else ''
    return Text(f'{sign}{term.symbol}{sign} {bound}\nnot observable' if tall
                else f'{sign}{term.symbol}{sign} {bound}', style='dim')


def _longer(result: Result) -> str:
    """Say what a longer recording would bring, by the Fisher information of the fitted model."""
    halves = [c.ci_halves_in_s for axis in result.axes.values()
              for c in axis.coefficients.values() if c.ci_halves_in_s is not None]
    waiting = [f'{c.symbol} of {name} after {duration(c.observable_in_s)}'
               for name, axis in result.axes.items() for c in axis.coefficients.values()
               if c.observable_in_s is not None]
    parts = [f'all intervals half as wide after another {duration(max(halves))}'] if halves else []
    if waiting:
        parts.append('to be expected: ' + ', '.join(waiting))
    return 'Recording on: ' + '; '.join(parts) + '.' if parts else ''


def number(value: float) -> str:
    """Return four significant digits, without an exponent up to a million."""
    return f'{value:.0f}' if 1e4 <= abs(value) < 1e6 else f'{value:.4g}'


def _notes(result: Result) -> 'list[RenderableType]':
    from rich.text import Text

    notes: list[RenderableType] = []
    if any(not c.observable for axis in result.axes.values() for c in axis.coefficients.values()):
        notes.append(Text('"<" stands where this data cannot show the term: it is below this '
                          'bound with 95 % confidence.', style='dim'))
    if longer := _longer(result):
        notes.append(Text(longer, style='dim'))
    windows = [f'{name} {duration(axis.band_limit_s)}' for name, axis in result.axes.items()
               if axis.band_limit_s is not None]
    if windows:
        notes.append(Text('band-limited before sampling, effective window: '
                          + ', '.join(windows)))
    for name, axis in result.axes.items():
        if axis.tones:
            named = ', '.join(f'{tone.frequency_hz:.4g} Hz' for tone in axis.tones[:6])
            more = f' and {len(axis.tones) - 6} more' if len(axis.tones) > 6 else ''
            notes.append(Text(f'{name}: tones left out of the fit at {named}{more}'))
        if axis.gauss_markov is not None:
            sigma, unit = engineering(axis.gauss_markov.sigma, axis.unit)
            notes.append(Text(f'{name}: a Gauss-Markov process of {number(sigma)} {unit} with a '
                              'correlation time of '
                              f'{duration(axis.gauss_markov.correlation_time_s)}'))
        if not axis.goodness_of_fit.acceptable:
            notes.append(Text(f'{name}: no model of the five terms fits this axis well; '
                              'take its coefficients with care', style='yellow'))
    for warning in result.warnings:
        text = Text('warning: ', style='bold yellow')
        text.append(printable(warning.message), style='not bold')
        notes.append(text)
    return notes
