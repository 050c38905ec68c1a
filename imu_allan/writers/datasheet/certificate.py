# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The certificate: one sheet of A4 with every verdict on a unit, printed by the browser."""

from collections.abc import Sequence

from imu_allan import wording
from imu_allan.errors import printable, shorten
from imu_allan.result import Result
from imu_allan.sensor.noise_model import NoiseModel
from imu_allan.sensor.units import typeset
from imu_allan.version import __version__
from imu_allan.writers.datasheet.table import figures
from imu_allan.writers.datasheet.verdicts import Outcome, overall, reasons, Verdict
from imu_allan.writers.pages import filled
from imu_allan.writers.verdict import findings_line

_MARKS: dict[Outcome, tuple[str, str]] = {
    'pass': ('✓', 'pass'), 'fail': ('✗', 'fail'), 'cannot tell': ('?', 'undecided')}
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
        tables={sensor: {key: [one for one in own if one[0].key == key]
                         for key in dict.fromkeys(verdict.key for verdict, _ in own)}
                for sensor in wording.SENSORS if (own := [
                    one for one in numbered if one[0].axis.startswith(sensor)])},
        marks=_MARKS, figures=figures, shown=_shown,
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
             ('samples', f'{timeline.samples:,}{rate}, {wording.duration(timeline.duration_s)}')]
    return [(name, shorten(printable(value), _LONGEST)) for name, value in facts
            if value is not None]


def _shown(specified: str) -> str:
    # Characters of its column of the table.
    return shorten(printable(typeset(specified)), 40)
