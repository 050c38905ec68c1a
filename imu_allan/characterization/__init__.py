# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Characterization of an IMU: from blocks of samples to a `Result`.

`Characterization` is the path of every sample, live or recorded: timeline, estimator, fit. The
findings about the noise are made here, not in the packages below.
"""

from imu_allan.characterization.axis import characterize
from imu_allan.characterization.stream import Characterization

__all__ = ['Characterization', 'characterize']
