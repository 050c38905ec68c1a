# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The charts of the report: what is drawn into the page itself.

`over_time` draws signal and parts, `allan` the Allan deviation, `spectrum` and `drift` theirs;
`chart` is what they have in common.
"""

from imu_allan.writers.charts.allan import allan_chart, comparison_chart
from imu_allan.writers.charts.chart import Chart
from imu_allan.writers.charts.drift import drift_chart
from imu_allan.writers.charts.over_time import segment_chart, signal_chart
from imu_allan.writers.charts.spectrum import density_chart

__all__ = [
           'Chart',
           'allan_chart',
           'comparison_chart',
           'density_chart',
           'drift_chart',
           'segment_chart',
           'signal_chart',
]
