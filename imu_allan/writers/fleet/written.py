# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Output of a fleet: table for the terminal, JSON, CSV, and an HTML page without script."""

import csv
from dataclasses import asdict
import io
import json
import os
from pathlib import Path
import re
from typing import Any, TYPE_CHECKING
from urllib.parse import quote

from imu_allan.errors import printable
from imu_allan.finding_messages import for_display
from imu_allan.fleet.population import (
    FEWEST_UNITS,
    MEAN,
    TOLERANCE_CONFIDENCE,
    TOLERANCE_SHARE,
    Trait,
)
from imu_allan.noise.terms import AXES, TERMS
from imu_allan.result import Result
from imu_allan.sensor.units import engineering, typeset
from imu_allan.version import __version__
from imu_allan.wording import bounded, counted, duration, rounded, SENSORS, spoken
from imu_allan.writers.atomic import write_files
from imu_allan.writers.curves import axes_of
from imu_allan.writers.figure_style import DARK
from imu_allan.writers.fleet.figure import curves_figure
from imu_allan.writers.fleet.outlier_sentences import Fleet, quantity_name
from imu_allan.writers.key_figures import worst_of
from imu_allan.writers.pages import rendered, text_of
from imu_allan.writers.plot import render
from imu_allan.writers.terminal import bare_table, wrapped
from imu_allan.writers.verdict_lines import findings_line

if TYPE_CHECKING:
    from rich.console import RenderableType


def population_table(fleet: Fleet, width: int = 80) -> 'RenderableType':
    """Return a fleet for a terminal; outliers come last, next to the prompt."""
    from rich.console import Group

    parts: list[RenderableType] = []
    if fleet.population.traits:
        table = bare_table('axis', 'term', 'unit', 'centre', '5 .. 95 %', 'spread', 'error',
                           '95/95', 'shown by', texts=3)
        for trait in fleet.population.traits:
            table.add_row(*cells(trait))
        parts += [table, *wrapped([
            'Centre, and where nine in ten units lie (5 .. 95 %): of a fit to all units except '
            'outliers. With fewer than five units, no number makes one an outlier. Spread: '
            'between units, measurement error apart, or its 95 % upper limit where none shows. '
            '95/95: 95 % of all such units keep it, with 95 % confidence, where enough units are '
            'known'],
            width, 'dim')]
    if fleet.unseen:
        parts += wrapped([f'{fleet.unseen}.'], width, 'dim')
    parts += wrapped([', '.join(_counts(fleet))], width, 'bold')
    for unit in fleet.population.outlier_units:
        parts += wrapped([f'{printable(unit)}: {"; ".join(fleet.grouped_reasons(unit))}'],
                         width, 'yellow')
    for failure in fleet.failures:
        parts += wrapped([f'{printable(failure.unit)}: {printable(failure.reason)}'], width, 'red')
    return Group(*parts)


def _counts(fleet: Fleet) -> list[str]:
    """Return the numbers of units, outliers and failed recordings as text."""
    odd = len(fleet.population.outlier_units)
    few = not fleet.population.traits and not odd and fleet.population.one_model
    return [counted(len(fleet.results), 'unit'),
            f'too few to compare (fewer than {FEWEST_UNITS})'
            if few and len(fleet.results) < FEWEST_UNITS else
            counted(odd, 'outlier') if odd else 'no outlier' if fleet.population.one_model else
            'not compared: topics may be of different models',
            *([f'{len(fleet.failures)} not counted'] if fleet.failures else [])]


def cells(trait: Trait) -> tuple[str, ...]:
    """Return a trait as a row of the table, in datasheet units."""
    def shown(value: float) -> str:
        return rounded(engineering(value, trait.unit)[0])

    symbol = 'mean' if trait.key == MEAN else TERMS[trait.key].symbol
    return (spoken(trait.axis), symbol, engineering(1.0, trait.unit)[1], shown(trait.median),
            ' .. '.join(dict.fromkeys(shown(trait.percentiles[percent]) for percent in (5, 95))),
            shown(trait.between) if trait.between else
            bounded(engineering(trait.between_ci95[1], trait.unit)[0]),
            shown(trait.measurement),
            '' if trait.tolerance is None else shown(trait.tolerance),
            f'{trait.observable} of {trait.units}')


def fleet_html(fleet: Fleet, title: str = 'Fleet') -> str:
    """Return the HTML page of a fleet, which loads nothing: pictures are embedded."""
    from markupsafe import Markup

    population = fleet.population
    return rendered(
        'fleet.html', version=__version__, title=printable(title),
        style=Markup(f'{text_of("report.css")}{_both_colours()}'),
        facts=_facts(fleet),
        fleet=fleet, link=_link, worst=_worst, findings=findings_line,
        picture=Markup(_svg(curves_figure(fleet))) if fleet.results else '',
        traits=[{'name': quantity_name(trait.axis, trait.key), 'cells': _typeset(cells(trait))}
                for trait in population.traits],
        # For each, the worst axis of a unit is shown.
        columns=[(sensor, key) for sensor in SENSORS
                 for key in ('noise_density', 'bias_instability')])


def _facts(fleet: Fleet) -> list[str]:
    lengths = [result.timeline.duration_s for result in fleet.results.values()]
    facts = _counts(fleet)
    if lengths:
        shortest, longest = duration(min(lengths)), duration(max(lengths))
        facts.insert(1, shortest if shortest == longest else f'{shortest} to {longest} each')
    return facts


def _svg(figure: Any) -> str:
    """Return a figure as an SVG element in the colours of the page."""
    text = render(figure, 'svg').decode()
    text = text[text.index('<svg'):]
    for colour in DARK:
        text = text.replace(colour, f'var(--c{colour[1:]})')
    return re.sub(r'<metadata>.*?</metadata>', '', text, flags=re.DOTALL)


def _both_colours() -> str:
    """Return the style sheet that gives pictures dark colours in a dark page."""
    light, dark = (' '.join(f'--c{colour[1:]}: {shown};' for colour, shown in pairs)
                   for pairs in (zip(DARK, DARK, strict=True), DARK.items()))
    return (f':root {{ {light} }}\n'
            f'@media screen and (prefers-color-scheme: dark) {{ :root {{ {dark} }} }}')


def _typeset(row: tuple[str, ...]) -> tuple[str, ...]:
    return (*row[:2], typeset(row[2]), *(cell.replace(' .. ', ' – ') for cell in row[3:]))


def _worst(result: Result, sensor: str, key: str) -> str:
    """Return the largest value of the axes as text or, without values, the largest bound."""
    axes = axes_of(result, sensor)
    worst = worst_of(axes, key)
    if worst is None:
        return ''
    found = axes[worst].coefficients[key]
    reported = rounded if found.value is not None else bounded
    return reported(engineering(found.value or found.upper95 or 0.0, found.unit)[0])


def _link(fleet: Fleet, unit: str) -> str | None:
    folder = fleet.folders.get(unit)
    return None if folder is None else f'{quote(folder)}/report.html'


def save_fleet(fleet: Fleet, folder: str | os.PathLike[str]) -> list[Path]:
    """Write ``fleet.json``, ``fleet.csv`` and ``fleet.html``."""
    return write_files(folder, {
        'fleet.json': lambda: fleet_json(fleet).encode(),
        'fleet.csv': lambda: fleet_csv(fleet).encode(),
        'fleet.html': lambda: fleet_html(fleet).encode()})


def fleet_json(fleet: Fleet) -> str:
    """Return the fleet as JSON text with the schema ``imu_allan.fleet/1``, in SI units."""
    population = fleet.population
    odd = set(population.outlier_units)
    document: dict[str, Any] = {
        'schema': 'imu_allan.fleet/1', 'imu_allan_version': __version__,
        'units': [{
            'name': unit, 'serial': fleet.serial(unit),
            'path': fleet.results[unit].source.path, 'folder': fleet.folders.get(unit),
            'duration_s': fleet.results[unit].timeline.duration_s, 'odd': unit in odd,
            'reasons': fleet.reasons(unit),
            'findings': [found.code for found in for_display(
                fleet.results[unit].warnings)]} for unit in population.units],
        'traits': [{**asdict(trait), 'percentiles': {
            str(percent): value for percent, value in trait.percentiles.items()}}
            for trait in population.traits],
        'tolerance': {'share': TOLERANCE_SHARE, 'confidence': TOLERANCE_CONFIDENCE},
        'failures': [asdict(failure) for failure in fleet.failures]}
    return json.dumps(document, indent=2, allow_nan=False) + '\n'


def fleet_csv(fleet: Fleet) -> str:
    """Return the fleet as CSV text: one row per unit, all coefficients with intervals, in SI."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(['unit', 'serial', 'path', 'verdict', 'reasons', 'duration_s',
                     'sample_rate_hz', *(f'{axis}.{name}' for axis in AXES for name in (
                         'mean', *(f'{key}{part}' for key in TERMS for part in (
                             '', '.low95', '.high95', '.upper95'))))])
    for unit in fleet.population.units:
        result, reasons = fleet.results[unit], fleet.reasons(unit)
        numbers = [result.timeline.duration_s, result.timeline.sample_rate_hz]
        for name in AXES:
            axis = result.axes.get(name)
            if axis is None:
                numbers += [None] * (1 + 4 * len(TERMS))
                continue
            numbers.append(axis.mean)
            for key in TERMS:
                found = axis.coefficients[key]
                numbers += [found.value, *(found.ci95 or (None, None)), found.upper95]
        writer.writerow([_text(unit), _text(fleet.serial(unit) or ''),
                         _text(result.source.path or ''), 'odd' if reasons else 'ok',
                         '; '.join(reasons),
                         *('' if number is None else repr(number) for number in numbers)])
    for failure in fleet.failures:
        writer.writerow([_text(failure.unit), '', _text(failure.path), 'failed',
                         _text(failure.reason)])
    return text.getvalue()


def _text(text: str) -> str:
    # Spreadsheets evaluate such text as formulas, and names may come from untrusted folders.
    return f"'{text}" if text.startswith(('=', '+', '-', '@', '\t', '\r')) else text
