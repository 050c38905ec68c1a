# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The result file, JSON with the schema ``imu_allan.result/1``, and the curves as CSV."""

from collections.abc import Iterator
import csv
import io
import json
import os
from pathlib import Path
from typing import NoReturn

from imu_allan import result as schema
from imu_allan.errors import ImuAllanError, printable, shorten
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
    # Results have a few megabytes; larger files are not read into memory.
    largest = 200_000_000
    try:
        with Path(path).open('rb') as file:
            data = file.read(largest + 1)
    except OSError as error:
        raise ImuAllanError(
            f'{path}: cannot be read ({error.strerror or error}); give the path of a result file, '
            'written by: imu_allan analyze RECORDING --json FILE') from error
    if len(data) > largest:
        raise ImuAllanError(f'{path}: too large for a result file')
    try:
        document = json.loads(data.decode(), parse_constant=_no_constant, parse_int=_whole)
    except (ValueError, RecursionError) as error:
        raise ImuAllanError(f'{path}: not JSON; give a result file, '
                            'written by: imu_allan analyze RECORDING --json FILE') from error
    result = schema.Result.from_dict(document, str(path))
    for name, axis in result.axes.items():
        for wrong, what in _contradictions(axis, name):
            if wrong:
                raise ImuAllanError(f'{path}.axes.{shorten(name)}{what}')
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


def _whole(digits: str) -> int | float:
    # Integers beyond 64 bits are neither counts nor stamps; read as floats, they are
    # range-checked.
    return int(digits) if len(digits) < 20 else float(digits)


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f'{name} is not JSON')


def _contradictions(axis: schema.AxisResult, name: str) -> Iterator[tuple[bool, str]]:
    """Yield what no estimator writes, so that writers can rely on it, and whether it is so."""
    yield name not in AXES, f': unknown axis; known are {", ".join(AXES)}'
    quantity = AXES[name]
    yield (axis.quantity != quantity.value or axis.unit != quantity.unit,
           f': expected quantity {quantity.value} in {quantity.unit}')
    yield set(axis.coefficients) != set(TERMS), f'.coefficients: expected {", ".join(TERMS)}'
    for key, coefficient in axis.coefficients.items():
        here, unit = f'.coefficients.{key}', TERMS[key].unit(quantity)
        yield coefficient.unit != unit, f'{here}.unit: expected {unit}'
        yield (coefficient.observable and None in (coefficient.value, coefficient.ci95),
               f'{here}: observable, but without value or ci95')
        yield (not coefficient.observable and coefficient.value is not None,
               f'{here}: not observable, but with a value')
    curve, spectrum, signal = axis.curve, axis.spectrum, axis.signal
    for field in ('adev', 'edf', 'ci68', 'ci95', 'model_adev'):
        yield (len(getattr(curve, field)) != len(curve.tau_s),
               f'.curve.{field}: not as long as tau_s')
    if spectrum is not None:
        bins = len(spectrum.frequency_hz)
        yield len(spectrum.psd) != bins, '.spectrum.psd: not as long as frequency_hz'
        yield (len(spectrum.passed) not in (0, bins),
               '.spectrum.passed: not as long as frequency_hz')
    yield (signal is not None and not len(signal.low) == len(signal.mean) == len(signal.high),
           '.signal: low, mean and high differ in length')
    if (model := axis.drift_model) is not None:
        yield not curve.tau_s, '.drift_model: there is no curve of it'
        yield model.from_s > model.to_s, '.drift_model.from_s: beyond to_s'
    yield (axis.power_law is not None and not 0 <= axis.power_law.exponent <= 2,
           '.power_law.exponent: expected 0 to 2')
