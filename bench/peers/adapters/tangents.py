# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The lines of MATLAB's example "Inertial Sensor Noise Analysis Using Allan Variance".

A line of slope -1/2, 0 and +1/2 each through the point where the curve's own slope is nearest to
it, read at 1 s, over 0.664 and at 3 s; 100 averaging times up to half the record.
"""

import numpy as np
from recorded import Answer, AXES, B, Estimate, K, log_sizes, N, overlapped, Recorded

NAME = "MATLAB's lines"
ORIGIN = "the recipe of MATLAB's example, written anew"


def answer(recording: Recorded) -> Answer:
    """Lay the three lines on each curve."""
    largest = 2 ** int(np.log2(len(recording.samples) / 2))
    tau, variances = overlapped(recording.samples, recording.rate_hz, log_sizes(largest - 1, 100))
    found = {}
    for axis, variance in zip(AXES, variances, strict=True):
        x, y = np.log10(tau), np.log10(np.sqrt(variance))
        slopes = np.diff(y) / np.diff(x)

        def read(slope: float, at_s: float, x=x, y=y, slopes=slopes) -> float:
            nearest = int(np.argmin(np.abs(slopes - slope)))
            return float(10 ** (y[nearest] + slope * (np.log10(at_s) - x[nearest])))

        found[axis] = {N: Estimate(read(-0.5, 1.0)), K: Estimate(read(0.5, 3.0)),
                       B: Estimate(read(0.0, 1.0) / np.sqrt(2 * np.log(2) / np.pi))}
    return found
