# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
A measured sensor against its datasheet.

`verdicts` decides, `measured` says what was measured of each limited quantity, `json_and_junit`
writes what programs read, `table` the terminal's table, `certificate` the page that goes
with the unit, `live` ends a check as soon as the verdict is certain.
"""

from imu_allan.writers.datasheet.certificate import certificate_html
from imu_allan.writers.datasheet.json_and_junit import to_json, to_junit
from imu_allan.writers.datasheet.table import verdict_table
from imu_allan.writers.datasheet.verdicts import check, overall, reasons, summary, Verdict

__all__ = ['Verdict', 'certificate_html', 'check', 'overall', 'reasons', 'summary', 'to_json',
           'to_junit', 'verdict_table']
