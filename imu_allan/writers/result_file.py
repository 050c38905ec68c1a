# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The result file, JSON with the schema ``imu_allan.result/1``, and the curves as CSV."""

import csv
import io
import json
import os
from pathlib import Path
from typing import NoReturn

from imu_allan import result as schema
from imu_allan.errors import brief, ImuAllanError, printable
from imu_allan.noise.terms import AXES, TERMS
from imu_allan.recordings.open_recording import holds_recording
from imu_allan.writers.atomic import write_atomically


def save_result(result: schema.Result, path: str | os.PathLike[str]) -> None:
    """Write a result as a JSON file."""
    write_atomically(path, result.to_json().encode())


def load_result(path: str | os.PathLike[str]) -> schema.Result:
    """
    Read a result file and validate it.

    Parameters
    ----------
    path : path
        The file, or a folder written by ``analyze --output`` or the node.

    Raises
    ------
    ImuAllanError
        If the file cannot be read, does not match the schema, or is inconsistent.

    """
    if Path(path).is_dir():
        return load_result(_result_in(Path(path)))
    try:
        with Path(path).open('rb') as file:
            # Results have a few megabytes; a recording may not fit into memory.
            data = file.read(200_000_000)
    except OSError as error:
        raise ImuAllanError(
            f'{path}: cannot be read ({error.strerror or error}); give the path of a result file, '
            'written by: imu_allan analyze RECORDING --json FILE') from error
    try:
        document = json.loads(data.decode(), parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        raise ImuAllanError(f'{path}: not JSON; give a result file, '
                            'written by: imu_allan analyze RECORDING --json FILE') from error
    result = schema.Result.from_dict(document, str(path))
    for name, axis in result.axes.items():
        if not _consistent(axis, name):
            raise ImuAllanError(f'{path}.axes.{brief(name)}: names, units, intervals or '
                                'lengths do not fit together; analyze the recording again')
    return result


def is_result(path: str | os.PathLike[str]) -> bool:
    """Return whether a path is a result file or a folder with one."""
    given = Path(path)
    return given.suffix == '.json' or (
        (given / 'result.json').is_file() and not holds_recording(given))


def _result_in(folder: Path) -> Path:
    """Return the path of the result file in a folder."""
    if (folder / 'result.json').exists():
        return folder / 'result.json'
    several = sorted(str(found.parent) for found in folder.glob('*/result.json'))
    if several:
        # As many as fit on a line.
        named = ', '.join([*map(printable, several[:5]), *(['...'] if len(several) > 5 else [])])
        raise ImuAllanError(f'{printable(folder)}: holds several results; name one of {named}')
    raise ImuAllanError(f'{printable(folder)}: a folder without result.json; of a recording make '
                        f'one with: imu_allan analyze {printable(folder)} --output DIR')


def curves_csv(result: schema.Result) -> str:
    """Return the curves as CSV text: a row per axis and averaging time, exact and in SI units."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(['axis', 'unit', 'tau_s', 'adev', 'ci68_low', 'ci68_high', 'ci95_low',
                     'ci95_high', 'edf', 'model_adev'])
    for name, axis in result.axes.items():
        curve = axis.curve
        for i, tau in enumerate(curve.tau_s):
            numbers = (tau, curve.adev[i], *curve.ci68[i], *curve.ci95[i], curve.edf[i],
                       curve.model_adev[i])
            writer.writerow((name, axis.unit, *(repr(float(number)) for number in numbers)))
    return text.getvalue()


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f'{name} is not JSON')


def _consistent(axis: schema.AxisResult, name: str) -> bool:
    """Return whether an axis is as every estimator writes it, so that writers can rely on it."""
    quantity = AXES.get(name)
    if quantity is None or (axis.quantity, axis.unit) != (quantity.value, quantity.unit):
        return False
    # The share that a low-pass lets pass is empty without one.
    lengths = [{len(column) for field, column in vars(table).items()
                if isinstance(column, tuple) and (column or field != 'passed')}
               for table in (axis.curve, axis.spectrum, axis.signal) if table is not None]
    model, law = axis.drift_model, axis.power_law
    return (axis.coefficients.keys() == TERMS.keys()
            and all(found.unit == TERMS[key].unit(quantity) and (
                None not in (found.value, found.ci95) if found.observable else found.value is None)
                for key, found in axis.coefficients.items())
            and all(len(own) == 1 for own in lengths)
            and (model is None or (axis.curve.tau_s != () and model.from_s <= model.to_s))
            and (law is None or 0 <= law.exponent <= 2))
