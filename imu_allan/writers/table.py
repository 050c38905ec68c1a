# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The result on a terminal: one screen of 24 lines and 80 columns, or more on request.

Units are spelled as in model and datasheet files, so that values can be copied into them. Text
from a recording never reaches the terminal as markup or control sequences.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from io import StringIO
from itertools import product
from typing import TextIO, TYPE_CHECKING

from imu_allan import wording
from imu_allan.errors import printable
from imu_allan.finding import Finding
from imu_allan.noise.terms import AXES, LASTING_TERMS, TERMS
from imu_allan.result import AxisResult, Coefficient, Result
from imu_allan.sensor.units import engineering, MEAN_UNITS
from imu_allan.writers import answer
from imu_allan.writers.curves import axes_of, reported
from imu_allan.writers.terminal import console_of, wrapped
from imu_allan.writers.verdict import COLUMNS, good_to_know, Units, verdict_lines
from imu_allan.writers.words import for_display, in_full

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.text import Text


def print_result(result: Result, console: 'Console | None' = None, *,
                 to: TextIO | None = None, units: Units = 'datasheet', verbose: bool = False
                 ) -> None:
    """Print verdict, coefficients and findings; with `verbose` perhaps more than one screen."""
    if console is None:
        console = console_of(to)
    console.print(result_table(result, console.width, units, verbose=verbose))


def result_text(result: Result) -> str:
    """Return the verbose output of `print_result` without colours."""
    from rich.console import Console

    text = StringIO()
    Console(file=text, width=COLUMNS, highlight=False, no_color=True).print(
        result_table(result, COLUMNS, verbose=True))
    return text.getvalue().rstrip('\n')


def result_table(result: Result, width: int = 80, units: Units = 'datasheet', *,
                 verbose: bool = False) -> 'RenderableType':
    """Return the result for a terminal: verdict, numbers for a filter, table, findings."""
    from rich.console import Group
    from rich.text import Text

    found = answer.key_figures(result)
    findings = for_display(result.warnings)
    full = [one for one in findings if verbose or one.severity == 'act']
    known = [one for one in findings if one not in full]
    verdicts = list(wrapped(verdict_lines(result, units), width, 'bold'))
    # The measured K also stands in the table, if a line is wanting.
    tuned = [list(wrapped(answer.filter_lines(result, found, width, measured=measured), width))
             for measured in (True, False)]
    heading = _heading(result, width)
    rows = [list(_rows(axes_of(result, figures.sensor), units, result.timeline.rest_s,
                       verbose=verbose)) for figures in found]
    tables = _tables(found, rows, width, tuned=units != 'si', named=verbose)
    notes = list(wrapped(_notes(result), width, 'dim')) if verbose else []
    said = [line for severity, text in in_full(full, together=not verbose)
            for line in wrapped([text], width, 'yellow' if severity == 'act' else 'default')]
    names = _good_to_know(known, width)
    count = list(wrapped([f'Good to know: {wording.counted(len(known), "finding")} (--verbose).']
                         if known else [], width, 'dim'))
    middles = [tables]
    screen = 23   # lines for a result, as the last of 24 says how to save it
    # If head and tables fit on a screen but not with the findings, omit the coefficients.
    if width >= COLUMNS and sum(
            map(len, (verdicts, tuned[-1], heading, *tables, count))) <= screen:
        middles.append([list(wrapped(['Coefficients of each axis: --verbose.'], width, 'dim'))])
    for middle, last, for_filter in product(middles, (names, count), tuned):
        blocks = [block for block in (
            verdicts, for_filter, heading, *middle, notes, [*said, *last]) if block]
        spare = len(blocks) if verbose else screen - sum(map(len, blocks))
        if spare >= 0:
            break
    return Group(*(line for place, block in enumerate(blocks) for line in (
        [Text()] if place > 0 and len(blocks) - place <= spare else []) + block))


def _heading(result: Result, width: int) -> 'list[Text]':
    """Return the lines on what was analyzed: names, amount of data, and faults of its times."""
    frame = [f'frame {printable(result.source.frame_id)}'] if result.source.frame_id else []
    amount = wording.amount_of(result.timeline)
    faults = ', '.join(wording.faults_of(result.timeline))
    names = '  '.join([*wording.names_of(result), *frame])
    amount = '; '.join(filter(None, (amount, faults)))
    style = 'yellow' if faults else 'default'
    apart = [*wrapped([names], width), *wrapped([amount], width, style)]
    return min((apart, list(wrapped([f'{names}  {amount}'], min(width, COLUMNS), style))),
               key=len)


@dataclass(frozen=True)
class _Cell:
    """The cell of an axis and a term: the value, and the interval as shown beside it."""

    value: str
    interval: str = ''

    def text(self, *, tall: bool) -> 'Text':
        """Return the cell on one line or, if `tall`, with the interval below the value."""
        from rich.text import Text

        style = 'bold' if self.interval else 'dim'
        beside = (self.interval if tall or '%' in self.interval or not self.interval else
                  f'({self.interval.replace(" .. ", "..")})')
        return Text.assemble((self.value, style), *(
            ['\n' if tall else ' ', (beside, 'dim')] if beside else []))


@dataclass(frozen=True)
class _Row:
    """One row of the table: a term or the mean, with a cell per axis."""

    symbol: str
    name: str
    unit: str
    cells: Mapping[str, _Cell]
    scale: float
    dim: bool


def _rows(axes: Mapping[str, AxisResult], units: Units, recorded: float, *, verbose: bool
          ) -> Iterator[_Row]:
    quantity, empty = AXES[next(iter(axes))], True
    for term in TERMS.values():
        cells = {name: axis.coefficients[term.key] for name, axis in axes.items()}
        if all(c.value is None and c.upper95 is None for c in cells.values()):
            continue
        shown = any(cell.observable for cell in cells.values())
        if not (shown or verbose or term.key in LASTING_TERMS):
            continue
        unit = term.unit(quantity)
        scale, shown_unit = (1.0, unit) if units == 'si' else engineering(1.0, unit)
        empty = False
        yield _Row(term.symbol, term.name(quantity), shown_unit,
                   {name: _cell(cell, si=units == 'si', in_full=verbose)
                    for name, cell in cells.items()},
                   scale, not shown)
    if (verbose or empty) and any(axis.mean is not None for axis in axes.values()):
        unit = quantity.unit if units == 'si' else MEAN_UNITS[quantity.unit]
        yield _Row('mean', '', unit, {
            name: _Cell('' if axis.mean is None else
                        answer.written_mean(axis, axis.mean, recorded, unit)[0])
            for name, axis in axes.items()}, 1.0, dim=True)


def _cell(coefficient: Coefficient, *, si: bool, in_full: bool) -> _Cell:
    value, *ends = reported(coefficient, si=si) or ('-',)
    if not ends or coefficient.ci95 is None:
        return _Cell(value)
    half = (coefficient.ci95[1] - coefficient.ci95[0]) / 2 / abs(coefficient.value or 1.0)
    # An interval of up to a tenth of the value is given as a percentage.
    return _Cell(value, ' .. '.join(ends) if in_full or half > 0.1 else f'+-{100 * half:.2g} %')


def _tables(found: Sequence[answer.KeyFigures], rows: Sequence[Sequence[_Row]], width: int, *,
            tuned: bool, named: bool) -> 'list[list[Text]]':
    """Arrange the axes side by side in the widest layout that fits, or else the last."""
    for layout in (_Layout(named=True, tuned=tuned), _Layout(tuned=tuned), _Layout(),
                   _Layout(named=True, tall=True)):
        if named and not layout.named:
            continue
        tables = [_columns(figures, own, layout) if own else []
                  for figures, own in zip(found, rows, strict=True)]
        if all(len(line) <= width for table in tables for line in table):
            break
    return tables


@dataclass(frozen=True)
class _Layout:
    """Whether there are term names, a filter column, and intervals on separate lines."""

    named: bool = False
    tuned: bool = False
    tall: bool = False

    def head(self, row: _Row) -> str:
        """Return the label of a term."""
        if not self.named or not row.name:
            return f'{row.symbol} {row.unit}'
        return f'{row.symbol} {row.name}' + ('\n  ' if self.tall else '  ') + row.unit


def _columns(figures: answer.KeyFigures, rows: Sequence[_Row], layout: _Layout) -> 'list[Text]':
    from rich.text import Text

    columns = [[Text(figures.title, 'bold'), *(Text(layout.head(row), 'dim' if row.dim else '')
                                               for row in rows)]]
    columns += [[Text(name[-1], 'bold'),
                 *(row.cells[name].text(tall=layout.tall) for row in rows)]
                for name in rows[0].cells]
    if layout.tuned and figures.tunings:
        tunings = figures.tunings.values()
        filters = {'N': max(tuning.noise_density for tuning in tunings),
                   'K': max(tuning.random_walk or 0.0 for tuning in tunings)}
        columns.append([Text('filter', 'bold'), *(
            Text(wording.number(float(f'{row.scale * filters[row.symbol]:.3g}'))
                 if row.symbol in filters else '') for row in rows)])
    lines = [Text() for _ in range(sum(_height(cells) for cells in zip(*columns, strict=True)))]
    for place, column in enumerate(columns):
        parts = [part for cell, height in zip(
            column, map(_height, zip(*columns, strict=True)), strict=True)
            for part in [*cell.split('\n'), *[Text()] * height][:height]]
        across = max(map(len, parts)) + (2 if place else 0)
        for line, part in zip(lines, parts, strict=True):
            cut = part.copy()
            cut.align('right' if place else 'left', across)
            line.append_text(cut)
    for line in lines:
        line.rstrip()
    return lines


def _height(cells: 'Iterable[Text]') -> int:
    return max(cell.plain.count('\n') + 1 for cell in cells)


def _notes(result: Result) -> list[str]:
    cells = [c for axis in result.axes.values() for c in axis.coefficients.values()]
    words = []
    if any(not c.observable and c.upper95 is not None for c in cells):
        words.append('"<": below it with 95 % confidence.')
    if longer := answer.longer_recording_note(result):
        words.append(longer)
    return [' '.join(words)]


def _good_to_know(found: Sequence[Finding], width: int) -> 'list[Text]':
    """Return lines that count and name the findings not shown in full."""
    said = [list(wrapped(filter(None, [good_to_know(found, more)]), width, 'dim'))
            for more in ('imu_allan explain NAME, or --verbose', 'imu_allan explain NAME')]
    return min(said, key=len)
