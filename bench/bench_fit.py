# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Processor time and memory of a fit: of one run, of many runs, and of many recordings together.

A record that is interrupted, and a recording more, must cost little beyond what its samples tell:
the figures of an hour in 150 runs stand beside those of one run, and those of many recordings
beside those of a few.

    OPENBLAS_NUM_THREADS=1 python bench/bench_fit.py [--recordings 5 20 60]
"""

import argparse
from collections.abc import Callable
from functools import partial
import resource
from statistics import median
import time

from imu_allan.noise.axis_fit import fit_axes
from imu_allan.noise.joint_fit import joint_fit
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.simulate import simulate
import numpy as np

RATE_HZ = 100.0
WHITE = {'noise_density': 1e-3}
MODELS = {'N': WHITE, 'N, B': {**WHITE, 'bias_instability': 3e-4},
          'N, B, K': {**WHITE, 'bias_instability': 3e-4, 'rate_random_walk': 2e-5}}


def estimated(terms: dict[str, float], minutes: float, axes: int, runs: int = 1, seed: int = 0
              ) -> Estimator:
    """Take in a record that is interrupted at random."""
    estimator, samples = Estimator(axes), int(60 * minutes * RATE_HZ)
    rows = np.transpose([simulate(terms, samples, RATE_HZ, seed + axis) for axis in range(axes)])
    cuts = np.random.default_rng(seed).choice(samples, runs - 1, replace=False)
    for part in np.split(rows, np.sort(cuts)):
        estimator.update(part)
        estimator.start_run()
    return estimator.finished()


def timed(fit: Callable[[], object], repeats: int, what: str) -> None:
    """Print the median of the processor time, and the most memory that was resident so far."""
    seconds = []
    for _ in range(repeats):
        begin = time.process_time()
        fit()
        seconds.append(time.process_time() - begin)
    most_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f'{what:34s} {median(seconds):6.2f} s  {most_mb:5.0f} MB', flush=True)


def main() -> None:
    """Print a line for each case."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--repeats', type=int, default=5)
    parser.add_argument('--recordings', type=int, nargs='+', default=[5, 20, 60])
    given = parser.parse_args()
    for runs in (1, 150):
        for name, terms in MODELS.items():
            timed(partial(fit_axes, estimated(terms, 60, 6, runs), 1 / RATE_HZ), given.repeats,
                  f'six axes, 1 h in {runs} runs: {name}')
    fits = [fit for seed in range(max(given.recordings)) for fit in fit_axes(
        estimated(MODELS['N, B, K'], 20, 1, seed=seed), 1 / RATE_HZ) if fit is not None]
    for count in given.recordings:
        timed(partial(joint_fit, fits[:count], 1 / RATE_HZ), 1,
              f'an axis of {count} recordings of 20 min')


if __name__ == '__main__':
    main()
