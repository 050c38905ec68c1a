# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
From blocks of samples to a `Result`.

`Characterization` is the path of every sample, live or recorded: timeline, estimator, fit. What is
found is put into words here, and nowhere below.
"""

from imu_allan.characterization.axis import characterize
from imu_allan.characterization.stream import Characterization

__all__ = ['Characterization', 'characterize']
