# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The files that a characterization leaves in a folder."""

from collections.abc import Mapping, Sequence
import os
from pathlib import Path
from typing import TYPE_CHECKING

from imu_allan.result import Result
from imu_allan.writers.atomic import write_atomically
from imu_allan.writers.panels import sensors_of
from imu_allan.writers.plot import FORMATS, overview_figure, render, sensor_figure
from imu_allan.writers.result_file import save_curves, save_result

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def save_folder(result: Result, folder: str | os.PathLike[str]) -> list[Path]:
    """
    Write ``result.json``, ``curve.csv``, ``allan_deviation.png`` and ``report.html``.

    Parameters
    ----------
    result : Result
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
    # The result first: it is what cannot be made again.
    paths = [Path(folder) / 'result.json', Path(folder) / 'curve.csv']
    save_result(result, paths[0])
    save_curves(result, paths[1])
    return paths + save_report(result, folder, (), overview_formats=('png',))


def save_report(result: Result, folder: str | os.PathLike[str],
                formats: Sequence[str] = FORMATS,
                overview_formats: Sequence[str] | None = None) -> list[Path]:
    """
    Write ``report.html``, ``allan_deviation.FORMAT`` and a sheet a sensor, ``gyro.FORMAT``.

    Parameters
    ----------
    result : Result
        What to write.
    folder : path
        Made where it is missing.
    formats : sequence of 'png', 'svg', 'pdf'
        Of the plots.
    overview_formats : sequence of 'png', 'svg', 'pdf', optional
        Of the overview, where other than `formats`.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    ImuAllanError
        If a file cannot be written.

    """
    from imu_allan.writers.report import report_html

    folder = Path(folder)
    paths = [folder / 'report.html']
    write_atomically(paths[0], report_html(result).encode())
    wanted = formats if overview_formats is None else overview_formats
    if wanted:
        paths += _save_plot(overview_figure(result), folder / 'allan_deviation', wanted)
    if formats:
        for sensor in sensors_of(result):
            paths += _save_plot(sensor_figure(result, sensor), folder / sensor, formats)
    return paths


def _save_plot(figure: 'Figure', path: Path, formats: Sequence[str]) -> list[Path]:
    paths = []
    for name in formats:
        paths.append(path.with_suffix(f'.{name}'))
        write_atomically(paths[-1], render(figure, name))
    return paths


def save_comparison(results: Mapping[str, Result], folder: str | os.PathLike[str],
                    formats: Sequence[str] = FORMATS) -> list[Path]:
    """
    Write ``comparison.html`` and ``comparison.FORMAT`` of several results.

    Parameters
    ----------
    results : mapping of name to Result
        What to compare, in order.
    folder : path
        Made where it is missing.
    formats : sequence of 'png', 'svg', 'pdf'
        Of the plot.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    ImuAllanError
        If a file cannot be written.

    """
    from imu_allan.writers.comparison import comparison_figure
    from imu_allan.writers.report import comparison_html

    folder = Path(folder)
    paths = [folder / 'comparison.html']
    write_atomically(paths[0], comparison_html(results).encode())
    return paths + _save_plot(comparison_figure(results), folder / 'comparison', formats)
