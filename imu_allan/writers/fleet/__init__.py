# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
A fleet on paper: one page, one table, one document about many units.

`findings` says which are outliers, `figure` draws, `written` has the terminal's summary, the page,
JSON and CSV.
"""

from imu_allan.writers.fleet.findings import Failure, Fleet
from imu_allan.writers.fleet.written import population_table, save_fleet

__all__ = ['Failure', 'Fleet', 'population_table', 'save_fleet']
