# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The report: a single HTML file, for one result or for a comparison.

It contains everything and loads nothing. The key figures come first, then the charts, the tables,
and how they were computed. Style sheet, script and pictures are embedded. A content security
policy forbids every request and every script but its own. So a report that is opened years later,
offline, or mailed by a stranger shows exactly what it showed at first.
"""

from base64 import b64encode
from collections.abc import Mapping
from hashlib import sha256
import re
from typing import Any

from imu_allan import wording
from imu_allan.errors import ImuAllanError, printable
from imu_allan.finding_messages import for_display, message_of, sensor_verdicts, title_of
from imu_allan.noise.terms import AXES
from imu_allan.result import Coefficient, Interval, Result
from imu_allan.sensor.units import engineering, typeset
from imu_allan.writers import charts, key_figures
from imu_allan.writers.comparison import compare, shown, verdicts
from imu_allan.writers.curves import by_sensor, reported
from imu_allan.writers.filters import CONSUMERS, export
from imu_allan.writers.key_figures import findings_line, verdict_lines, VERDICT_TEXT
from imu_allan.writers.pages import rendered, text_of


def report_html(result: Result) -> str:
    """Return the report of one result."""
    found, timeline = key_figures.figures_of(result), result.timeline
    tables = by_sensor(result.axes)
    tunings = {name: tuning for figures in found for name, tuning in figures.tunings.items()}
    allan = [charts.allan_chart(sensor, axes, timeline) for sensor, axes in tables.items()]
    # Group the other charts by kind, each for both sensors.
    drawn = [*(charts.signal_chart(result, sensor, axes) for sensor, axes in tables.items()),
             *(charts.density_chart(sensor, axes, timeline) for sensor, axes in tables.items()),
             *(charts.drift_chart(sensor, axes, tunings) for sensor, axes in tables.items())]
    remarks = [{'title': title_of(one), 'severity': one.severity,
                'text': _typeset(message_of(one))} for one in for_display(result.warnings)]
    words = {sensor: VERDICT_TEXT[one.verdict] for sensor, one in sensor_verdicts(result).items()}
    return _page(
        'report.html', title=' '.join(wording.names_of(result)), names=wording.names_of(result),
        verdict=[_typeset(line) for line in verdict_lines(result)], facts=_facts(result),
        version=printable(result.imu_allan_version), words=words, key_figures=found,
        remarks=remarks, remark_count=findings_line(result), timeline=timeline, tables=tables,
        allan=[*filter(None, allan)], charts=[*filter(None, drawn)],
        constant=wording.named([name for name, axis in result.axes.items() if axis.constant]),
        outlook=key_figures.longer_recording_note(result), cell=_cell, of_segment=_of_segment,
        mean=key_figures.written_mean, rest_of=result.rest_of, configs=_configs(result),
        tunings=[(name, result.axes[name], tuning) for name, tuning in tunings.items()],
        parts={sensor: known for sensor, axes in tables.items() if (known := {
            name: axis for name, axis in axes.items()
            if axis.stationarity is not None and axis.stationarity.segments})},
        aiding=f'{key_figures.AIDING_S:g} s', coast=wording.duration(key_figures.COAST_S),
        calibration=wording.duration(key_figures.CALIBRATION_S), uncertain=key_figures.UNCERTAIN,
        noisy={name: axis for name, axis in result.axes.items() if not axis.constant})


def comparison_html(results: Mapping[str, Result]) -> str:
    """Return a report that compares several results with the first of them."""
    named_results = {printable(name): result for name, result in results.items()}
    drawn = [chart for axis in AXES if (chart := charts.comparison_chart(named_results, axis))]
    summaries = [{'name': name, 'source': ' '.join(wording.names_of(result)),
                  'facts': _facts(result)} for name, result in named_results.items()]
    return _page('comparison.html', shown=shown, verdicts=verdicts(results), charts=drawn,
                 title='Allan deviation compared', summaries=summaries,
                 differences=compare(results))


def _page(template: str, **context: Any) -> str:
    # The script is no template, despite the suffix of its file.
    program = text_of('report.js')
    digest = b64encode(sha256(program.encode()).digest()).decode()
    return rendered(template, program=program, hashes=f"'sha256-{digest}'", **context)


def _facts(result: Result) -> list[str]:
    return [wording.amount_of(result.timeline), *wording.origin_of(result),
            *wording.faults_of(result.timeline)]


def _typeset(sentence: str) -> str:
    # The word after a number is a unit, or one that `typeset` leaves unchanged.
    return re.sub(r'(?<=\d )[A-Za-z][\w/^()*]*', lambda match: typeset(match[0]),
                  sentence).replace('+-', '±')


def _cell(coefficient: Coefficient) -> dict[str, str]:
    """Return a coefficient in both units: value and interval, or its bound."""
    cell = {}
    for unit, si in (('', False), ('si_', True)):
        value, *ends = reported(coefficient, si=si) or ('not observable',)
        cell[f'{unit}value'], cell[f'{unit}interval'] = value, ' – '.join(ends)
    return {**cell, 'exact': '' if coefficient.value is None else repr(coefficient.value)}


def _of_segment(value: float | None, ci95: Interval | None, unit: str) -> tuple[str, str]:
    """Return a value of a segment, and its interval if it has one, as text; empty if unknown."""
    if value is None:
        return '', ''
    shown = engineering(value, unit)[0]
    if ci95 is None:
        return wording.number(shown, 2), ''
    text, *ends = wording.measured(shown, *(engineering(end, unit)[0] for end in ci95))
    return text, ' – '.join(ends)


def _configs(result: Result) -> list[dict[str, str]]:
    configs = []
    for key, consumer in CONSUMERS.items():
        try:
            name, text = consumer.file, export(result, key)
        except ImuAllanError as error:
            name, text = '', str(error)
        configs.append({'key': key, 'title': consumer.title, 'name': name, 'text': text})
    return configs
