# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
allantools' overlapped curve with the usual readings.

N where the curve passes 1 s, B its minimum over 0.664, K on the line of slope +1/2 through the
longest averaging time of nine clusters or more, at 3 s.
"""

import allantools
import numpy as np
from recorded import Answer, AXES, B, Estimate, K, N, Recorded

NAME = 'allantools'
ORIGIN = f'PyPI AllanTools {allantools.__version__}; read off as IEEE Std 952 does'


def answer(recording: Recorded) -> Answer:
    """Read each curve off."""
    found = {}
    for axis, samples in zip(AXES, recording.samples.T, strict=True):
        tau, deviation, _, _ = allantools.oadev(
            samples, rate=recording.rate_hz, data_type='freq', taus='octave')
        known = tau <= len(samples) / recording.rate_hz / 9
        tau, deviation = tau[known], deviation[known]
        density = np.exp(np.interp(0.0, np.log(tau), np.log(deviation)))
        flat = deviation.min() / np.sqrt(2 * np.log(2) / np.pi)
        found[axis] = {N: Estimate(float(density)), B: Estimate(float(flat)),
                       K: Estimate(float(deviation[-1] * np.sqrt(3 / tau[-1])))}
    return found
