# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Output for a fleet: page, table and document about many units.

`findings` describes the outliers, `figure` draws, and `written` produces the summary for the
terminal, the page, JSON and CSV.
"""

from imu_allan.writers.fleet.outlier_sentences import Failure, Fleet
from imu_allan.writers.fleet.written import population_table, save_fleet

__all__ = ['Failure', 'Fleet', 'population_table', 'save_fleet']
