# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The result on a terminal: one screen of 24 lines and 80 columns, or more on request.

Units are spelled as in model and datasheet files, so that values can be copied into them. Text
from a recording never reaches the terminal as markup or control sequences.
"""

from collections.abc import Sequence
from io import StringIO
from itertools import product, zip_longest

from imu_allan import wording
from imu_allan.errors import printable
from imu_allan.finding_messages import for_display, in_full
from imu_allan.noise.terms import AXES, LASTING_TERMS, TERMS
from imu_allan.result import Coefficient, Result
from imu_allan.sensor.units import engineering, MEAN_UNITS
from imu_allan.writers import key_figures
from imu_allan.writers.curves import axes_of, reported
from imu_allan.writers.key_figures import COLUMNS, good_to_know, verdict_lines
from imu_allan.writers.terminal import wrapped
from rich.console import Console, Group, RenderableType
from rich.text import Text


def result_text(result: Result) -> str:
    """Return the verbose result for 80 columns, without colours."""
    text = StringIO()
    Console(file=text, width=COLUMNS, highlight=False, no_color=True).print(
        result_table(result, COLUMNS, verbose=True))
    return text.getvalue().rstrip('\n')


def result_table(result: Result, width: int = 80, *, si: bool = False,
                 verbose: bool = False) -> RenderableType:
    """Return the result for a terminal: verdict, numbers for a filter, table, findings."""
    found = key_figures.figures_of(result)
    findings = for_display(result.warnings)
    full = [one for one in findings if verbose or one.severity == 'act']
    known = [one for one in findings if one not in full]
    verdicts = wrapped(verdict_lines(result, si=si), width, 'bold')
    # The measured K also stands in the table, if a line is wanting.
    tuned = [wrapped(key_figures.filter_lines(result, found, width, measured=measured), width)
             for measured in (True, False)]
    heading = _heading(result, width)
    tables = _tables(result, found, width, si=si, verbose=verbose)
    notes = wrapped([_note(result)], width, 'dim') if verbose else []
    said = [line for severity, text in in_full(full, together=not verbose)
            for line in wrapped([text], width, 'yellow' if severity == 'act' else 'default')]
    names = min((wrapped([good_to_know(known, more)], width, 'dim')
                 for more in ('imu_allan explain NAME, or --verbose', 'imu_allan explain NAME')),
                key=len)
    count = wrapped([f'Good to know: {wording.counted(len(known), "finding")} (--verbose).']
                    if known else [], width, 'dim')
    middles = [tables]
    screen = 23   # lines for a result, as the last of 24 says how to save it
    # If head and tables fit on a screen but not with the findings, omit the coefficients.
    if width >= COLUMNS and sum(
            map(len, (verdicts, tuned[-1], heading, *tables, count))) <= screen:
        middles.append([wrapped(['Coefficients of each axis: --verbose.'], width, 'dim')])
    for middle, last, for_filter in product(middles, (names, count), tuned):
        blocks = [block for block in (
            verdicts, for_filter, heading, *middle, notes, [*said, *last]) if block]
        spare = len(blocks) if verbose else screen - sum(map(len, blocks))
        if spare >= 0:
            break
    return Group(*(line for place, block in enumerate(blocks) for line in (
        [Text()] if place > 0 and len(blocks) - place <= spare else []) + block))


def _heading(result: Result, width: int) -> list[Text]:
    """Return the lines on what was analyzed: names, amount of data, and faults of its times."""
    frame = [f'frame {printable(result.source.frame_id)}'] if result.source.frame_id else []
    names = '  '.join([*wording.names_of(result), *frame])
    faults = ', '.join(wording.faults_of(result.timeline))
    amount = '; '.join(filter(None, (wording.amount_of(result.timeline), faults)))
    style = 'yellow' if faults else 'default'
    apart = wrapped([names], width) + wrapped([amount], width, style)
    return min(apart, wrapped([f'{names}  {amount}'], min(width, COLUMNS), style), key=len)


def _tables(result: Result, found: Sequence[key_figures.KeyFigures], width: int, *, si: bool,
            verbose: bool) -> list[list[Text]]:
    """Arrange the axes side by side in the widest layout that fits, or else the last."""
    # Whether with term names, a filter column, and intervals on separate lines.
    for named, tuned, tall in ((True, True, False), (False, True, False), (False, False, False),
                               (True, False, True)):
        if verbose and not named:
            continue
        tables = [_lines(_cells(result, figures, si=si, verbose=verbose, named=named, tall=tall,
                                tuned=tuned and not si)) for figures in found]
        if all(len(line) <= width for table in tables for line in table):
            break
    return tables


def _cells(result: Result, figures: key_figures.KeyFigures, *, si: bool, verbose: bool,
           named: bool, tuned: bool, tall: bool) -> list[list[Text]]:
    """Return the table of a sensor: a row per term, with its name and a cell per axis."""
    axes = axes_of(result.axes, figures.sensor)
    quantity, rows = AXES[next(iter(axes))], []
    filters = {symbol: value for symbol, value, _ in figures.for_filter if tuned}
    for term in TERMS.values():
        cells = [axis.coefficients[term.key] for axis in axes.values()]
        seen = any(cell.observable for cell in cells)
        if (all(cell.value is None and cell.upper95 is None for cell in cells)
                or not (seen or verbose or term.key in LASTING_TERMS)):
            continue
        unit = term.unit(quantity)
        scale, shown = (1.0, unit) if si else engineering(1.0, unit)
        name = f' {term.name(quantity)}' + ('\n  ' if tall else '  ') if named else ' '
        rows.append([Text(f'{term.symbol}{name}{shown}', '' if seen else 'dim'),
                     *(_cell(cell, si=si, in_full=verbose, tall=tall) for cell in cells),
                     Text(wording.number(float(f'{scale * filters[term.symbol]:.3g}'))
                          if term.symbol in filters else '')])
    if (verbose or not rows) and any(axis.mean is not None for axis in axes.values()):
        unit = quantity.unit if si else MEAN_UNITS[quantity.unit]
        rows.append([Text(f'mean {unit}', 'dim'), *(
            Text.assemble(('' if axis.mean is None else key_figures.written_mean(
                axis, axis.mean, result.rest_of(figures.sensor), unit)[0], 'dim'))
            for axis in axes.values()), Text()])
    heading = [wording.SENSORS[figures.sensor], *(name[-1] for name in axes),
               'filter' if filters else '']
    return [[Text(word, 'bold') for word in heading], *rows] if rows else []


def _cell(coefficient: Coefficient, *, si: bool, in_full: bool, tall: bool) -> Text:
    """Return the value of an axis, with the interval beside it or, if `tall`, below it."""
    value, *ends = reported(coefficient, si=si) or ('-',)
    if not ends or coefficient.ci95 is None:
        return Text.assemble((value, 'dim'))
    half = (coefficient.ci95[1] - coefficient.ci95[0]) / 2 / abs(coefficient.value or 1.0)
    # An interval of up to a tenth of the value is given as a percentage.
    interval = (f'+-{100 * half:.2g} %' if half <= 0.1 and not in_full else
                ' .. '.join(ends) if tall else f'({"..".join(ends)})')
    return Text.assemble((value, 'bold'), '\n' if tall else ' ', (interval, 'dim'))


def _lines(cells: Sequence[Sequence[Text]]) -> list[Text]:
    """Return the lines of a table, all columns but the first aligned at the right."""
    widths = [max(len(part) for cell in column for part in cell.split('\n'))
              for column in zip(*cells, strict=True)]
    lines = []
    for row in cells:
        for parts in zip_longest(*(cell.split('\n') for cell in row)):
            line = Text()
            for place, (part, across) in enumerate(zip(parts, widths, strict=True)):
                cell = part or Text()
                cell.align('right' if place else 'left', across + (2 if place and across else 0))
                line.append_text(cell)
            line.rstrip()
            lines.append(line)
    return lines


def _note(result: Result) -> str:
    cells = [c for axis in result.axes.values() for c in axis.coefficients.values()]
    bounded = any(not c.observable and c.upper95 is not None for c in cells)
    return ' '.join(filter(None, ('"<": below it with 95 % confidence.' if bounded else '',
                                  key_figures.longer_recording_note(result))))
