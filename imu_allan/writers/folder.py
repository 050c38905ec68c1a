# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Writing of the files of a characterization into a folder."""

from collections.abc import Mapping, Sequence
import os
from pathlib import Path
from typing import TYPE_CHECKING

from imu_allan.errors import ImuAllanError
from imu_allan.result import Result
from imu_allan.writers import plot
from imu_allan.writers.atomic import CONFIGURATION, CURVES, PAGE, PICTURES, RESULT, write_in
from imu_allan.writers.curves import sensors_of
from imu_allan.writers.filters import CONSUMERS, existing_file_note, export
from imu_allan.writers.result_file import curves_csv

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_COMPARED = 7
"""Most results drawn in separate colours; no more can be distinguished."""


class IncompleteSave(ImuAllanError):
    """Everything is written except a filter configuration that the result does not permit."""


def kinds_of_files(exports: Sequence[str] = ()) -> dict[str, str]:
    """Return the kinds (see `imu_allan.writers.atomic`) of the files of `save_folder` by name."""
    return {'result.json': RESULT, 'curve.csv': CURVES,
            **{CONSUMERS[consumer].file: CONFIGURATION for consumer in exports},
            'report.html': PAGE, 'allan_deviation.png': PICTURES['png']}


def save_folder(result: Result, folder: str | os.PathLike[str], exports: Sequence[str] = (),
                report: bool = True, picture: bool = True) -> list[Path]:
    """
    Write all files about one result.

    They are ``result.json``, ``curve.csv``, the configurations of `exports`, ``report.html`` and
    ``allan_deviation.png``. Without `report` the page is omitted, which takes most of the time. On
    an error, the files before it in this list have been written. Raises IncompleteSave, after
    writing everything else, if a filter cannot be configured from this result.
    """
    # Write the result first, since it cannot be recreated.
    folder = Path(folder)
    paths = [write_in(folder, 'result.json', result.to_json().encode()),
             write_in(folder, 'curve.csv', curves_csv(result).encode())]
    left_out = []
    for consumer in exports:
        name = CONSUMERS[consumer].file
        try:
            text = export(result, consumer)
        except ImuAllanError as error:
            left_out.append(f'{error}{existing_file_note(folder / name)}')
        else:
            paths.append(write_in(folder, name, text.encode()))
    if report:
        paths += save_report(result, folder, ())
    if picture:
        paths.append(write_in(folder, 'allan_deviation.png',
                              plot.render(plot.overview_figure(result))))
    if left_out:
        raise IncompleteSave(f'{"; ".join(left_out)}; the other files are in {folder}')
    return paths


def save_report(result: Result, folder: str | os.PathLike[str],
                formats: Sequence[str] = plot.FORMATS) -> list[Path]:
    """Write ``report.html``, ``allan_deviation.FORMAT`` and, per sensor, ``gyro.FORMAT``."""
    from imu_allan.writers.report import report_html

    folder = Path(folder)
    paths = [write_in(folder, 'report.html', report_html(result).encode())]
    if formats:
        paths += _save_plot(plot.overview_figure(result), folder, 'allan_deviation', formats)
        for sensor in sensors_of(result):
            paths += _save_plot(plot.sensor_figure(result, sensor), folder, sensor, formats)
    return paths


def save_paper(result: Result, folder: str | os.PathLike[str], width_cm: float,
               formats: Sequence[str] = plot.FORMATS) -> list[Path]:
    """Write ``allan_deviation_WIDTHcm.FORMAT``, sized for a column of a paper."""
    figure = plot.paper_figure(result, width_cm)
    return _save_plot(figure, Path(folder), f'allan_deviation_{width_cm:g}cm', formats, dpi=300)


def save_latex(result: Result, folder: str | os.PathLike[str]) -> list[Path]:
    """Write ``imu_noise.tex`` and ``imu_noise.bib``."""
    from imu_allan.writers.latex import BIBLIOGRAPHY, noise_table

    return [write_in(folder, name, text.encode()) for name, text in (
        ('imu_noise.tex', noise_table(result)), ('imu_noise.bib', BIBLIOGRAPHY))]


def _save_plot(figure: 'Figure', folder: Path, name: str, formats: Sequence[str],
               dpi: float = 150) -> list[Path]:
    return [write_in(folder, f'{name}.{kind}', plot.render(figure, kind, dpi)) for kind in formats]


def save_comparison(results: Mapping[str, Result], folder: str | os.PathLike[str],
                    formats: Sequence[str] = plot.FORMATS) -> list[Path]:
    """Write ``comparison.html`` and ``comparison.FORMAT``, of many results as of a population."""
    from imu_allan.writers.comparison import comparison_figure
    from imu_allan.writers.report import comparison_html

    folder = Path(folder)
    if len(results) > MOST_COMPARED:
        from imu_allan.writers.fleet import Fleet
        from imu_allan.writers.fleet.figure import curves_figure
        from imu_allan.writers.fleet.written import fleet_html

        fleet = Fleet(results)
        page = fleet_html(fleet, f'{len(results)} results compared')
        return [write_in(folder, 'comparison.html', page.encode()),
                *_save_plot(curves_figure(fleet), folder, 'comparison', formats)]
    return [write_in(folder, 'comparison.html', comparison_html(results).encode()),
            *_save_plot(comparison_figure(results), folder, 'comparison', formats)]
