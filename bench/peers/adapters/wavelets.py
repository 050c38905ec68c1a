# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Non-negative weighted least squares on the Haar wavelet variance, the idea of GMWM.

The Haar wavelet variance is half the Allan variance. Scales are octaves, each weighed by the
variance that it has under the model of the step before, as if scales were independent.
"""

import numpy as np
from recorded import Answer, AXES, B, Estimate, K, N, overlapped, Recorded
from scipy.optimize import nnls

NAME = 'wavelets'
ORIGIN = 'weighted least squares after Guerrier et al., JASA 108(503), 2013; ten lines'


def answer(recording: Recorded) -> Answer:
    """Fit N, B and K to the octaves."""
    samples = recording.samples
    sizes = 2 ** np.arange(int(np.log2(len(samples) / 4)) + 1)
    tau, variances = overlapped(samples, recording.rate_hz, sizes)
    columns = np.column_stack([1 / tau, np.full(len(tau), 2 * np.log(2) / np.pi), tau / 3])
    independent = len(samples) / sizes
    found = {}
    for axis, variance in zip(AXES, variances, strict=True):
        model = variance
        for _ in range(10):
            weight = np.sqrt(independent) / np.maximum(model, 1e-300)
            solved, _ = nnls(columns * weight[:, np.newaxis], variance * weight)
            model = columns @ solved
        found[axis] = {key: Estimate(float(np.sqrt(value)) if value else None)
                       for key, value in zip((N, B, K), solved, strict=True)}
    return found
