# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A fleet with everything that is told about it, and its findings in sentences."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from imu_allan.fleet.population import FEWEST_UNITS, MEAN, Oddity, Population, population
from imu_allan.noise.terms import AXES, TERMS
from imu_allan.result import Result
from imu_allan.sensor.units import engineering
from imu_allan.wording import listed, named, number, rounded
from imu_allan.writers.grouped_remarks import told_once


@dataclass(frozen=True)
class Failure:
    """A recording of which nothing came: the unit, the path and why."""

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
    folders : mapping of unit name to str
        Where the unit's own report lies, relative to the fleet's page.
    failures : tuple of Failure

    """

    results: Mapping[str, Result]
    folders: Mapping[str, str] = field(default_factory=dict)
    failures: tuple[Failure, ...] = ()

    @cached_property
    def population(self) -> Population:
        """Return what the units have in common."""
        return population(self.results)

    def reasons(self, unit: str) -> list[str]:
        """Return why a unit sticks out, a sentence for each oddity."""
        return [sentence(oddity) for oddity in self.population.oddities if oddity.unit == unit]

    def grouped_reasons(self, unit: str) -> list[str]:
        """Return the same, what differs in the axis and in numbers alone as one sentence."""
        found: list[tuple[str | None, str]] = []
        for reason in self.reasons(unit):
            axis, _, text = reason.partition(' ')
            # Of an axis that measures nothing there is no number to be told together.
            found.append((None, reason) if text.startswith('is ') else (axis, text))
        return list(told_once(found))

    @property
    def unseen(self) -> str:
        """Say which coefficients too few units show for a population; empty where all do."""
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
        """Return the serial number that was entered for a unit."""
        inspection = self.results[unit].inspection
        return None if inspection is None else inspection.serial


def quantity_name(axis: str, key: str) -> str:
    """Return what a quantity of an axis is called in the field."""
    return 'zero bias' if key == MEAN else TERMS[key].name(AXES[axis])


def sentence(oddity: Oddity) -> str:
    """Return why a unit does not belong."""
    if oddity.key is None or oddity.value is None or oddity.median is None:
        return f'{oddity.axis} is {oddity.fault}'
    unit = AXES[oddity.axis].unit if oddity.key == MEAN \
        else TERMS[oddity.key].unit(AXES[oddity.axis])
    value, shown_unit = engineering(oddity.value, unit)
    median = engineering(oddity.median, unit)[0]
    away = '' if oddity.spreads is None else f', {abs(oddity.spreads):.1f} spreads away'
    what = f'{oddity.axis} {quantity_name(oddity.axis, oddity.key)} {number(value)} {shown_unit}'
    if oddity.key in (MEAN, 'rate_ramp') or oddity.median == 0:
        return f'{what}: the mean of the others is {number(median)}{away}'
    return f'{what}: {rounded(oddity.value / oddity.median)} times the median of the others{away}'
