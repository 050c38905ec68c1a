# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
A fleet as its outputs show it: for each outlier the reason, a table, JSON, CSV and an HTML page.

The figure of the page is in `plot`.
"""

from collections.abc import Mapping
import csv
from dataclasses import asdict, dataclass
from functools import cached_property
import io
import json
import os
from pathlib import Path
import re
from typing import Any

from imu_allan import wording
from imu_allan.errors import printable
from imu_allan.finding_messages import for_display
from imu_allan.fleet import (
    FEWEST_UNITS,
    MEAN,
    Outlier,
    Population,
    population,
    TOLERANCE_CONFIDENCE,
    TOLERANCE_SHARE,
    Trait,
)
from imu_allan.noise.terms import AXES, TERMS
from imu_allan.result import Inspection, Result
from imu_allan.sensor.units import engineering, typeset
from imu_allan.version import __version__
from imu_allan.wording import counted, listed, named, number, ranged, rounded
from imu_allan.writers.atomic import write_files
from imu_allan.writers.curves import axes_of, reported, worst_of
from imu_allan.writers.key_figures import findings_line
from imu_allan.writers.pages import rendered
from imu_allan.writers.panels import COLOURS, SERIES
from imu_allan.writers.plot import curves_figure, render
from imu_allan.writers.terminal import bare_table, wrapped
from rich.console import Group, RenderableType


@dataclass(frozen=True)
class Failure:
    """A recording without a result: unit, path and reason."""

    unit: str
    path: str
    reason: str


@dataclass(frozen=True)
class Fleet:
    """
    Many units of one model.

    Attributes
    ----------
    results : mapping of unit name to Result
    failures : tuple of Failure
    folders : bool
        Whether the report of each unit is in a folder of its name, beside the page of the fleet.

    """

    results: Mapping[str, Result]
    failures: tuple[Failure, ...] = ()
    folders: bool = False

    @cached_property
    def population(self) -> Population:
        """Return the statistics of the population of units."""
        return population(self.results)

    def reasons(self, unit: str) -> list[str]:
        """Return why a unit is an outlier, one sentence per quantity that is odd on some axes."""
        groups: dict[tuple[object, ...], list[Outlier]] = {}
        for outlier in self.population.outliers:
            if outlier.unit == unit:
                groups.setdefault((
                    outlier.key and (outlier.key, AXES[outlier.axis]), outlier.fault,
                    _by_difference(outlier), outlier.spreads is None), []).append(outlier)
        return [sentence(*same) for same in groups.values()]

    @property
    def unseen(self) -> str:
        """State which coefficients too few units show for a population; '' if there are none."""
        axes: dict[str, list[str]] = {}
        for axis, key in self.population.unseen:
            axes.setdefault(TERMS[key].name(AXES[axis]), []).append(axis)
        if not axes:
            return ''
        what = listed([f'{term} of {named(names)}' for term, names in axes.items()])
        return (f'{what} {"is" if len(axes) == 1 else "are"} shown by fewer than {FEWEST_UNITS} '
                f'of {len(self.results)} units, which makes no population; longer recordings show '
                'more')

    def serial(self, unit: str) -> str | None:
        """Return the serial number entered for a unit."""
        return (self.results[unit].inspection or Inspection()).serial


def quantity_name(axis: str, key: str) -> str:
    """Return the usual name of a quantity of an axis."""
    return 'zero bias' if key == MEAN else TERMS[key].name(AXES[axis])


def sentence(*same: Outlier) -> str:
    """Return why a unit is an outlier in one quantity, on one or several axes."""
    first = same[0]
    axes = first.axis if len(same) == 1 else named([outlier.axis for outlier in same])
    if first.key is None or first.value is None or first.median is None:
        return f'{axes} {"is" if len(same) == 1 else "are"} {first.fault}'
    quantity = AXES[first.axis]
    unit = quantity.unit if first.key == MEAN else TERMS[first.key].unit(quantity)
    scale, shown_unit = engineering(1.0, unit)
    values = [scale * (outlier.value or 0.0) for outlier in same]
    medians = [scale * (outlier.median or 0.0) for outlier in same]
    spreads = [abs(outlier.spreads) for outlier in same if outlier.spreads is not None]
    away = f', {ranged(spreads, "{:.1f}".format)} spreads away' if spreads else ''
    what = f'{axes} {quantity_name(first.axis, first.key)} {ranged(values, number)} {shown_unit}'
    if _by_difference(first):
        return f'{what}: the mean of the others is {ranged(medians, number)}{away}'
    ratios = [value / median for value, median in zip(values, medians, strict=True)]
    return f'{what}: {ranged(ratios, rounded)} times the median of the others{away}'


def _by_difference(outlier: Outlier) -> bool:
    """Return whether a value has no ratio to the median: it has a sign, or the median is 0."""
    return outlier.key in (MEAN, 'rate_ramp') or outlier.median == 0


def population_table(fleet: Fleet, width: int = 80) -> RenderableType:
    """Return a fleet for a terminal; outliers come last, next to the prompt."""
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
            'known'], width, 'dim')]
    if fleet.unseen:
        parts += wrapped([f'{fleet.unseen}.'], width, 'dim')
    parts += wrapped([', '.join(counts(fleet))], width, 'bold')
    for unit in fleet.population.outlier_units:
        parts += wrapped([f'{printable(unit)}: {"; ".join(fleet.reasons(unit))}'], width, 'yellow')
    for failure in fleet.failures:
        parts += wrapped([f'{printable(failure.unit)}: {printable(failure.reason)}'], width, 'red')
    return Group(*parts)


def counts(fleet: Fleet) -> list[str]:
    """Return the numbers of units, outliers and failed recordings as text."""
    odd = len(fleet.population.outlier_units)
    outliers = (
        counted(odd, 'outlier') if odd else
        'not compared: topics may be of different models' if not fleet.population.one_model else
        f'too few to compare (fewer than {FEWEST_UNITS})' if len(fleet.results) < FEWEST_UNITS else
        'no outlier')
    return [counted(len(fleet.results), 'unit'), outliers,
            *([f'{len(fleet.failures)} not counted'] if fleet.failures else [])]


def cells(trait: Trait) -> tuple[str, ...]:
    """Return a trait as a row of the table, in datasheet units."""
    def shown(value: float) -> str:
        return rounded(engineering(value, trait.unit)[0])

    symbol = quantity_name(trait.axis, MEAN) if trait.key == MEAN else TERMS[trait.key].symbol
    return (wording.spoken(trait.axis), symbol, engineering(1.0, trait.unit)[1],
            shown(trait.median),
            ' .. '.join(dict.fromkeys(shown(trait.percentiles[percent]) for percent in (5, 95))),
            shown(trait.between) if trait.between else
            wording.bounded(engineering(trait.between_ci95[1], trait.unit)[0]),
            shown(trait.measurement), '' if trait.tolerance is None else shown(trait.tolerance),
            f'{trait.observable} of {trait.units}')


def save_fleet(fleet: Fleet, folder: str | os.PathLike[str]) -> list[Path]:
    """Write ``fleet.json``, ``fleet.csv`` and ``fleet.html``."""
    return write_files(folder, {'fleet.json': lambda: fleet_json(fleet).encode(),
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
            'path': fleet.results[unit].source.path, 'folder': unit if fleet.folders else None,
            'duration_s': fleet.results[unit].timeline.duration_s, 'odd': unit in odd,
            'reasons': fleet.reasons(unit),
            'findings': [found.code for found in for_display(
                fleet.results[unit].warnings)]} for unit in population.units],
        'traits': [asdict(trait) for trait in population.traits],
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
        writer.writerow([_cell_text(unit), _cell_text(fleet.serial(unit) or ''),
                         _cell_text(result.source.path or ''), 'odd' if reasons else 'ok',
                         '; '.join(reasons), *numbers])
    for failure in fleet.failures:
        writer.writerow([_cell_text(failure.unit), '', _cell_text(failure.path), 'failed',
                         _cell_text(failure.reason)])
    return text.getvalue()


def _cell_text(text: str) -> str:
    # Spreadsheets evaluate such text as formulas, and names may come from untrusted folders.
    return f"'{text}" if text.startswith(('=', '+', '-', '@', '\t', '\r')) else text


def fleet_html(fleet: Fleet, title: str = 'Fleet') -> str:
    """Return the HTML page of a fleet, which loads nothing: pictures are embedded."""
    population = fleet.population
    return rendered(
        'fleet.html', program='', title=title, facts=_facts(fleet), fleet=fleet, worst=_worst,
        findings=findings_line,
        picture=_svg(curves_figure(fleet.results, population)) if fleet.results else '',
        traits=[{'name': quantity_name(trait.axis, trait.key), 'cells': _typeset(cells(trait))}
                for trait in population.traits],
        # For each, the worst axis of a unit is shown.
        columns=[(sensor, key) for sensor in wording.SENSORS
                 for key in ('noise_density', 'bias_instability')])


def _facts(fleet: Fleet) -> list[str]:
    lengths = [result.timeline.duration_s for result in fleet.results.values()]
    facts = counts(fleet)
    if lengths:
        shortest, longest = wording.duration(min(lengths)), wording.duration(max(lengths))
        facts.insert(1, shortest if shortest == longest else f'{shortest} to {longest} each')
    return facts


def _svg(figure: Any) -> str:
    """Return a figure as an SVG element in the colours of the page."""
    text = render(figure, 'svg').decode()
    text = text[text.index('<svg'):]
    of_page = {f'r{place}': colour for place, colour in enumerate(SERIES)} | {
        'ink': COLOURS['ink'], 'line': COLOURS['grid'], 'paper': COLOURS['paper']}
    for name, colour in of_page.items():
        text = text.replace(colour, f'var(--{name})')
    return re.sub(r'<metadata>.*?</metadata>', '', text, flags=re.DOTALL)


def _typeset(row: tuple[str, ...]) -> tuple[str, ...]:
    return (*row[:2], typeset(row[2]), *(cell.replace(' .. ', ' – ') for cell in row[3:]))


def _worst(result: Result, sensor: str, key: str) -> str:
    """Return the largest value of the axes as text or, without values, the largest bound."""
    axes = axes_of(result.axes, sensor)
    worst = worst_of(axes, key)
    return '' if worst is None else reported(axes[worst].coefficients[key])[0]
