# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What is made of a mean that moves slowly: a heater's cycle of any size, shape and period.

Records of two hours at 20 Hz by the exact simulators; the cycle has 3 to 30 periods in a record,
its size is a multiple of the bias instability B. Printed are how many records show a random walk,
a Gauss-Markov process or a low-pass, of which there is none but where the name says so, how many
name the cycle, and the coverage of the intervals.

    python bench/bench_slow_mean.py                 # ten minutes
    python bench/bench_slow_mean.py --runs 100
"""

import argparse
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
import os
import sys

from bench_accuracy import coverage
from imu_allan.noise.axis_fit import fit_axes
from imu_allan.noise.estimator import Estimator
from imu_allan.noise.fit import Fit
from imu_allan.noise.simulate import simulate
import numpy as np
from numpy.typing import NDArray
from scipy.signal import sawtooth

Array = NDArray[np.float64]

RATE_HZ, HOURS = 20.0, 2.0
N, B, K = 'noise_density', 'bias_instability', 'rate_random_walk'
SENSORS: dict[str, dict[str, float]] = {
    'N + B, B large': {N: 1e-3, B: 1e-3},
    'N + B of a consumer gyroscope': {N: 7.9e-5, B: 2.4e-5},
    'the same with a walk': {N: 7.9e-5, B: 2.4e-5, K: 4.4e-6}}
SIZES = (0, 1, 3, 10, 30, 100)


def sine(phase: Array) -> Array:
    """Return a smooth cycle of size 1 over its phase in turns."""
    return np.asarray(np.sin(2 * np.pi * phase))


def heater(phase: Array) -> Array:
    """Heat for two fifths of a turn, cool for the rest, exponentially."""
    part = phase % 1
    heated, cooled = part / 0.4, (part - 0.4) / 0.6
    return 1 - 2 * np.where(part < 0.4, np.exp(-4 * heated) - np.exp(-4), -np.expm1(-4 * cooled)
                            ) / -np.expm1(-4)


def saw(phase: Array) -> Array:
    """Rise for nine tenths of a turn and fall for one."""
    return np.asarray(sawtooth(2 * np.pi * phase, 0.9))


SHAPES: tuple[Callable[[Array], Array], ...] = (sine, heater, saw)


def fitted(terms: Mapping[str, float], shape: Callable[[Array], Array], size: float, seed: int
           ) -> Fit:
    """Fit a record with a cycle whose period and phase are drawn."""
    time = np.arange(round(HOURS * 3600 * RATE_HZ)) / RATE_HZ
    generator = np.random.default_rng(seed * 7 + 1)
    cycles = np.exp(generator.uniform(np.log(3), np.log(30)))
    phase = time / (HOURS * 3600) * cycles + generator.uniform()
    estimator = Estimator()
    estimator.update(simulate(terms, len(time), RATE_HZ, seed) + size * terms[B] * shape(phase))
    [found] = fit_axes(estimator.finished(), 1 / RATE_HZ)
    assert found is not None
    return found.fit


def row(sensor: str, shape: Callable[[Array], Array], size: float, runs: int) -> str:
    """Return a line of the table."""
    terms = SENSORS[sensor]
    found = [fitted(terms, shape, size, seed) for seed in range(runs)]

    def inside(key: str) -> float:
        return coverage(found, key, terms.get(key, 0.0))

    seen = {'K': [one.estimates[K].observable for one in found],
            'process': [one.gauss_markov is not None for one in found],
            'low-pass': [one.window_s is not None for one in found],
            'poor fit': [not one.acceptable for one in found],
            'warm-up': [bool(one.warmings) for one in found],
            'cycle': [one.cycle_s is not None for one in found]}
    return (f'{sensor:30} {shape.__name__:7} {size:3g} B   '
            + '  '.join(f'{name} {sum(which)}' for name, which in seen.items())
            + f' of {runs}   coverage N {inside(N):.2f} B {inside(B):.2f} K {inside(K):.2f}')


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--runs', type=int, default=20)
    parser.add_argument('--workers', type=int, default=os.cpu_count())
    options = parser.parse_args()
    with ProcessPoolExecutor(options.workers) as pool:
        lines = [pool.submit(row, sensor, shape, size, options.runs)
                 for sensor in SENSORS for shape in SHAPES for size in SIZES]
        for line in lines:
            print(line.result(), flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
