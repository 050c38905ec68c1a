# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The verdicts of `imu_allan.datasheet` in words, as a table, JSON, JUnit XML and a certificate.

Figures are in the units of the datasheet. The certificate is one sheet of A4.
"""

from collections.abc import Sequence
from dataclasses import asdict
import json
from typing import Any, TYPE_CHECKING

from imu_allan import wording
from imu_allan.datasheet import Outcome, overall, Verdict
from imu_allan.errors import printable, shorten
from imu_allan.result import Inspection, Result
from imu_allan.sensor.noise_model import NoiseModel
from imu_allan.sensor.units import convert, typeset, unit_of
from imu_allan.wording import measured, number
from imu_allan.writers.key_figures import findings_line
from imu_allan.writers.pages import rendered
from imu_allan.writers.terminal import bare_table

if TYPE_CHECKING:
    from rich.table import Table

_LONGEST = 110
"""Characters that fit on a line of the sheet."""


def summary(verdicts: Sequence[Verdict]) -> tuple[Outcome, list[str]]:
    """Return the verdict on the whole sensor, and the reasons against a pass, with figures."""
    outcome = overall(verdicts)
    return outcome, reasons([verdict for verdict in verdicts if verdict.verdict == outcome])[0]


def reasons(verdicts: Sequence[Verdict]) -> tuple[list[str], list[int | None]]:
    """Return why quantities do not pass, failures first, and the number of each one's reason."""
    keys = [None if verdict.verdict == 'pass' else (
        verdict.verdict, _with_figures(verdict).removeprefix(
            f'{verdict.axis} {verdict.symbol}: ')) for verdict in verdicts]
    order = sorted(dict.fromkeys(filter(None, keys)), key=lambda key: key[0] != 'fail')
    sentences = [', '.join(f'{verdict.axis} {verdict.symbol}' for verdict, own in zip(
        verdicts, keys, strict=True) if own == key) + f': {key[1]}' for key in order]
    return sentences, [None if key is None else order.index(key) + 1 for key in keys]


def _with_figures(verdict: Verdict) -> str:
    value, interval, _ = figures(verdict)
    return f'{verdict.reason} (measured {value}, {interval})' if value else verdict.reason


def figures(verdict: Verdict) -> tuple[str, str, str]:
    """Return measured value, interval and limit, each in the unit of the specification."""
    scale = convert(1.0, verdict.unit, unit_of(verdict.specified))
    limit = number(scale * verdict.limit)
    if verdict.value is not None and verdict.ci95 is not None:
        value, low, high = measured(*(scale * one for one in (verdict.value, *verdict.ci95)))
        return value, f'{low} .. {high}', limit
    return '', '' if verdict.upper95 is None else f'< {number(scale * verdict.upper95)}', limit


def verdict_table(verdicts: Sequence[Verdict], title: str) -> 'Table':
    """Return the verdicts as a table for a terminal, with the numbers of their `reasons`."""
    from rich.text import Text

    table = bare_table('axis', 'term', 'measured', '95 % interval', 'limit', 'unit', 'ratio',
                       'verdict')
    table.title, table.title_justify = Text(printable(title), style='bold'), 'left'
    for column in table.columns[5], table.columns[7]:
        column.justify, column.no_wrap = 'left', True
    styles = {'pass': 'green', 'fail': 'bold red', 'cannot tell': 'yellow'}
    for verdict, reason in zip(verdicts, reasons(verdicts)[1], strict=True):
        word = verdict.verdict if reason is None else f'{verdict.verdict} ({reason})'
        table.add_row(verdict.axis, verdict.symbol, *figures(verdict),
                      Text(unit_of(verdict.specified)),
                      '' if verdict.ratio is None else f'{verdict.ratio:.3g}',
                      Text(word, style=styles[verdict.verdict]))
    return table


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
    outcomes = [verdict.verdict for verdict in verdicts]
    source, said = result.source, vars(result.inspection or Inspection())
    return rendered(
        'junit.xml', verdicts=verdicts, source=source, failed=outcomes.count('fail'),
        undecided=outcomes.count('cannot tell'),
        name=f'{specification.name or "specification"}: '
             f'{source.path or source.topic or "samples"}',
        entered={key: value for key, value in said.items() if value is not None}) + '\n'


def certificate_html(verdicts: Sequence[Verdict], result: Result, specification: NoiseModel
                     ) -> str:
    """Return the certificate of a unit: HTML without script, for one sheet of A4."""
    outcome, (sentences, numbers) = overall(verdicts), reasons(verdicts)
    inspection = result.inspection or Inspection()
    title = ', '.join(filter(None, (specification.name or 'specification', inspection.serial)))
    # Sign and class of each.
    marks: dict[Outcome, tuple[str, str]] = {
        'pass': ('✓', 'pass'), 'fail': ('✗', 'fail'), 'cannot tell': ('?', 'undecided')}
    numbered = list(zip(verdicts, numbers, strict=True))
    # More would push the signature off the sheet; the table has all verdicts anyway.
    most = 8
    return rendered(
        'certificate.html', outcome=outcome, outcome_class=marks[outcome][1],
        title=shorten(printable(title), _LONGEST), facts=_facts(result, specification),
        tables={sensor: {key: [one for one in own if one[0].key == key]
                         for key in dict.fromkeys(verdict.key for verdict, _ in own)}
                for sensor in wording.SENSORS if (own := [
                    one for one in numbered if one[0].axis.startswith(sensor)])},
        marks=marks, figures=figures, shown=_shown, findings=findings_line(result),
        sentences=[shorten(typeset(sentence)) for sentence in sentences[:most]],
        more=max(len(sentences) - most, 0))


def _facts(result: Result, specification: NoiseModel) -> list[tuple[str, str]]:
    source, timeline = result.source, result.timeline
    inspection = result.inspection or Inspection()
    rate = '' if timeline.sample_rate_hz is None else f' at {timeline.sample_rate_hz:.6g} Hz'
    facts = [('serial number', inspection.serial), ('specification', specification.name),
             ('operator', inspection.operator), ('recording', source.path),
             ('station', inspection.station), ('topic', source.topic),
             ('recorded', source.start_time),
             ('samples', f'{timeline.samples:,}{rate}, {wording.duration(timeline.duration_s)}')]
    return [(name, shorten(printable(value), _LONGEST)) for name, value in facts
            if value is not None]


def _shown(specified: str) -> str:
    # Characters that fit in the column of the table.
    return shorten(printable(typeset(specified)), 40)
