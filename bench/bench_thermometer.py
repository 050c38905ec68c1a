# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What is made of a thermometer that lags, that steps, or that has nothing to do with the sensor.

Records of two hours at 4 Hz by the exact simulators, and a temperature that settles, follows a
heater, walks or swings; the thermometer is read once a second with a noise of .02 K. Printed are
how many records name a dependence on temperature, of them with a lag, the coverage of slope and
lag, how many report a random walk, and the coverage of K and B.

    python bench/bench_thermometer.py --runs 60         # 20 minutes
    python bench/bench_thermometer.py --runs 60 --only 'walking   follows it, lag  400'
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
from imu_allan.noise.temperature_course import between_steps, TemperatureCourse
import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]

RATE_HZ = 4.0
TIME = np.arange(round(2 * 3600 * RATE_HZ)) / RATE_HZ
N, B, K = 'noise_density', 'bias_instability', 'rate_random_walk'
SENSORS: dict[str, dict[str, float]] = {'N + B': {N: 1e-3, B: 3e-4},
                                        'N + B + K': {N: 1e-3, B: 3e-4, K: 3e-5}}
PER_KELVIN = 1e-3
_CELL = 16  # readings that are averaged, as `Thermometer` does for a record of this length


def _settling(rng: np.random.Generator) -> Array:
    return np.asarray(10 * -np.expm1(-TIME / rng.uniform(300, 2000))
                      + 2 * np.sin(2 * np.pi * TIME / 5000 + rng.uniform(0, 6)))


def _heated(rng: np.random.Generator) -> Array:
    turn = (TIME / rng.uniform(900, 2500) + rng.uniform()) % 1
    return 2 * np.where(turn < 0.4, 1 - 2 * np.exp(-10 * turn),
                        -1 + 2 * np.exp((0.4 - turn) / 0.15))


def _walking(rng: np.random.Generator) -> Array:
    return np.asarray(3 * np.cumsum(rng.standard_normal(len(TIME))) / np.sqrt(len(TIME)))


def _swinging(rng: np.random.Generator) -> Array:
    return np.asarray(5 * np.sin(2 * np.pi * TIME / rng.uniform(2000, 15000)
                                 + rng.uniform(0, 6)))


def _creeping(rng: np.random.Generator) -> Array:
    return np.asarray(rng.uniform() + rng.choice([-1, 1]) * rng.uniform(0.5, 1) * TIME / TIME[-1])


KINDS: dict[str, Callable[[np.random.Generator], Array]] = {
    'settling': _settling, 'heated': _heated, 'walking': _walking, 'swinging': _swinging}
Case = tuple[str, str, float, float, float]
"""Sensor, temperature, change per kelvin, lag and step of the thermometer."""
CASES: list[Case] = [(sensor, kind, *rest) for kind in KINDS for sensor, *rest in [
    *(('N + B', PER_KELVIN, lag, 0.0) for lag in (0.0, 60.0, 180.0, 400.0, -180.0)),
    ('N + B + K', PER_KELVIN, 180.0, 0.0), ('N + B', PER_KELVIN, 0.0, 0.5),
    ('N + B', PER_KELVIN, 180.0, 0.5), ('N + B', 0.0, 0.0, 0.0), ('N + B + K', 0.0, 0.0, 0.0),
    ('N + B + K', 0.0, 180.0, 0.5)]]
KINDS['creeping'] = _creeping  # a step or two, if the thermometer has steps
CASES += [(sensor, 'creeping', 0.0, 0.0, 0.5) for sensor in SENSORS]


def behind(celsius: Array, lag_s: float) -> Array:
    """Give what follows a temperature with a time constant."""
    if lag_s <= 0:
        return celsius
    share = 1 / (lag_s * RATE_HZ)
    return np.asarray(lfilter([share], [1, share - 1], celsius, zi=[(1 - share) * celsius[0]])[0])


def fitted(sensor: str, kind: str, per_kelvin: float, lag_s: float, step: float, seed: int) -> Fit:
    """Fit a record; `lag_s` is that of the thermometer, or where negative of the sensor."""
    rng = np.random.default_rng(seed)
    true = 20 + KINDS[kind](rng)
    readings = behind(true, lag_s)[::round(RATE_HZ)]
    readings = readings + 0.02 * rng.standard_normal(len(readings))
    if step:
        readings = np.round(readings / step) * step
    cells = readings[:len(readings) // _CELL * _CELL].reshape(-1, _CELL).mean(axis=1)
    time = (np.arange(len(cells)) + 0.5) * _CELL
    if step:
        cells = between_steps(time, cells, step)
    estimator = Estimator()
    estimator.update(simulate(SENSORS[sensor], len(TIME), RATE_HZ, seed)
                     + per_kelvin * behind(true, -lag_s))
    [found] = fit_axes(estimator.finished(), 1 / RATE_HZ, TemperatureCourse(time, cells))
    assert found is not None
    return found.fit


def what(case: Case) -> str:
    """Name a line of the table."""
    sensor, kind, per_kelvin, lag_s, step = case
    follows = f'follows it, lag {lag_s:4.0f} s' if per_kelvin else 'unrelated           '
    return f'{sensor:9} {kind:9} {follows} steps of {step:3g} K'


def row(case: Case, runs: int) -> str:
    """Return a line of the table."""
    sensor, kind, per_kelvin, lag_s, step = case
    found = [fitted(sensor, kind, per_kelvin, lag_s, step, seed) for seed in range(runs)]
    named = [one.temperature for one in found if one.temperature is not None]
    late = [one.lag_ci95 for one in named if one.lag_ci95 is not None]

    def inside(key: str) -> float:
        return coverage(found, key, SENSORS[sensor].get(key, 0.0))

    slope = np.mean([one.low <= per_kelvin <= one.high for one in named]) if named else np.nan
    lag = np.mean([low <= lag_s <= high for low, high in late]) if late else np.nan
    return (f'{what(case)}   named {len(named)} of {runs} '
            f'({slope:.2f} covered), lag {len(late)} ({lag:.2f})   '
            f'K {sum(one.estimates[K].observable for one in found)} '
            f'covered K {inside(K):.2f} B {inside(B):.2f}')


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--runs', type=int, default=20)
    parser.add_argument('--only', nargs='+', default=[''], metavar='PART',
                        help='lines whose name has one of these in it')
    parser.add_argument('--workers', type=int, default=os.cpu_count())
    options = parser.parse_args()
    with ProcessPoolExecutor(options.workers) as pool:
        lines = [pool.submit(row, case, options.runs) for case in CASES
                 if any(part in what(case) for part in options.only)]
        for line in lines:
            print(line.result(), flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
