# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Verdicts for programs: JSON, and JUnit XML for continuous integration."""

from collections.abc import Sequence
from dataclasses import asdict
import json
from typing import Any
import xml.etree.ElementTree as ElementTree

from imu_allan.datasheet.verdicts import overall, Verdict
from imu_allan.errors import printable
from imu_allan.result import Result
from imu_allan.sensor.noise_model import NoiseModel


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
