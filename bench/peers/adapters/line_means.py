# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
kalibr_allan's recipe.

Allan variance without overlap, the mean of the three axes; the mean line of slope -1/2 from the
start to the minimum, read at 1 s, that of +1/2 from the minimum to the end, read at 3 s. It takes
2000 averaging times, here 200: the lines are means over them.
"""

import numpy as np
from recorded import Answer, AXES, Estimate, K, log_sizes, N, Recorded

NAME = "kalibr_allan's lines"
ORIGIN = 'the recipe of rpng/kalibr_allan, written anew'


def answer(recording: Recorded) -> Answer:
    """Lay the two lines on the mean curve of each sensor."""
    samples = recording.samples
    sizes = log_sizes((len(samples) - 1) // 2, 200)
    phase = np.vstack([np.zeros(6), np.cumsum(samples - samples[0], axis=0)]) / recording.rate_hz
    tau = sizes / recording.rate_hz
    variances = np.array([np.mean(np.diff(phase[::m], 2, axis=0)**2, axis=0) / (2 * t * t)
                          for m, t in zip(sizes.tolist(), tau.tolist(), strict=True)])
    found = {}
    for first in (0, 3):
        deviation = np.sqrt(variances[:, first:first + 3].mean(axis=1))
        lowest = int(np.argmin(deviation))
        white = np.exp(np.mean(np.log(deviation * np.sqrt(tau))[:lowest + 1]))
        walk = np.exp(np.mean(np.log(deviation / np.sqrt(tau))[lowest:]))
        for axis in AXES[first:first + 3]:
            found[axis] = {N: Estimate(float(white)), K: Estimate(float(walk * np.sqrt(3)))}
    return found
