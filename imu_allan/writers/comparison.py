# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Comparison of several results: sensors of one kind, or one sensor on several days.

The first result is the reference. A difference is given in units of the combined interval. That is
the root sum of squares of the facing half-widths of the two 95 % intervals. For two recordings of
one sensor, one coefficient in twenty differs by more than 1 by chance. Where one result has only a
bound, a value beyond it differs by its distance from the bound at least.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import copysign, hypot

from imu_allan.errors import ImuAllanError, printable
from imu_allan.fleet import faults
from imu_allan.noise.terms import AXES, TERMS
from imu_allan.result import Coefficient, Result
from imu_allan.sensor.units import engineering
from imu_allan.wording import counted, listed, ranged, SENSORS, spoken
from imu_allan.writers.curves import reported
from imu_allan.writers.terminal import bare_table
from rich.table import Table
from rich.text import Text


@dataclass(frozen=True)
class Difference:
    """
    One coefficient of one axis in two results.

    Attributes
    ----------
    axis, key : str
    reference, other : str
        Names of the results.
    coefficients : (Coefficient, Coefficient)
        The coefficient in the reference and in the other result.
    ratio : float or None
        Other divided by reference; None if one is not observable.
    in_intervals : float or None
        Signed difference in units of the combined interval; None if one is not observable and its
        bound does not exclude the other.

    """

    axis: str
    key: str
    reference: str
    other: str
    coefficients: tuple[Coefficient, Coefficient]
    ratio: float | None
    in_intervals: float | None


def compare(results: Mapping[str, Result]) -> list[Difference]:
    """Compare every result with the first, by axis, term and result."""
    reference, *others = results
    differences = []
    shared = [axis for axis in AXES if all(axis in result.axes for result in results.values())]
    for axis, key, other in product(shared, TERMS, others):
        a, b = (results[name].axes[axis].coefficients[key] for name in (reference, other))
        if a.observable or b.observable:
            differences.append(Difference(axis, key, reference, other, (a, b), *_difference(a, b)))
    if not differences:
        raise ImuAllanError('the results have no axis in common on which a coefficient is '
                            'observable')
    return differences


def verdicts(results: Mapping[str, Result]) -> list[str]:
    """
    Say what differs by more than the intervals, by result, sensor and term, and sum up.

    Axes that do not measure come first: of these no coefficient differs.
    """
    known = [one for one in compare(results) if all(
        found.value is not None or found.upper95 is not None for found in one.coefficients)]
    said = []
    for other, sensor, key in product(dict.fromkeys(one.other for one in known), SENSORS, TERMS):
        own = [one for one in known if (one.other, one.key) == (other, key)
               and one.axis.startswith(sensor)]
        for sign, word in ((1, 'above'), (-1, 'below')):
            beyond = [one for one in own if sign * (one.in_intervals or 0.0) > 1]
            if beyond:
                said.append(_sentence(beyond, len(own), SENSORS[sensor].lower(), word))
    chance = ('; of two recordings of one sensor, one coefficient in twenty does so by chance'
              if said else '')
    beyond_all = sum(abs(one.in_intervals or 0.0) > 1 for one in known)
    dead = [f'{spoken(one.axis)} of {printable(one.unit)} is {one.fault}'
            for one in faults(results)]
    return [*dead, *said, f'{beyond_all} of {counted(len(known), "coefficient")} '
            f'{"differs" if beyond_all == 1 else "differ"} by more than the 95 % intervals'
            + chance]


def _sentence(beyond: Sequence[Difference], of_sensor: int, sensor: str, word: str) -> str:
    first = beyond[0]
    axes = (f'all {sensor} axes' if len(beyond) == of_sensor > 1 else
            f'{first.axis.partition("_")[0]} ' + listed([one.axis[-1] for one in beyond]))
    two_digits = '{:.2g}'.format
    intervals = ranged([abs(one.in_intervals or 0.0) for one in beyond], two_digits)
    ratios = [one.ratio for one in beyond if one.ratio is not None and one.ratio > 0]
    least = '' if all(c.observable for one in beyond for c in one.coefficients) else 'at least '
    by = word if len(ratios) < len(beyond) else (
        f'{ranged([100 * abs(ratio - 1) for ratio in ratios], two_digits)} % {word}'
        if max(ratios) < 2 and min(ratios) > 0.5 else f'{ranged(ratios, two_digits)} times')
    return (f'{TERMS[first.key].symbol} of {axes} of {printable(first.other)} is {by} that of '
            f'{printable(first.reference)} ({least}{intervals} '
            f'{"interval" if intervals == "1" else "intervals"})')


def difference_table(differences: Sequence[Difference]) -> Table:
    """Format the differences as a table for a terminal."""
    others = list(dict.fromkeys(one.other for one in differences))
    alone = len(others) == 1
    table = bare_table('axis', 'term', 'unit', Text(printable(differences[0].reference)), *(
        [Text(printable(others[0]))] if alone else ['other', 'value']), 'ratio', 'intervals',
        texts=3)
    for difference in differences:
        reference, other = difference.coefficients
        beyond = difference.in_intervals is not None and abs(difference.in_intervals) > 1
        table.add_row(
            spoken(difference.axis), TERMS[difference.key].symbol,
            engineering(1.0, reference.unit)[1], shown(reference),
            *([] if alone else [Text(printable(difference.other))]), shown(other),
            '' if difference.ratio is None else f'{difference.ratio:.4g}',
            Text('' if difference.in_intervals is None else f'{difference.in_intervals:+.2f}',
                 style='bold yellow' if beyond else ''))
    return table


def shown(coefficient: Coefficient) -> str:
    """Return a coefficient, or its bound, in its engineering unit."""
    return (reported(coefficient) or ('not observable',))[0]


def _difference(a: Coefficient, b: Coefficient) -> tuple[float | None, float | None]:
    if a.value is None or a.ci95 is None:
        _, excluded = (None, None) if b.value is None else _difference(b, a)
        return None, None if excluded is None else -excluded
    if b.value is not None and b.ci95 is not None:
        value, ends, ratio = b.value, b.ci95, b.value / a.value if a.value else None
    elif b.upper95 is not None and b.upper95 < abs(a.value):
        value = copysign(b.upper95, a.value)
        ends, ratio = (value, value), None
    else:
        return None, None
    if value >= a.value:
        half = hypot(a.ci95[1] - a.value, value - ends[0])
    else:
        half = hypot(a.value - a.ci95[0], ends[1] - value)
    return ratio, (value - a.value) / half if half > 0 else None
