# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A fleet on the terminal: the population, and its outliers."""

from typing import TYPE_CHECKING

from imu_allan.errors import printable
from imu_allan.fleet.population import MEAN, Trait
from imu_allan.noise.terms import TERMS
from imu_allan.sensor.units import engineering
from imu_allan.wording import bounded, rounded, spoken
from imu_allan.writers.fleet.findings import Fleet
from imu_allan.writers.terminal import bare_table

if TYPE_CHECKING:
    from rich.console import RenderableType


def population_table(fleet: Fleet) -> 'RenderableType':
    """
    Lay a fleet out for a terminal.

    Returns
    -------
    rich renderable

    """
    from rich.console import Group
    from rich.text import Text

    parts: list[RenderableType] = []
    if fleet.population.traits:
        table = bare_table('axis', 'term', 'unit', 'median', '5 .. 95 %', 'spread', 'error',
                           '95/95', 'shown by', texts=3)
        for trait in fleet.population.traits:
            table.add_row(*cells(trait))
        parts += [Text(f'{len(fleet.results)} units', 'bold'), table, Text(
            '5 .. 95 %: where nine in ten units lie; spread: between units, measurement error '
            'apart, or its 95 % upper limit where none shows; 95/95: 95 % of all such units keep '
            'it, with 95 % confidence, where enough units are known', 'dim')]
    if fleet.unseen:
        parts.append(Text(fleet.unseen, style='italic'))
    for unit in fleet.population.odd_units:
        text = Text(f'{printable(unit)}: ', style='bold yellow')
        text.append('; '.join(fleet.grouped_reasons(unit)), style='not bold')
        parts.append(text)
    for failure in fleet.failures:
        text = Text(f'{printable(failure.unit)}: ', style='bold red')
        text.append(printable(failure.reason), style='not bold')
        parts.append(text)
    return Group(*parts)


def cells(trait: Trait) -> tuple[str, ...]:
    """Return a trait as a row of the table, in the units of datasheets."""
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
