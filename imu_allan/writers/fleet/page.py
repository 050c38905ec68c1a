# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The page of a fleet: one HTML file without script."""

import re
from typing import Any
from urllib.parse import quote

from imu_allan.errors import printable
from imu_allan.result import Result
from imu_allan.sensor.units import engineering, typeset
from imu_allan.version import __version__
from imu_allan.wording import bounded, duration, rounded
from imu_allan.writers.answer import worst_of
from imu_allan.writers.curves import axes_of
from imu_allan.writers.figure_style import DARK
from imu_allan.writers.fleet.figure import curves_figure, units_figure
from imu_allan.writers.fleet.findings import Fleet, quantity_name
from imu_allan.writers.fleet.table import cells
from imu_allan.writers.pages import filled, text_of
from imu_allan.writers.plot import render
from imu_allan.writers.verdict import findings_line

_COLUMNS = (('gyro', 'noise_density'), ('gyro', 'bias_instability'), ('accel', 'noise_density'),
            ('accel', 'bias_instability'))
"""Worst-axis coefficients in the table of units."""


def fleet_html(fleet: Fleet, title: str = 'Fleet') -> str:
    """
    Return the page of a fleet.

    Parameters
    ----------
    fleet : Fleet
        What to report.
    title : str, optional
        Of the page.

    Returns
    -------
    str
        An HTML document that loads nothing, pictures included.

    """
    from markupsafe import Markup

    population = fleet.population
    return filled(
        'fleet.html', version=__version__, title=printable(title),
        style=Markup(f'{text_of("report.css")}{_both_colours()}'),
        facts=_facts(fleet),
        fleet=fleet, reasons=_reasons, link=_link, worst=_worst, findings=findings_line,
        pictures=[(name, Markup(_svg(figure, place))) for place, (name, figure) in enumerate((
            ('Allan deviation of every unit', curves_figure(fleet)),
            ('Coefficients of every unit', units_figure(fleet))))] if fleet.results else [],
        traits=[{'name': quantity_name(trait.axis, trait.key), 'cells': _typeset(cells(trait))}
                for trait in population.traits],
        columns=_COLUMNS)


def _facts(fleet: Fleet) -> list[str]:
    lengths = [result.timeline.duration_s for result in fleet.results.values()]
    facts = [f'{len(fleet.results)} units']
    if lengths:
        shortest, longest = duration(min(lengths)), duration(max(lengths))
        facts.append(shortest if shortest == longest else f'{shortest} to {longest} each')
    odd, failed = len(fleet.population.odd_units), len(fleet.failures)
    facts.append('no outlier' if not odd else f'{odd} outlier{"s" if odd > 1 else ""}')
    if failed:
        facts.append(f'{failed} not counted')
    return facts


def _svg(figure: Any, place: int) -> str:
    """Give the figure as an element of the page, its identifiers apart from the others'."""
    text = render(figure, 'svg').decode()
    text = text[text.index('<svg'):]
    text = re.sub(r'(id="|href="#|url\(#)', rf'\1f{place}-', text)
    for colour in DARK:
        text = text.replace(colour, f'var(--c{colour[1:]})')
    return re.sub(r'<metadata>.*?</metadata>', '', text, flags=re.DOTALL)


def _both_colours() -> str:
    """Return the style by which pictures are dark where the page is."""
    light, dark = (' '.join(f'--c{colour[1:]}: {shown};' for colour, shown in pairs)
                   for pairs in (zip(DARK, DARK, strict=True), DARK.items()))
    return (f':root {{ {light} }}\n'
            f'@media screen and (prefers-color-scheme: dark) {{ :root {{ {dark} }} }}')


def _typeset(row: tuple[str, ...]) -> tuple[str, ...]:
    return (*row[:2], typeset(row[2]), *(cell.replace(' .. ', ' – ') for cell in row[3:]))


def _reasons(fleet: Fleet, unit: str) -> list[str]:
    return [typeset(sentence) for sentence in fleet.grouped_reasons(unit)]


def _worst(result: Result, sensor: str, key: str) -> str:
    """Largest value of the axes, or the largest bound where none shows one."""
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
