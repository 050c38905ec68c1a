# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What ``~/save`` leaves in the output folder."""

from collections.abc import Sequence
from pathlib import Path
import re

from imu_allan.result import Result
from imu_allan.writers.atomic import write_atomically
from imu_allan.writers.filters import export
from imu_allan.writers.result_file import save_curves, save_result


def run_folder(output_dir: str, node_name: str, result: Result) -> Path:
    """
    Name the folder of one run: another run or another node has another.

    Parameters
    ----------
    output_dir : str
        Folder of all runs; ~ is the home folder.
    node_name : str
        Name of the node with its namespace.
    result : Result
        Its start time distinguishes the runs.

    """
    start = (result.source.start_time or 'unknown').partition('.')[0].removesuffix('Z')
    name = f'{node_name.strip("/")}_{start}'
    return Path(output_dir).expanduser() / re.sub(r'[^A-Za-z0-9_-]+', '-', name.replace('/', '_'))


def save_run(result: Result, folder: Path, export_for: Sequence[str]) -> list[Path]:
    """
    Write result, curves, plot and filter configurations, each atomically.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    ImuAllanError
        If a file cannot be written, or a filter cannot be configured from this result.

    """
    # The result first: it is what cannot be made again.
    written = [folder / 'result.json', folder / 'curve.csv']
    save_result(result, written[0])
    save_curves(result, written[1])
    for consumer in export_for:
        config = export(result, consumer)
        written.append(folder / config.name)
        write_atomically(written[-1], config.text.encode())
    from imu_allan.writers.plot import overview_figure, render
    plot = folder / 'allan_deviation.png'
    write_atomically(plot, render(overview_figure(result), 'png'))
    return [*written, plot]
