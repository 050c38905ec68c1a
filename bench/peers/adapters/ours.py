# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""imu_allan itself, by its public interface, with its defaults."""

from datetime import date

import imu_allan
from recorded import Answer, CORRECTED_S, Estimate, FILTER_K, FILTER_N, Recorded, RefusedError

NAME = 'imu_allan'
ORIGIN = f'this package, {imu_allan.__version__}, of {date.today().isoformat()}'


def answer(recording: Recorded) -> Answer:
    """Analyze the recording as the command does."""
    try:
        result = imu_allan.analyze(recording.path)
    except imu_allan.ImuAllanError as error:
        raise RefusedError(str(error)) from error
    answers = {axis: {key: Estimate(c.value, *(c.ci95 or (0.0, c.upper95)))
                      if c.ci95 or c.upper95 is not None else Estimate(c.value)
                      for key, c in found.coefficients.items()}
               for axis, found in result.axes.items()}
    for axis, found in result.axes.items():
        # What it exports for a filter, which is not what a curve shows.
        try:
            tuned = imu_allan.tune(found, aiding_interval_s=CORRECTED_S, coast_s=10 * CORRECTED_S)
        except imu_allan.ImuAllanError:
            continue
        answers[axis] |= {FILTER_N: Estimate(tuned.noise_density),
                          FILTER_K: Estimate(tuned.random_walk)}
    return answers
