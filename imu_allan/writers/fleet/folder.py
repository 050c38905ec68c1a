# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The files that a fleet leaves in a folder."""

from collections.abc import Iterator
import csv
from dataclasses import asdict
import io
import json
import os
from pathlib import Path
from typing import Any

from imu_allan.fleet.population import TOLERANCE_CONFIDENCE, TOLERANCE_SHARE
from imu_allan.noise.terms import AXES, TERMS
from imu_allan.version import __version__
from imu_allan.writers.atomic import write_in
from imu_allan.writers.fleet.findings import Fleet
from imu_allan.writers.fleet.page import fleet_html
from imu_allan.writers.folder_lock import turn_in
from imu_allan.writers.words import presented


def save_fleet(fleet: Fleet, folder: str | os.PathLike[str]) -> list[Path]:
    """
    Write ``fleet.json``, ``fleet.csv`` and ``fleet.html``.

    Parameters
    ----------
    fleet : Fleet
        What to write.
    folder : path
        Made where it is missing.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    ImuAllanError
        If a file cannot be written.

    """
    with turn_in(folder):
        return [write_in(folder, name, writer(fleet).encode()) for name, writer in (
            ('fleet.json', fleet_json), ('fleet.csv', fleet_csv), ('fleet.html', fleet_html))]


SCHEMA = 'imu_allan.fleet/1'


def fleet_json(fleet: Fleet) -> str:
    """
    Return the fleet as JSON text of the schema ``imu_allan.fleet/1``.

    Units in natural order with verdict and reasons, the traits of the population in SI units, and
    the recordings of which nothing came.
    """
    population = fleet.population
    odd = set(population.odd_units)
    document: dict[str, Any] = {
        'schema': SCHEMA, 'imu_allan_version': __version__,
        'units': [{
            'name': unit, 'serial': fleet.serial(unit),
            'path': fleet.results[unit].source.path, 'folder': fleet.folders.get(unit),
            'duration_s': fleet.results[unit].timeline.duration_s, 'odd': unit in odd,
            'reasons': fleet.reasons(unit),
            'findings': [found.code for found in presented(
                fleet.results[unit].warnings)]} for unit in population.units],
        'traits': [{**asdict(trait), 'percentiles': {
            str(percent): value for percent, value in trait.percentiles.items()}}
            for trait in population.traits],
        'tolerance': {'share': TOLERANCE_SHARE, 'confidence': TOLERANCE_CONFIDENCE},
        'failures': [asdict(failure) for failure in fleet.failures]}
    return json.dumps(document, indent=2, allow_nan=False) + '\n'


def fleet_csv(fleet: Fleet) -> str:
    """Return the fleet as CSV text: a row a unit, every coefficient with its interval, SI."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(['unit', 'serial', 'path', 'verdict', 'reasons', 'duration_s',
                     'sample_rate_hz', *(f'{axis}.{name}' for axis in AXES for name in (
                         'mean', *(f'{key}{part}' for key in TERMS for part in (
                             '', '.low95', '.high95', '.upper95'))))])
    for unit in fleet.population.units:
        writer.writerow(list(_row(fleet, unit)))
    for failure in fleet.failures:
        writer.writerow([_text(failure.unit), '', _text(failure.path), 'failed',
                         _text(failure.reason)])
    return text.getvalue()


def _row(fleet: Fleet, unit: str) -> Iterator[str]:
    result = fleet.results[unit]
    reasons = fleet.reasons(unit)
    yield from (_text(unit), _text(fleet.serial(unit) or ''), _text(result.source.path or ''),
                'odd' if reasons else 'ok', '; '.join(reasons))
    yield _number(result.timeline.duration_s)
    yield _number(result.timeline.sample_rate_hz)
    for name in AXES:
        axis = result.axes.get(name)
        yield _number(None if axis is None else axis.mean)
        for key in TERMS:
            found = None if axis is None else axis.coefficients[key]
            if found is None:
                yield from ('', '', '', '')
                continue
            low, high = found.ci95 or (None, None)
            yield from map(_number, (found.value, low, high, found.upper95))


def _number(value: float | None) -> str:
    return '' if value is None else repr(value)


def _text(text: str) -> str:
    # A spreadsheet takes what begins so for a formula, and names come from folders of strangers.
    return f"'{text}" if text.startswith(('=', '+', '-', '@', '\t', '\r')) else text
