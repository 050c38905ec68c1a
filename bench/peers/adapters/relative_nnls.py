# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""allan-variance of PyPI: non-negative least squares, relative, over all five terms."""

from importlib.metadata import version

import allan_variance
from recorded import Answer, AXES, B, Estimate, K, N, Q, R, Recorded

NAME = 'allan-variance'
ORIGIN = f'PyPI allan-variance {version("allan-variance")}'
_TERMS = {Q: 'quantization', N: 'white', B: 'flicker', K: 'walk', R: 'ramp'}


def answer(recording: Recorded) -> Answer:
    """Use it as its documentation does, with its defaults."""
    tau, variance = allan_variance.compute_avar(recording.samples, 1 / recording.rate_hz)
    parameters, _ = allan_variance.estimate_parameters(tau, variance, sensor_names=list(AXES))
    return {axis: {key: Estimate(float(value) if value > 0 else None)
                   for key, name in _TERMS.items() for value in [parameters.loc[axis, name]]}
            for axis in AXES}
