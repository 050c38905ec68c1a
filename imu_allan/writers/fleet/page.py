# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""HTML page of a fleet, without script."""

import re
from typing import Any
from urllib.parse import quote

from imu_allan.errors import printable
from imu_allan.result import Result
from imu_allan.sensor.units import engineering, typeset
from imu_allan.version import __version__
from imu_allan.wording import bounded, duration, rounded, SENSORS
from imu_allan.writers.curves import axes_of
from imu_allan.writers.figure_style import DARK
from imu_allan.writers.fleet.figure import curves_figure
from imu_allan.writers.fleet.outlier_sentences import Fleet, quantity_name
from imu_allan.writers.fleet.table import cells, counts
from imu_allan.writers.key_figures import worst_of
from imu_allan.writers.pages import rendered, text_of
from imu_allan.writers.plot import render
from imu_allan.writers.verdict_lines import findings_line


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
    facts = counts(fleet)
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
