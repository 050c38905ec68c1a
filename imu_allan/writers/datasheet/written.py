# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Output of verdicts: table for the terminal, JSON, JUnit XML, and the certificate."""

from collections.abc import Sequence
from dataclasses import asdict
import json
from typing import Any, TYPE_CHECKING
import xml.etree.ElementTree as ElementTree

from imu_allan import wording
from imu_allan.errors import printable, shorten
from imu_allan.result import Result
from imu_allan.sensor.noise_model import NoiseModel
from imu_allan.sensor.units import typeset, unit_of
from imu_allan.version import __version__
from imu_allan.writers.datasheet.verdicts import (
    in_written_unit,
    Outcome,
    overall,
    reasons,
    Verdict,
    with_interval,
)
from imu_allan.writers.pages import rendered
from imu_allan.writers.terminal import bare_table
from imu_allan.writers.verdict import findings_line

if TYPE_CHECKING:
    from rich.table import Table

_MARKS: dict[Outcome, tuple[str, str, str]] = {
    'pass': ('✓', 'pass', 'green'), 'fail': ('✗', 'fail', 'bold red'),
    'cannot tell': ('?', 'undecided', 'yellow')}
"""Sign and class on the certificate, and style on a terminal."""
_LONGEST = 110
"""Characters that fit on a line of the sheet."""


def verdict_table(verdicts: Sequence[Verdict], title: str = '', left_out: Sequence[str] = ()
                  ) -> 'Table':
    """Return the verdicts as a table for a terminal, with the numbers of their `reasons`."""
    from rich.text import Text

    headings = [heading for heading in (
        'axis', 'term', 'measured', '95 % interval', 'limit', 'unit', 'ratio', 'verdict')
        if heading not in left_out]
    table = bare_table(*headings)
    table.title_justify = 'left'
    if title:
        table.title = Text(printable(title), style='bold')
    for column in table.columns:
        if column.header in ('unit', 'verdict'):
            column.justify = 'left'
    for verdict, number in zip(verdicts, reasons(verdicts)[1], strict=True):
        measured, interval, limit = figures(verdict)
        if 'measured' in left_out:
            interval = interval.replace(' .. ', '..') or measured
        cells: dict[str, str | Text] = {
            'axis': verdict.axis, 'term': verdict.symbol, 'measured': measured,
            '95 % interval': interval, 'limit': limit, 'unit': Text(unit_of(verdict.specified)),
            'ratio': '' if verdict.ratio is None else f'{verdict.ratio:.3g}',
            'verdict': Text(verdict.verdict if number is None else f'{verdict.verdict} ({number})',
                            style=_MARKS[verdict.verdict][2])}
        table.add_row(*(cells[heading] for heading in headings))
    return table


def figures(verdict: Verdict) -> tuple[str, str, str]:
    """Return measured value, interval and limit, each in the unit of the specification."""
    limit = in_written_unit(verdict, verdict.limit)
    if verdict.value is not None and verdict.ci95 is not None:
        value, low, high = with_interval(verdict, verdict.value, verdict.ci95)
        return value, f'{low} .. {high}', limit
    value = '' if verdict.value is None else in_written_unit(verdict, verdict.value)
    if verdict.upper95 is not None:
        return '', f'< {in_written_unit(verdict, verdict.upper95)}', limit
    return value, '', limit


def to_json(verdicts: Sequence[Verdict], result: Result, specification: NoiseModel) -> str:
    """Return the verdicts as JSON text with the schema ``imu_allan.check/1``."""
    quoted = result.to_dict()
    document: dict[str, Any] = {
        'schema': 'imu_allan.check/1', 'imu_allan_version': result.imu_allan_version,
        'source': quoted['source'], 'inspection': quoted['inspection'],
        'specification': specification.name, 'verdict': overall(verdicts),
        'checks': [asdict(verdict) for verdict in verdicts], 'warnings': quoted['warnings']}
    return json.dumps(document, indent=2, allow_nan=False) + '\n'


def to_junit(verdicts: Sequence[Verdict], result: Result, specification: NoiseModel) -> str:
    """Return the verdicts as JUnit XML: one test case each, skipped if undecided."""
    counts = {outcome: str(sum(verdict.verdict == outcome for verdict in verdicts))
              for outcome in ('pass', 'fail', 'cannot tell')}
    source = printable(result.source.path or result.source.topic or 'samples')
    name = printable(specification.name or 'specification')
    totals = {'tests': str(len(verdicts)), 'failures': counts['fail'], 'errors': '0',
              'skipped': counts['cannot tell']}
    suites = ElementTree.Element('testsuites', totals)
    suite = ElementTree.SubElement(suites, 'testsuite', {'name': f'{name}: {source}', **totals})
    if result.source.start_time:
        suite.set('timestamp', printable(result.source.start_time))
    inspection = {} if result.inspection is None else {
        key: printable(value) for key, value in asdict(result.inspection).items()
        if value is not None}
    if inspection:
        properties = ElementTree.SubElement(suite, 'properties')
        for key, value in inspection.items():
            ElementTree.SubElement(properties, 'property', {'name': key, 'value': value})
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


def _text(value: Any) -> str:
    return 'none' if value is None else str(value)


def certificate_html(verdicts: Sequence[Verdict], result: Result, specification: NoiseModel
                     ) -> str:
    """Return the certificate of a unit: HTML without script, for one sheet of A4."""
    outcome, (sentences, numbers) = overall(verdicts), reasons(verdicts)
    title = specification.name or 'specification'
    if result.inspection is not None and result.inspection.serial is not None:
        title = f'{title}, {result.inspection.serial}'
    numbered = list(zip(verdicts, numbers, strict=True))
    # More would push the signature off the sheet; the table has all verdicts anyway.
    most = 8
    return rendered(
        'certificate.html', version=__version__, outcome=outcome, outcome_class=_MARKS[outcome][1],
        title=shorten(printable(title), _LONGEST), facts=_facts(result, specification),
        tables={sensor: {key: [one for one in own if one[0].key == key]
                         for key in dict.fromkeys(verdict.key for verdict, _ in own)}
                for sensor in wording.SENSORS if (own := [
                    one for one in numbered if one[0].axis.startswith(sensor)])},
        marks=_MARKS, figures=figures, shown=_shown,
        findings=findings_line(result),
        sentences=[shorten(typeset(sentence)) for sentence in sentences[:most]],
        more=len(sentences) - most if len(sentences) > most else 0)


def _facts(result: Result, specification: NoiseModel) -> list[tuple[str, str]]:
    source, timeline, inspection = result.source, result.timeline, result.inspection
    rate = '' if timeline.sample_rate_hz is None else f' at {timeline.sample_rate_hz:.6g} Hz'
    facts = [('serial number', inspection.serial if inspection else None),
             ('specification', specification.name),
             ('operator', inspection.operator if inspection else None),
             ('recording', source.path), ('station', inspection.station if inspection else None),
             ('topic', source.topic), ('recorded', source.start_time),
             ('samples', f'{timeline.samples:,}{rate}, {wording.duration(timeline.duration_s)}')]
    return [(name, shorten(printable(value), _LONGEST)) for name, value in facts
            if value is not None]


def _shown(specified: str) -> str:
    # Characters that fit in the column of the table.
    return shorten(printable(typeset(specified)), 40)
