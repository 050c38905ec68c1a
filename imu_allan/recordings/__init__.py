# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Recordings: files that robots write, to blocks of samples in constant memory.

>>> with open_recording('my_bag') as recording:                          # doctest: +SKIP
...     for block in recording.blocks(choose_topic(recording)):
...         print(len(block))
"""

from imu_allan.recordings.open_recording import open_recording
from imu_allan.recordings.recording import choose_topic, ImuTopic, Recording

__all__ = ['ImuTopic', 'Recording', 'choose_topic', 'open_recording']
