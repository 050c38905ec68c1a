# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Comparison of a measured sensor with its datasheet.

`verdicts` decides and `measured` gives the measured value of each limited quantity. `written`
formats tables, documents and the certificate, and `live` ends a check once it is certain.
"""

from imu_allan.writers.datasheet.verdicts import check, overall, reasons, summary, Verdict
from imu_allan.writers.datasheet.written import (
    certificate_html,
    to_json,
    to_junit,
    verdict_table,
)

__all__ = ['Verdict', 'certificate_html', 'check', 'overall', 'reasons', 'summary', 'to_json',
           'to_junit', 'verdict_table']
