# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Output of the verdicts of `imu_allan.datasheet`."""

from imu_allan.writers.datasheet.certificate import certificate_html
from imu_allan.writers.datasheet.json_and_junit import to_json, to_junit
from imu_allan.writers.datasheet.reasons import reasons
from imu_allan.writers.datasheet.verdict_table import verdict_table

__all__ = ['certificate_html', 'reasons', 'to_json', 'to_junit', 'verdict_table']
