# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Table of a fleet for the terminal."""

from typing import TYPE_CHECKING

from imu_allan.errors import printable
from imu_allan.fleet.population import FEWEST_UNITS, MEAN, Trait
from imu_allan.noise.terms import TERMS
from imu_allan.sensor.units import engineering
from imu_allan.wording import bounded, counted, rounded, spoken
from imu_allan.writers.fleet.outlier_sentences import Fleet
from imu_allan.writers.terminal import bare_table, wrapped

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
    parts += wrapped([', '.join(counts(fleet))], width, 'bold')
    for unit in fleet.population.outlier_units:
        parts += wrapped([f'{printable(unit)}: {"; ".join(fleet.grouped_reasons(unit))}'],
                         width, 'yellow')
    for failure in fleet.failures:
        parts += wrapped([f'{printable(failure.unit)}: {printable(failure.reason)}'], width, 'red')
    return Group(*parts)


def counts(fleet: Fleet) -> list[str]:
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
