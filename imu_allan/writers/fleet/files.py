# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Files of a fleet: JSON, CSV and the HTML page."""

import csv
from dataclasses import asdict
import io
import json
import os
from pathlib import Path
from typing import Any

from imu_allan.finding_messages import for_display
from imu_allan.fleet.population import TOLERANCE_CONFIDENCE, TOLERANCE_SHARE
from imu_allan.noise.terms import AXES, TERMS
from imu_allan.version import __version__
from imu_allan.writers.atomic import write_files
from imu_allan.writers.fleet.outlier_sentences import Fleet
from imu_allan.writers.fleet.page import fleet_html


def save_fleet(fleet: Fleet, folder: str | os.PathLike[str]) -> list[Path]:
    """Write ``fleet.json``, ``fleet.csv`` and ``fleet.html``."""
    return write_files(folder, {
        'fleet.json': lambda: fleet_json(fleet).encode(),
        'fleet.csv': lambda: fleet_csv(fleet).encode(),
        'fleet.html': lambda: fleet_html(fleet).encode()})


def fleet_json(fleet: Fleet) -> str:
    """Return the fleet as JSON text with the schema ``imu_allan.fleet/1``, in SI units."""
    population = fleet.population
    odd = set(population.outlier_units)
    document: dict[str, Any] = {
        'schema': 'imu_allan.fleet/1', 'imu_allan_version': __version__,
        'units': [{
            'name': unit, 'serial': fleet.serial(unit),
            'path': fleet.results[unit].source.path, 'folder': fleet.folders.get(unit),
            'duration_s': fleet.results[unit].timeline.duration_s, 'odd': unit in odd,
            'reasons': fleet.reasons(unit),
            'findings': [found.code for found in for_display(
                fleet.results[unit].warnings)]} for unit in population.units],
        'traits': [{**asdict(trait), 'percentiles': {
            str(percent): value for percent, value in trait.percentiles.items()}}
            for trait in population.traits],
        'tolerance': {'share': TOLERANCE_SHARE, 'confidence': TOLERANCE_CONFIDENCE},
        'failures': [asdict(failure) for failure in fleet.failures]}
    return json.dumps(document, indent=2, allow_nan=False) + '\n'


def fleet_csv(fleet: Fleet) -> str:
    """Return the fleet as CSV text: one row per unit, all coefficients with intervals, in SI."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(['unit', 'serial', 'path', 'verdict', 'reasons', 'duration_s',
                     'sample_rate_hz', *(f'{axis}.{name}' for axis in AXES for name in (
                         'mean', *(f'{key}{part}' for key in TERMS for part in (
                             '', '.low95', '.high95', '.upper95'))))])
    for unit in fleet.population.units:
        result, reasons = fleet.results[unit], fleet.reasons(unit)
        numbers = [result.timeline.duration_s, result.timeline.sample_rate_hz]
        for name in AXES:
            axis = result.axes.get(name)
            if axis is None:
                numbers += [None] * (1 + 4 * len(TERMS))
                continue
            numbers.append(axis.mean)
            for key in TERMS:
                found = axis.coefficients[key]
                numbers += [found.value, *(found.ci95 or (None, None)), found.upper95]
        writer.writerow([_text(unit), _text(fleet.serial(unit) or ''),
                         _text(result.source.path or ''), 'odd' if reasons else 'ok',
                         '; '.join(reasons),
                         *('' if number is None else repr(number) for number in numbers)])
    for failure in fleet.failures:
        writer.writerow([_text(failure.unit), '', _text(failure.path), 'failed',
                         _text(failure.reason)])
    return text.getvalue()


def _text(text: str) -> str:
    # Spreadsheets evaluate such text as formulas, and names may come from untrusted folders.
    return f"'{text}" if text.startswith(('=', '+', '-', '@', '\t', '\r')) else text
