# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The files of a result: all that a folder holds of it, and the result file read back.

The result file is JSON with the schema ``imu_allan.result/1``; the curves are CSV.
"""

from collections.abc import Callable, Mapping, Sequence
import csv
from functools import cache, partial
import io
import json
import os
from pathlib import Path
from typing import TYPE_CHECKING

from imu_allan.errors import brief, ImuAllanError, printable
from imu_allan.noise.terms import AXES, TERMS
from imu_allan.recordings.open_recording import holds_recording
from imu_allan.result import AxisResult, Result
from imu_allan.writers import atomic, plot
from imu_allan.writers.curves import by_sensor
from imu_allan.writers.filters import CONSUMERS, export
from imu_allan.writers.panels import SERIES

if TYPE_CHECKING:
    from matplotlib.figure import Figure


MOST_COMPARED = len(SERIES)
"""Most results drawn in separate colours; no more can be distinguished."""


def save_result(result: Result, path: str | os.PathLike[str]) -> None:
    """Write a result as a JSON file."""
    atomic.write_atomically(path, result.to_json().encode())


def load_result(path: str | os.PathLike[str]) -> Result:
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
        document = json.loads(data.decode())
    except (ValueError, RecursionError) as error:
        raise ImuAllanError(f'{path}: not JSON; give a result file, '
                            'written by: imu_allan analyze RECORDING --json FILE') from error
    result = Result.from_dict(document, str(path))
    for name, axis in result.axes.items():
        if not _consistent(axis, name):
            raise ImuAllanError(f'{path}.axes.{brief(name)}: names, units, numbers or '
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


def curves_csv(result: Result) -> str:
    """Return the curves as CSV text: a row per axis and averaging time, exact and in SI units."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(['axis', 'unit', 'tau_s', 'adev', 'ci68_low', 'ci68_high', 'ci95_low',
                     'ci95_high', 'edf', 'model_adev'])
    for name, axis in result.axes.items():
        curve = axis.curve
        for i, tau in enumerate(curve.tau_s):
            writer.writerow((name, axis.unit, tau, curve.adev[i], *curve.ci68[i], *curve.ci95[i],
                             curve.edf[i], curve.model_adev[i]))
    return text.getvalue()


def _consistent(axis: AxisResult, name: str) -> bool:
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
                and (key == 'rate_ramp' or (found.value or 0.0) >= 0)
                for key, found in axis.coefficients.items())
            and all(len(own) == 1 for own in lengths)
            and (model is None or (axis.curve.tau_s != () and model.from_s <= model.to_s))
            and (law is None or 0 <= law.exponent <= 2))


class IncompleteSave(ImuAllanError):
    """Everything is written except a filter configuration that the result does not permit."""


def save_folder(result: Result, folder: str | os.PathLike[str], exports: Sequence[str] = (),
                report: bool = True, picture: bool = True,
                drawn: Callable[[], bytes] | None = None) -> list[Path]:
    """
    Write all files about one result.

    They are ``result.json``, ``curve.csv``, the configurations of `exports`, ``report.html`` and
    ``allan_deviation.png``. Without `report` the page is omitted, which takes most of the time.
    `drawn` returns the picture if it is drawn elsewhere. On an error, the files before it in this
    list have been written. Raises IncompleteSave, after writing everything else, if a filter
    cannot be configured from this result.
    """
    folder, left_out = Path(folder), []

    def configuration(consumer: str) -> bytes | None:
        try:
            return export(result, consumer).encode()
        except ImuAllanError as error:
            left_out.append(str(error))
            return None

    # Write the result first, since it cannot be recreated.
    paths = atomic.write_files(folder, {
        'result.json': lambda: result.to_json().encode(),
        'curve.csv': lambda: curves_csv(result).encode(),
        **{CONSUMERS[consumer].file: partial(configuration, consumer) for consumer in exports},
        **(report_files(result, ()) if report else {}),
        **({'allan_deviation.png': drawn or partial(plot.overview_png, result)}
           if picture else {})})
    if left_out:
        raise IncompleteSave(f'{"; ".join(left_out)}; the other files are in {folder}')
    return paths


def report_files(result: Result, formats: Sequence[str]) -> atomic.Files:
    """Return ``report.html``, ``allan_deviation.FORMAT`` and, per sensor, ``gyro.FORMAT``."""
    from imu_allan.writers.report import report_html

    files: atomic.Files = {
        'report.html': lambda: report_html(result).encode(),
        **_plots(lambda: plot.overview_figure(result), 'allan_deviation', formats)}
    for sensor in by_sensor(result.axes):
        files |= _plots(partial(plot.sensor_figure, result, sensor), sensor, formats)
    return files


def _plots(figure: Callable[[], 'Figure'], name: str, formats: Sequence[str]) -> atomic.Files:
    drawn = cache(figure)
    return {f'{name}.{kind}': partial(lambda kind: plot.render(drawn(), kind), kind)
            for kind in formats}


def comparison_files(results: Mapping[str, Result], formats: Sequence[str]) -> atomic.Files:
    """Return ``comparison.html`` and ``comparison.FORMAT``, of many results as a population."""
    from imu_allan.writers.fleet import Fleet, fleet_html
    from imu_allan.writers.report import comparison_html

    fleet, title = Fleet(results), f'{len(results)} results compared'
    return {'comparison.html': lambda: (
                comparison_html(results) if len(results) <= MOST_COMPARED else
                fleet_html(fleet, title)).encode(),
            **_plots(lambda: plot.curves_figure(results, fleet.population, title), 'comparison',
                     formats)}
