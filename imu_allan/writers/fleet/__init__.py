# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Output for a fleet: page, table and document about many units.

`outlier_sentences` describes the outliers, `figure` draws, `table` is for the terminal, and
`files` writes JSON, CSV and the `page`.
"""

from imu_allan.writers.fleet.files import save_fleet
from imu_allan.writers.fleet.outlier_sentences import Failure, Fleet
from imu_allan.writers.fleet.table import population_table

__all__ = ['Failure', 'Fleet', 'population_table', 'save_fleet']
