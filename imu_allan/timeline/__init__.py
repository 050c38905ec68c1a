# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Conversion of messages, in order of arrival, to samples on an even grid.

`TimelineStage` takes `imu_allan.block.ImuBlock` and gives `imu_allan.block.EvenBlock`: it chooses
the clock, measures the rate, finds lost, doubled and misplaced samples, and leaves out motion.
"""

from imu_allan.timeline.intake import NoAxes
from imu_allan.timeline.memory import TimelineOptions
from imu_allan.timeline.stage import TimelineStage
from imu_allan.timeline.summary import TimelineSummary

__all__ = ['NoAxes', 'TimelineOptions', 'TimelineStage', 'TimelineSummary']
