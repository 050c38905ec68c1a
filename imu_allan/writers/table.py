# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The result on a terminal, in one module because all of it has to fit one screen.

Units are spelled as model and datasheet files spell them, so that a value can be copied from the
screen into such a file. Text that comes from a recording never reaches the terminal as markup or
as a control sequence.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from io import StringIO
from typing import TextIO, TYPE_CHECKING

from imu_allan.errors import printable
from imu_allan.noise.terms import AXES, LASTING_TERMS, TERMS
from imu_allan.result import AxisResult, Coefficient, Result
from imu_allan.sensor.units import engineering, MEAN_UNITS
from imu_allan.wording import (
    amount_of,
    bounded,
    duration,
    faults_of,
    measured,
    names_of,
)
from imu_allan.writers.answer import (
    AIDING_S,
    Answer,
    answers,
    COAST_S,
    CONSTANT,
    GOOD,
    UNCERTAIN,
)
from imu_allan.writers.means import written_mean
from imu_allan.writers.outlook import outlook_of
from imu_allan.writers.terminal import console_of
from imu_allan.writers.verdict import Units, verdict_lines
from imu_allan.writers.words import advice, presented, says, title_of

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.text import Text

_LONGEST_HEAD = 28
"""Longest label with its unit beside it: three intervals have room beside it at 80 columns."""


def print_result(result: Result, console: 'Console | None' = None, *,
                 to: TextIO | None = None, units: Units = 'datasheet', verbose: bool = False
                 ) -> None:
    """
    Print the answer, the coefficients with their intervals, and the remarks.

    Parameters
    ----------
    result : Result
        What to print.
    console : rich.console.Console, optional
        Where to; one for `to` by default.
    to : file, optional
        Standard output by default.
    units : 'datasheet' or 'si', optional
        Of the table; the numbers for a filter are SI in any case.
    verbose : bool, optional
        Remarks in full however many lines they take, and terms that no axis shows.

    """
    if console is None:
        console = console_of(to)
    console.print(result_table(result, console.width, units, verbose=verbose))


def result_text(result: Result, width: int = 80) -> str:
    """
    Return what `print_result` prints, without colours.

    Parameters
    ----------
    result : Result
        What is laid out.
    width : int, optional
        Columns.

    """
    from rich.console import Console

    text = StringIO()
    Console(file=text, width=width, highlight=False, no_color=True).print(
        result_table(result, width, verbose=True))
    return text.getvalue().rstrip('\n')


def result_table(result: Result, width: int = 80, units: Units = 'datasheet', *,
                 verbose: bool = False) -> 'RenderableType':
    """
    Lay the result out for a terminal.

    Parameters
    ----------
    result : Result
        What is laid out.
    width : int, optional
        Columns of the terminal.
    units : 'datasheet' or 'si', optional
        Of the numbers in the rows.
    verbose : bool, optional
        Remarks in full, and terms that no axis shows.

    Returns
    -------
    rich renderable
        For `rich.console.Console.print` or `rich.live.Live`.

    """
    from rich.console import Group
    from rich.text import Text

    parts: list[RenderableType] = [
        *(line for text in verdict_lines(result, units) for line in _filled(text, width, 'bold')),
        Text(), _heading(result)]
    found = answers(result)
    for answer in found:
        axes = {name: result.axes[name] for name in AXES
                if name.startswith(answer.sensor) and name in result.axes}
        rows = list(_rows(axes, units, result.timeline.rest_s, verbose=verbose))
        columns = _column_widths(rows)
        parts += [Text(), *answer_lines(answer, width)]
        parts += _columns(rows, columns) if sum(columns) <= width else _stacked(rows)
    parts += [Text(), *_notes(result, found),
              *_findings(result, width, verbose=verbose)]
    return Group(*parts)


def answer_lines(answer: Answer, width: int = 80) -> 'list[RenderableType]':
    """
    Return the answer for one sensor: its word, the numbers for a filter, the drift.

    Parameters
    ----------
    answer : Answer
        From `imu_allan.writers.answer.answers`.
    width : int, optional
        Columns of the terminal.

    """
    from rich.text import Text

    head = Text(answer.title, style='bold')
    head.append(': ', style='not bold')
    head.append(answer.word, style='green' if answer.word in GOOD else 'yellow')
    lines: list[str] = []
    if answer.tuned is not None:
        tuned = answer.tuned
        pair = [f'filter N {tuned.noise_density} {tuned.units[0]}',
                f'filter K {tuned.random_walk} {tuned.units[1]}']
        beside = '   '.join(pair)
        lines += [beside] if 2 + len(beside) <= width else pair
        if answer.drift is not None and not answer.drift.si_interval:
            lines.append(f'measured K: not visible, {answer.drift.si_value}')
    elif answer.word != CONSTANT and answer.noise is not None:
        lines += [f'worst axis {figure.axis}: {figure.symbol} {figure.si_value} {figure.si_unit}'
                  for figure in (answer.noise, answer.drift) if figure is not None]
    if answer.forecast:
        drift = f'unaided drift after {duration(COAST_S)}:'
        if answer.forecast_interval:
            low, high = answer.forecast_interval.split(' .. ')
            lines.append(f'{drift} {answer.forecast} rms ({low} to {high})')
        elif answer.extrapolated:
            lines.append(f'{drift} not known from this recording')
        else:
            lines.append(f'{drift} {answer.forecast} rms, {UNCERTAIN}')
        if answer.extrapolated and answer.forecast_interval:
            lines.append('beyond what this recording knows')
    return [head, *(Text(f'  {line}') for line in lines)]


def _heading(result: Result) -> 'Text':
    from rich.text import Text

    name, *rest = names_of(result)
    text = Text()
    text.append(name, style='bold')
    if rest:
        text.append(f'  {rest[0]}')
    if result.source.frame_id:
        text.append(f'  frame {printable(result.source.frame_id)}')
    text.append(f'\n{amount_of(result.timeline)}')
    if faults := faults_of(result.timeline):
        text.append('; ' + ', '.join(faults), style='yellow')
    return text


@dataclass(frozen=True)
class _Row:
    """One line of the table: a term or the mean, and what each axis has."""

    label: str
    unit: str
    cells: 'dict[str, Text]'
    dim: bool

    @property
    def head(self) -> str:
        """Label and unit, under one another where the axes have two lines, too."""
        tall = any('\n' in cell.plain for cell in self.cells.values())
        beside = f'{self.label}  {self.unit}'
        return f'{self.label}\n  {self.unit}' if tall or len(beside) > _LONGEST_HEAD else beside


def _rows(axes: Mapping[str, AxisResult], units: Units, recorded: float, *, verbose: bool
          ) -> Iterator[_Row]:
    from rich.text import Text

    quantity = AXES[next(iter(axes))]
    for term in TERMS.values():
        cells = {name: axis.coefficients[term.key] for name, axis in axes.items()}
        if all(c.value is None and c.upper95 is None for c in cells.values()):
            continue
        shown = any(cell.observable for cell in cells.values())
        if not (shown or verbose or term.key in LASTING_TERMS):
            continue
        unit = term.unit(quantity)
        yield _Row(f'{term.symbol} {term.name(quantity)}',
                   unit if units == 'si' else engineering(1.0, unit)[1],
                   {name: _cell(cell, units) for name, cell in cells.items()},
                   not shown)
    if any(axis.mean is not None for axis in axes.values()):
        unit = quantity.unit if units == 'si' else MEAN_UNITS[quantity.unit]
        yield _Row('mean', unit, {
            name: Text('' if axis.mean is None else
                       written_mean(axis, axis.mean, recorded, unit)[0], style='dim')
            for name, axis in axes.items()}, dim=True)


def _column_widths(rows: Sequence[_Row]) -> list[int]:
    """Columns that the head and each axis need beside one another."""
    def longest(texts: Iterable[str]) -> int:
        return max((len(line) for text in texts for line in text.split('\n')), default=0)

    return [longest(row.head for row in rows),
            *(2 + longest(row.cells[name].plain for row in rows)
              for name in (rows[0].cells if rows else ()))]


def _columns(rows: Sequence[_Row], widths: Sequence[int]) -> 'list[Text]':
    """Lay the axes out side by side, value above interval."""
    from rich.text import Text

    lines = []
    if rows:
        lines.append(Text(' ' * widths[0] + ''.join(
            f'{name[-1]:>{width}}'
            for name, width in zip(rows[0].cells, widths[1:], strict=True)), style='bold'))
    for row in rows:
        head = row.head.split('\n')
        cells = [cell.split('\n') for cell in row.cells.values()]
        for place in range(max(len(head), *map(len, cells))):
            line = Text(f'{head[place] if place < len(head) else "":<{widths[0]}}',
                        style='dim' if row.dim or place else '')
            for cell, width in zip(cells, widths[1:], strict=True):
                text = cell[place].copy() if place < len(cell) else Text()
                text.align('right', width)
                line.append_text(text)
            line.rstrip()
            lines.append(line)
    return lines


def _stacked(rows: Sequence[_Row]) -> 'list[Text]':
    """Lay the axes out under one another, for a narrow terminal."""
    from rich.text import Text

    lines = []
    for row in rows:
        lines.append(Text(f'{row.label}  {row.unit}', style='dim' if row.dim else ''))
        for name, cell in row.cells.items():
            line = Text(f'  {name[-1]}  ')
            for place, part in enumerate(cell.split('\n')):
                line.append_text(Text(f'{"  " if place else ""}')).append_text(part)
            lines.append(line)
    return lines


def _cell(coefficient: Coefficient, units: Units) -> 'Text':
    from rich.text import Text

    def shown(value: float) -> float:
        return value if units == 'si' else engineering(value, coefficient.unit)[0]

    if coefficient.value is not None and coefficient.ci95 is not None:
        value, low, high = measured(*map(shown, (coefficient.value, *coefficient.ci95)))
        text = Text(value, style='bold')
        text.append(f'\n{low} .. {high}', style='dim not bold')
        return text
    if coefficient.upper95 is None:
        return Text('-', style='dim')
    return Text(bounded(shown(coefficient.upper95), coefficient.symbol), style='dim')


def _notes(result: Result, found: Sequence[Answer]) -> 'Iterator[Text]':
    from rich.text import Text

    cells = [c for axis in result.axes.values() for c in axis.coefficients.values()]
    words = []
    if any(answer.tuned for answer in found):
        words.append(f'"filter": tuned for corrections every {AIDING_S:g} s and up to '
                     f'{duration(COAST_S)} unaided; else: imu_allan tune.')
    if any(not c.observable and c.upper95 is not None for c in cells):
        words.append('"<": below it with 95 % confidence.')
    if longer := outlook_of(result):
        words.append(longer)
    if words:
        yield Text(' '.join(words), style='dim')


def _findings(result: Result, width: int, *, verbose: bool) -> 'Iterator[Text]':
    """Yield what to act upon in full, and the names of what is good to know."""
    known = []
    for found in presented(result.warnings):
        # The segments of motion stand in the heading.
        if found.code == 'motion' and result.timeline.motion and not verbose:
            continue
        if found.severity == 'know' and not verbose:
            known.append(title_of(found))
            continue
        style = 'yellow' if found.severity == 'act' else 'default'
        said = says(found)
        yield from _filled(
            f'{title_of(found)}: {said}{"" if said.endswith((".", "?")) else "."}', width, style)
        if do := advice(found):
            yield from _filled(f'  -> {do}', width, 'default')
    if known:
        yield from _filled(f'Good to know: {", ".join(dict.fromkeys(known))} '
                           '(imu_allan explain NAME, or --verbose).', width, 'dim')


def _filled(text: str, width: int, style: str) -> 'Iterator[Text]':
    """Yield lines that are whole words, those after the first set in."""
    from textwrap import wrap

    from rich.text import Text

    inside = ' ' * (5 if text.startswith('  ->') else 2)
    for line in wrap(text, width, subsequent_indent=inside, break_on_hyphens=False):
        yield Text(line, style=style)
