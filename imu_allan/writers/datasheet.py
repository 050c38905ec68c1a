# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
A measured sensor against its datasheet.

A specification says what a coefficient is at most. Whether the sensor keeps it is decided by the
measured 95 % interval, not by the value: the interval below the limit passes, the interval above
it fails, and between the two this recording cannot tell.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
import json
from typing import Any, Literal, TYPE_CHECKING
import xml.etree.ElementTree as ElementTree

from imu_allan.errors import ImuAllanError, printable
from imu_allan.noise.model import NoiseModel
from imu_allan.noise.terms import AXES, TERMS
from imu_allan.noise.units import convert, unit_of
from imu_allan.result import AxisResult, Coefficient, Result
from imu_allan.writers.table import number

if TYPE_CHECKING:
    from rich.table import Table

Outcome = Literal['pass', 'fail', 'cannot tell']

SCHEMA = 'imu_allan.check/1'
_STYLES: dict[Outcome, str] = {'pass': 'green', 'fail': 'bold red', 'cannot tell': 'yellow'}


@dataclass(frozen=True)
class Verdict:
    """
    One coefficient of one axis against its limit.

    Attributes
    ----------
    axis, key, symbol, unit : str
        Which coefficient, and its SI unit, that of `limit`, `value`, `ci95` and `upper95`.
    limit : float
        The most that the specification allows.
    specified : str
        The limit as the file writes it.
    value, ci95, upper95 : optional
        As measured (of a ramp the magnitude); None as in the result.
    ratio : float or None
        `value` over `limit`.
    verdict : 'pass', 'fail' or 'cannot tell'
    reason : str
        One plain sentence.

    """

    axis: str
    key: str
    symbol: str
    unit: str
    limit: float
    specified: str
    value: float | None
    ci95: tuple[float, float] | None
    upper95: float | None
    ratio: float | None
    verdict: Outcome
    reason: str


def check(result: Result, specification: NoiseModel) -> list[Verdict]:
    """
    Compare every coefficient that the specification limits.

    Parameters
    ----------
    result : Result
        As measured.
    specification : NoiseModel
        From `imu_allan.noise.model.load_model`. Its means and Gauss-Markov terms are no limits.

    Returns
    -------
    list of Verdict
        By axis, then by term.

    Raises
    ------
    ImuAllanError
        If the specification limits nothing.

    """
    verdicts = []
    for axis in AXES:
        for key in TERMS:
            limit = specification.axes.get(axis, {}).get(key)
            if limit is not None:
                written = specification.as_written.get(axis, {}).get(key)
                verdicts.append(_verdict(result, axis, key, abs(limit), written))
    if not verdicts:
        raise ImuAllanError('the specification limits no coefficient; write for instance '
                            'gyro: {noise_density: 0.03 deg/s/sqrt(Hz)}')
    return verdicts


def overall(verdicts: Sequence[Verdict]) -> Outcome:
    """Return 'fail' if any coefficient fails, else 'cannot tell' if any is so, else 'pass'."""
    outcomes = {verdict.verdict for verdict in verdicts}
    return 'fail' if 'fail' in outcomes else 'cannot tell' if 'cannot tell' in outcomes else 'pass'


def verdict_table(verdicts: Sequence[Verdict], title: str = '') -> 'Table':
    """
    Lay the verdicts out for a terminal.

    Every number stands in the unit that the specification uses, so that the two can be compared
    by eye.

    Parameters
    ----------
    verdicts : sequence of Verdict
        What to show.
    title : str, optional
        Of the table.

    Returns
    -------
    rich.table.Table

    """
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(printable(title), style='bold') if title else None,
                  title_justify='left', box=box.SIMPLE_HEAD, padding=0)
    for heading in ('axis', 'term', 'measured', '95 % interval', 'limit', 'unit', 'ratio',
                    'verdict'):
        table.add_column(heading, overflow='fold', justify='right' if heading in (
            'measured', '95 % interval', 'limit', 'ratio') else 'left')
    for verdict in verdicts:
        unit = unit_of(verdict.specified)
        table.add_row(verdict.axis, verdict.symbol, *_numbers(verdict, unit), Text(unit),
                      '' if verdict.ratio is None else f'{verdict.ratio:.3g}',
                      Text(verdict.verdict, style=_STYLES[verdict.verdict]))
    return table


def to_json(verdicts: Sequence[Verdict], result: Result, specification: NoiseModel) -> str:
    """
    Return the verdicts as JSON text of the schema ``imu_allan.check/1``.

    Parameters
    ----------
    verdicts : sequence of Verdict
        From `check`.
    result, specification
        What was compared; source and name are quoted.

    """
    document: dict[str, Any] = {
        'schema': SCHEMA, 'imu_allan_version': result.imu_allan_version,
        'source': result.to_dict()['source'], 'specification': specification.name,
        'verdict': overall(verdicts), 'checks': [asdict(verdict) for verdict in verdicts]}
    return json.dumps(document, indent=2, allow_nan=False) + '\n'


def to_junit(verdicts: Sequence[Verdict], result: Result, specification: NoiseModel) -> str:
    """
    Return the verdicts as JUnit XML: a test case for each, skipped where one cannot tell.

    Parameters
    ----------
    verdicts : sequence of Verdict
        From `check`.
    result, specification
        What was compared.

    """
    counts = {outcome: str(sum(verdict.verdict == outcome for verdict in verdicts))
              for outcome in _STYLES}
    source = printable(result.source.path or result.source.topic or 'samples')
    name = printable(specification.name or 'specification')
    totals = {'tests': str(len(verdicts)), 'failures': counts['fail'], 'errors': '0',
              'skipped': counts['cannot tell']}
    suites = ElementTree.Element('testsuites', totals)
    suite = ElementTree.SubElement(suites, 'testsuite', {'name': f'{name}: {source}', **totals})
    if result.source.start_time:
        suite.set('timestamp', printable(result.source.start_time))
    for verdict in verdicts:
        case = ElementTree.SubElement(suite, 'testcase', {
            'classname': verdict.axis, 'name': verdict.key, 'time': '0'})
        if verdict.verdict == 'fail':
            ElementTree.SubElement(case, 'failure', {'message': verdict.reason,
                                                     'type': 'specification'})
        elif verdict.verdict == 'cannot tell':
            ElementTree.SubElement(case, 'skipped', {'message': verdict.reason})
        ElementTree.SubElement(case, 'system-out').text = (
            f'measured {_text(verdict.value)}, 95 % interval '
            f'{_text(verdict.ci95)}, limit {verdict.limit!r} {verdict.unit} '
            f'({printable(verdict.specified)})')
    ElementTree.indent(suites)
    return ElementTree.tostring(suites, encoding='unicode', xml_declaration=True) + '\n'


def _verdict(result: Result, axis: str, key: str, limit: float, written: str | None) -> Verdict:
    term = TERMS[key]
    unit = term.unit(AXES[axis])
    measured = result.axes.get(axis)
    coefficient = measured.coefficients[key] if measured else None
    value = None if coefficient is None or coefficient.value is None else abs(coefficient.value)
    interval = _magnitude(coefficient)
    specified = written or f'{limit!r} {unit}'
    outcome, reason = _decide(measured, coefficient, interval, limit, f'{axis} {term.symbol}',
                              specified)
    return Verdict(
        axis=axis, key=key, symbol=term.symbol, unit=unit, limit=limit, specified=specified,
        value=value, ci95=interval, upper95=coefficient.upper95 if coefficient else None,
        ratio=value / limit if value is not None and limit > 0 else None,
        verdict=outcome, reason=reason)


def _decide(measured: AxisResult | None, coefficient: Coefficient | None,
            interval: tuple[float, float] | None, limit: float, what: str,
            specified: str) -> tuple[Outcome, str]:
    if measured is None or coefficient is None:
        return 'cannot tell', f'{what}: this axis is not in the result'
    if interval is None:
        bound = coefficient.upper95
        if bound is not None and bound <= limit:
            return 'cannot tell', (f'{what}: not observable in this recording, but below the '
                                   'limit with 95 % confidence')
        return 'cannot tell', f'{what}: not observable in this recording; record for longer'
    if not measured.goodness_of_fit.acceptable:
        return 'cannot tell', f'{what}: the noise model does not fit this axis'
    if interval[1] <= limit:
        return 'pass', f'{what}: the 95 % interval is below {printable(specified)}'
    if interval[0] > limit:
        return 'fail', f'{what}: the 95 % interval is above {printable(specified)}'
    return 'cannot tell', (f'{what}: the 95 % interval reaches across {printable(specified)}; '
                           'record for longer')


def _magnitude(coefficient: Coefficient | None) -> tuple[float, float] | None:
    """Interval of the coefficient's magnitude: a ramp may fall as well as rise."""
    if coefficient is None or not coefficient.observable or coefficient.ci95 is None:
        return None
    low, high = coefficient.ci95
    if low >= 0:
        return low, high
    return (-high, -low) if high <= 0 else (0.0, max(-low, high))


def _numbers(verdict: Verdict, unit: str) -> tuple[str, str, str]:
    """Measured value, interval and limit, each in `unit`."""
    def shown(value: float) -> str:
        return number(convert(value, verdict.unit, unit))

    limit = shown(verdict.limit)
    if verdict.value is not None and verdict.ci95 is not None:
        return shown(verdict.value), ' .. '.join(map(shown, verdict.ci95)), limit
    if verdict.upper95 is not None:
        return '', f'< {shown(verdict.upper95)}', limit
    return '', '', limit


def _text(value: Any) -> str:
    return 'none' if value is None else str(value)
