# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
A fleet on paper: one page, one table, one document about many units.

`findings` says which are outliers, `figure` draws, `page` is the HTML, `table` the terminal's
summary, `folder` writes the page, JSON and CSV.
"""

from imu_allan.writers.fleet.findings import Failure, Fleet
from imu_allan.writers.fleet.folder import save_fleet
from imu_allan.writers.fleet.table import population_table

__all__ = ['Failure', 'Fleet', 'population_table', 'save_fleet']
