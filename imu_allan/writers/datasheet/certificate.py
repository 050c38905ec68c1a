# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Certificate of a unit: its verdicts on one sheet of A4."""

from collections.abc import Sequence

from imu_allan import wording
from imu_allan.datasheet.verdicts import Outcome, overall, Verdict
from imu_allan.errors import printable, shorten
from imu_allan.result import Result
from imu_allan.sensor.noise_model import NoiseModel
from imu_allan.sensor.units import typeset
from imu_allan.version import __version__
from imu_allan.writers.datasheet.reasons import figures, reasons
from imu_allan.writers.pages import rendered
from imu_allan.writers.verdict_lines import findings_line

_LONGEST = 110
"""Characters that fit on a line of the sheet."""


def certificate_html(verdicts: Sequence[Verdict], result: Result, specification: NoiseModel
                     ) -> str:
    """Return the certificate of a unit: HTML without script, for one sheet of A4."""
    outcome, (sentences, numbers) = overall(verdicts), reasons(verdicts)
    title = specification.name or 'specification'
    if result.inspection is not None and result.inspection.serial is not None:
        title = f'{title}, {result.inspection.serial}'
    # Sign and class of each.
    marks: dict[Outcome, tuple[str, str]] = {
        'pass': ('✓', 'pass'), 'fail': ('✗', 'fail'), 'cannot tell': ('?', 'undecided')}
    numbered = list(zip(verdicts, numbers, strict=True))
    # More would push the signature off the sheet; the table has all verdicts anyway.
    most = 8
    return rendered(
        'certificate.html', version=__version__, outcome=outcome, outcome_class=marks[outcome][1],
        title=shorten(printable(title), _LONGEST), facts=_facts(result, specification),
        tables={sensor: {key: [one for one in own if one[0].key == key]
                         for key in dict.fromkeys(verdict.key for verdict, _ in own)}
                for sensor in wording.SENSORS if (own := [
                    one for one in numbered if one[0].axis.startswith(sensor)])},
        marks=marks, figures=figures, shown=_shown,
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
