# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Writing of the files of a characterization into a folder."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
import os
from pathlib import Path
from typing import TYPE_CHECKING

from imu_allan.errors import ImuAllanError
from imu_allan.result import Result
from imu_allan.writers import atomic, plot
from imu_allan.writers.curves import sensors_of
from imu_allan.writers.filters import CONSUMERS, export
from imu_allan.writers.result_file import curves_csv

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_COMPARED = 7
"""Most results drawn in separate colours; no more can be distinguished."""


class IncompleteSave(ImuAllanError):
    """Everything is written except a filter configuration that the result does not permit."""


def kinds_of_files(exports: Sequence[str] = ()) -> dict[str, str]:
    """Return the kinds (see `imu_allan.writers.atomic`) of the files of `save_folder` by name."""
    return {'result.json': atomic.RESULT, 'curve.csv': atomic.CURVES,
            **{CONSUMERS[consumer].file: atomic.CONFIGURATION for consumer in exports},
            'report.html': atomic.PAGE, 'allan_deviation.png': atomic.PICTURES['png']}


def save_folder(result: Result, folder: str | os.PathLike[str], exports: Sequence[str] = (),
                report: bool = True, picture: bool = True) -> list[Path]:
    """
    Write all files about one result.

    They are ``result.json``, ``curve.csv``, the configurations of `exports`, ``report.html`` and
    ``allan_deviation.png``. Without `report` the page is omitted, which takes most of the time. On
    an error, the files before it in this list have been written. Raises IncompleteSave, after
    writing everything else, if a filter cannot be configured from this result.
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
        **(_plots(lambda: plot.overview_figure(result), 'allan_deviation', ('png',))
           if picture else {})})
    if left_out:
        raise IncompleteSave(f'{"; ".join(left_out)}; the other files are in {folder}')
    return paths


def report_files(result: Result, formats: Sequence[str] = plot.FORMATS) -> atomic.Files:
    """Return ``report.html``, ``allan_deviation.FORMAT`` and, per sensor, ``gyro.FORMAT``."""
    from imu_allan.writers.report import report_html

    files: atomic.Files = {
        'report.html': lambda: report_html(result).encode(),
        **_plots(lambda: plot.overview_figure(result), 'allan_deviation', formats)}
    for sensor in sensors_of(result):
        files |= _plots(partial(plot.sensor_figure, result, sensor), sensor, formats)
    return files


def _plots(figure: Callable[[], 'Figure'], name: str, formats: Sequence[str]) -> atomic.Files:
    drawn = cache(figure)
    return {f'{name}.{kind}': partial(lambda kind: plot.render(drawn(), kind), kind)
            for kind in formats}


def comparison_files(results: Mapping[str, Result], formats: Sequence[str] = plot.FORMATS
                     ) -> atomic.Files:
    """Return ``comparison.html`` and ``comparison.FORMAT``, of many results as a population."""
    from imu_allan.writers.fleet import Fleet, fleet_html
    from imu_allan.writers.fleet_figure import curves_figure
    from imu_allan.writers.report import comparison_html

    fleet, title = Fleet(results), f'{len(results)} results compared'
    page = (partial(comparison_html, results) if len(results) <= MOST_COMPARED else
            partial(fleet_html, fleet, title))
    return {'comparison.html': lambda: page().encode(),
            **_plots(lambda: curves_figure(results, fleet.population, title), 'comparison',
                     formats)}
