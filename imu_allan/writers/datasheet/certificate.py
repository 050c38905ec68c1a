# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The certificate: one sheet of A4 with every verdict on a unit, printed by the browser."""

from collections.abc import Sequence
from typing import Any

from imu_allan.errors import printable, shorten
from imu_allan.noise.terms import AXES, TERMS
from imu_allan.result import Result
from imu_allan.sensor.noise_model import NoiseModel
from imu_allan.sensor.units import typeset
from imu_allan.version import __version__
from imu_allan.wording import duration
from imu_allan.writers.datasheet.table import figures
from imu_allan.writers.datasheet.verdicts import Outcome, overall, reasons, Verdict
from imu_allan.writers.pages import filled
from imu_allan.writers.verdict import findings_line

_TITLES = {'gyro': 'Gyroscope', 'accel': 'Accelerometer'}
_MARKS: dict[Outcome, tuple[str, str]] = {
    'pass': ('✓', 'pass'), 'fail': ('✗', 'fail'), 'cannot tell': ('?', 'doubt')}
_MOST_SENTENCES = 8
"""More would push the signature off the sheet; the table holds every verdict anyway."""
_LONGEST = 110
"""Characters that fit on a line of the sheet."""


def certificate_html(verdicts: Sequence[Verdict], result: Result, specification: NoiseModel
                     ) -> str:
    """
    Return the certificate of a unit.

    Parameters
    ----------
    verdicts : sequence of Verdict
        From `check`.
    result, specification
        What was compared.

    Returns
    -------
    str
        An HTML document without script, which prints on one sheet of A4.

    """
    outcome, (sentences, numbers) = overall(verdicts), reasons(verdicts)
    numbered = list(zip(verdicts, numbers, strict=True))
    return filled(
        'certificate.html', version=__version__, outcome=outcome, outcome_class=_MARKS[outcome][1],
        title=_title(result, specification), facts=_facts(result, specification),
        tables=[_table(numbered, sensor) for sensor in _TITLES
                if any(verdict.axis.startswith(sensor) for verdict in verdicts)],
        findings=findings_line(result),
        sentences=[shorten(typeset(sentence)) for sentence in sentences[:_MOST_SENTENCES]],
        more=len(sentences) - _MOST_SENTENCES if len(sentences) > _MOST_SENTENCES else 0)


def _title(result: Result, specification: NoiseModel) -> str:
    name = specification.name or 'specification'
    serial = result.inspection.serial if result.inspection is not None else None
    return shorten(printable(name if serial is None else f'{name}, {serial}'), _LONGEST)


def _facts(result: Result, specification: NoiseModel) -> list[tuple[str, str]]:
    source, timeline, inspection = result.source, result.timeline, result.inspection
    rate = '' if timeline.sample_rate_hz is None else f' at {timeline.sample_rate_hz:.6g} Hz'
    facts = [('serial number', inspection.serial if inspection else None),
             ('specification', specification.name),
             ('operator', inspection.operator if inspection else None),
             ('recording', source.path), ('station', inspection.station if inspection else None),
             ('topic', source.topic), ('recorded', source.start_time),
             ('samples', f'{timeline.samples:,}{rate}, {duration(timeline.duration_s)}')]
    return [(name, shorten(printable(value), _LONGEST)) for name, value in facts
            if value is not None]


def _table(verdicts: Sequence[tuple[Verdict, int | None]], sensor: str) -> dict[str, Any]:
    own = [(verdict, number) for verdict, number in verdicts if verdict.axis.startswith(sensor)]
    axes = [axis for axis in AXES if axis.startswith(sensor)]
    return {'title': _TITLES[sensor], 'axes': [axis[-1] for axis in axes],
            'rows': [_row([each for each in own if each[0].key == key], axes)
                     for key in dict.fromkeys(verdict.key for verdict, _ in own)]}


def _row(verdicts: Sequence[tuple[Verdict, int | None]], axes: Sequence[str]) -> dict[str, Any]:
    first = verdicts[0][0]
    key = first.key
    limits = {verdict.specified for verdict, _ in verdicts}
    by_axis = {verdict.axis: (verdict, number) for verdict, number in verdicts}
    if not set(by_axis) <= set(axes):
        cells = [_cell(*verdicts[0], limit=False, wide=True)]
    else:
        cells = [_cell(*by_axis[axis], limit=len(limits) > 1) if axis in by_axis
                 else {'mark': '', 'wide': False} for axis in axes]
    name = TERMS[key].name(AXES[axes[0]]) if key in TERMS else first.symbol
    return {'name': name, 'cells': cells,
            'limit': _shown(limits.pop()) if len(limits) == 1 else 'by axis'}


def _cell(verdict: Verdict, number: int | None, *, limit: bool, wide: bool = False
          ) -> dict[str, Any]:
    value, interval, _ = figures(verdict)
    mark, style = _MARKS[verdict.verdict]
    return {'mark': mark, 'class': style, 'number': number or '',
            'verdict': verdict.verdict, 'wide': wide,
            'limit': _shown(verdict.specified) if limit else '', 'value': value,
            'interval': interval.replace(' .. ', ' – ')}


def _shown(specified: str) -> str:
    # Characters of its column of the table.
    return shorten(printable(typeset(specified)), 40)
