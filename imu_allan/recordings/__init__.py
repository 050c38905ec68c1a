# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Reading of recorded files as blocks of IMU samples, in constant memory.

>>> with open_recording('my_bag') as recording:                          # doctest: +SKIP
...     for block in read_blocks(recording, choose_topic(recording)):
...         print(len(block))
"""

from imu_allan.recordings.choose_streams import choose_topic
from imu_allan.recordings.open_recording import open_recording, recordings_in
from imu_allan.recordings.options import RecordingOptions
from imu_allan.recordings.reading import read_blocks
from imu_allan.recordings.recording import ImuTopic, Recording

__all__ = [
    'ImuTopic', 'Recording', 'RecordingOptions', 'choose_topic', 'open_recording', 'read_blocks',
    'recordings_in']
