# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The files that a fleet leaves in a folder."""

import os
from pathlib import Path

from imu_allan.writers.atomic import write_in
from imu_allan.writers.fleet.documents import fleet_csv, fleet_json
from imu_allan.writers.fleet.findings import Fleet
from imu_allan.writers.fleet.page import fleet_html
from imu_allan.writers.folder_lock import turn_in


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
