# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A fleet as its outputs show it: for each outlier the reason, as a sentence."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from imu_allan.fleet.population import FEWEST_UNITS, MEAN, Outlier, Population, population
from imu_allan.noise.terms import AXES, TERMS
from imu_allan.result import Result
from imu_allan.sensor.units import engineering
from imu_allan.wording import listed, named, number, ranged, rounded


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
    folders : mapping of unit name to str
        Folder of the unit's report, relative to the page of the fleet.
    failures : tuple of Failure

    """

    results: Mapping[str, Result]
    folders: Mapping[str, str] = field(default_factory=dict)
    failures: tuple[Failure, ...] = ()

    @cached_property
    def population(self) -> Population:
        """Return the statistics of the population of units."""
        return population(self.results)

    def reasons(self, unit: str) -> list[str]:
        """Return why a unit is an outlier, one sentence per outlier."""
        return [sentence(outlier) for outlier in self.population.outliers if outlier.unit == unit]

    def grouped_reasons(self, unit: str) -> list[str]:
        """Return the same, but with one sentence per quantity that is odd on several axes."""
        groups: dict[tuple[object, ...], list[Outlier]] = {}
        for outlier in self.population.outliers:
            if outlier.unit == unit:
                signed = outlier.key in (MEAN, 'rate_ramp') or outlier.median == 0
                groups.setdefault((
                    outlier.key and quantity_name(outlier.axis, outlier.key), outlier.fault,
                    outlier.key and _unit_of(outlier), signed, outlier.spreads is None),
                    []).append(outlier)
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
        inspection = self.results[unit].inspection
        return None if inspection is None else inspection.serial


def quantity_name(axis: str, key: str) -> str:
    """Return the usual name of a quantity of an axis."""
    return 'zero bias' if key == MEAN else TERMS[key].name(AXES[axis])


def sentence(*same: Outlier) -> str:
    """Return why a unit is an outlier in one quantity, on one or several axes."""
    first = same[0]
    axes = first.axis if len(same) == 1 else named([outlier.axis for outlier in same])
    if first.key is None or first.value is None or first.median is None:
        return f'{axes} {"is" if len(same) == 1 else "are"} {first.fault}'
    unit = _unit_of(first)
    shown_unit = engineering(1.0, unit)[1]

    values, medians = ([engineering(value or 0.0, unit)[0] for value in each] for each in zip(
        *((outlier.value, outlier.median) for outlier in same), strict=True))
    spreads = [abs(outlier.spreads) for outlier in same if outlier.spreads is not None]
    away = f', {ranged(spreads, "{:.1f}".format)} spreads away' if spreads else ''
    what = f'{axes} {quantity_name(first.axis, first.key)} {ranged(values, number)} {shown_unit}'
    if first.key in (MEAN, 'rate_ramp') or first.median == 0:
        return f'{what}: the mean of the others is {ranged(medians, number)}{away}'
    ratios = [value / median for value, median in zip(values, medians, strict=True)]
    return f'{what}: {ranged(ratios, rounded)} times the median of the others{away}'


def _unit_of(outlier: Outlier) -> str:
    quantity = AXES[outlier.axis]
    if outlier.key is None or outlier.key == MEAN:
        return quantity.unit
    return TERMS[outlier.key].unit(quantity)
