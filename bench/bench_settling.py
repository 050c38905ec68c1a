# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What is made of means that settle, bend, turn or step in ways that no exponential describes.

Records of two hours at 10 Hz by the exact simulators, with a course of the mean whose time is
drawn. Printed are how many records report a random walk, how many say that one cannot be told, how
many name a warm-up, and the coverage of the intervals and bounds.

    python bench/bench_settling.py --runs 40         # ten minutes
"""

import argparse
from collections.abc import Callable
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

Array = NDArray[np.float64]

RATE_HZ = 10.0
TIME = np.arange(round(2 * 3600 * RATE_HZ)) / RATE_HZ
LENGTH = float(TIME[-1])
N, B, K = 'noise_density', 'bias_instability', 'rate_random_walk'
SENSORS: dict[str, dict[str, float]] = {
    'N + B': {N: 7.9e-5, B: 2.4e-5}, 'N + B + K': {N: 7.9e-5, B: 2.4e-5, K: 4.4e-6},
    'N + B + weak K': {N: 7.9e-5, B: 2.4e-5, K: 1.6e-6}}


def _still(_: np.random.Generator) -> Array:
    return np.zeros(len(TIME))


def _exponential(rng: np.random.Generator) -> Array:
    return np.asarray(np.exp(-TIME / np.exp(rng.uniform(np.log(120), np.log(1800)))))


def _linear(rng: np.random.Generator) -> Array:
    return np.maximum(1 - TIME / (rng.uniform(0.1, 0.7) * LENGTH), 0)


def _two_bodies(rng: np.random.Generator) -> Array:
    one = np.exp(rng.uniform(np.log(120), np.log(900)))
    other = one * rng.uniform(1.3, 4)
    return np.asarray((other * np.exp(-TIME / other) - one * np.exp(-TIME / one)) / (other - one))


def _two_stages(rng: np.random.Generator) -> Array:
    second, time_s = rng.uniform(0.2, 0.6) * LENGTH, rng.uniform(0.05, 0.15) * LENGTH
    return np.asarray(np.exp(-TIME / time_s)
                      + 0.5 * np.expm1(-np.maximum(TIME - second, 0) / time_s))


def _logistic(rng: np.random.Generator) -> Array:
    middle, width = rng.uniform(0.15, 0.6) * LENGTH, rng.uniform(0.03, 0.1) * LENGTH
    return np.asarray(1 / (1 + np.exp((TIME - middle) / width)))


def _turning(rng: np.random.Generator) -> Array:
    return np.asarray(np.abs(TIME - rng.uniform(0.3, 0.7) * LENGTH) / LENGTH)


def _parabola(_: np.random.Generator) -> Array:
    return np.asarray((TIME / LENGTH)**2)


def _logarithm(rng: np.random.Generator) -> Array:
    return np.asarray(-np.log1p(TIME / (rng.uniform(0.01, 0.1) * LENGTH)) / np.log1p(1 / 0.03))


def _step(rng: np.random.Generator) -> Array:
    return np.asarray(rng.uniform(0.1, 0.9) * LENGTH < TIME, np.float64)


SHAPES: dict[str, Callable[[np.random.Generator], Array]] = {
    'still': _still, 'exponential': _exponential, 'linear': _linear, 'two bodies': _two_bodies,
    'two stages': _two_stages, 'logistic': _logistic, 'turning': _turning,
    'parabola': _parabola, 'logarithm': _logarithm, 'step': _step}


def fitted(sensor: str, shape: str, size: float, seed: int) -> Fit:
    """Fit a record of which the mean moves by so many times B."""
    terms = SENSORS[sensor]
    course = size * terms[B] * SHAPES[shape](np.random.default_rng([seed, 5]))
    estimator = Estimator()
    estimator.update(simulate(terms, len(TIME), RATE_HZ, seed) + course)
    [found] = fit_axes(estimator.finished(), 1 / RATE_HZ)
    assert found is not None
    return found.fit


def row(sensor: str, shape: str, size: float, runs: int) -> str:
    """Return a line of the table."""
    found = [fitted(sensor, shape, size, seed) for seed in range(runs)]

    def covered(key: str) -> str:
        return f'{coverage(found, key, SENSORS[sensor].get(key, 0.0)):.2f}'

    walks = sum(one.estimates[K].observable for one in found)
    return (f'{sensor:15} {shape:12} {size:4g} B   K {walks}'
            f'  not told {sum(one.walk_unclear for one in found)}'
            f'  warm-up {sum(bool(one.warmings) for one in found)} of {runs}   '
            f'covered N {covered(N)} B {covered(B)} K {covered(K)}')


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--runs', type=int, default=20)
    parser.add_argument('--only', nargs='+', choices=SHAPES, default=list(SHAPES))
    parser.add_argument('--workers', type=int, default=os.cpu_count())
    options = parser.parse_args()
    cases = [('N + B', shape, size) for shape in SHAPES if shape != 'still'
             for size in ((3.0, 5.0, 7.0, 10.0) if shape == 'step' else (30.0, 300.0))]
    cases += [(sensor, shape, size) for sensor in SENSORS
              for shape, size in (('still', 0.0), ('exponential', 30.0))]
    with ProcessPoolExecutor(options.workers) as pool:
        lines = [pool.submit(row, *case, options.runs) for case in dict.fromkeys(cases)
                 if case[1] in options.only]
        for line in lines:
            print(line.result(), flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
