# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Everything a person wants to keep of a result, in one folder."""

import os
from pathlib import Path

from imu_allan.result import Result
from imu_allan.writers.atomic import write_atomically
from imu_allan.writers.plot import overview_figure, render
from imu_allan.writers.result_file import save_curves, save_result


def save_folder(result: Result, folder: str | os.PathLike[str]) -> list[Path]:
    """
    Write result file, curves, plot and report, each atomically.

    Parameters
    ----------
    result : Result
        What to write.
    folder : path-like
        Where to; it is made if it is missing, and files of an earlier result are replaced.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    ImuAllanError
        If a file cannot be written.

    """
    folder = Path(folder)
    result_file, curves, plot = (folder / name for name in (
        'result.json', 'curve.csv', 'allan_deviation.png'))
    # The result first: it is what cannot be made again without the samples.
    save_result(result, result_file)
    save_curves(result, curves)
    write_atomically(plot, render(overview_figure(result), 'png'))
    return [result_file, curves, plot]
