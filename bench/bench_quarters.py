# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether the intervals hold on a real sensor: parts of one recording held against each other.

Every recording below IMU_ALLAN_DATA is cut into quarters, each characterized as a recording of its
own; where intervals are honest, the chi-square of a coefficient between quarters is one per degree
of freedom. The whole is held against its halves: it contradicts both where its value lies outside
either interval.

    python bench/bench_quarters.py            # a minute
"""

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
import os
import sys

from bench_filter import of_recording, recordings
from imu_allan.characterization.axis import characterize
from imu_allan.noise.terms import AXES
from imu_allan.result import AxisResult, Coefficient
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

KEYS = ('noise_density', 'bias_instability', 'rate_random_walk')
Parts = tuple[AxisResult, list[AxisResult], list[AxisResult]]


def fitted(samples: Array, rate_hz: float, quantity: str, quarters: int) -> Parts:
    """Characterize a whole record, its halves, and its quarters."""
    def some(count: int) -> list[AxisResult]:
        return [characterize(part, rate_hz, quantity)
                for part in np.array_split(samples, count)]

    return characterize(samples, rate_hz, quantity), some(2), some(quarters)


def chi_square(found: Sequence[Coefficient]) -> tuple[float, int]:
    """Return chi-square and degrees of freedom of the values that there are."""
    seen = [(c.value, c.ci95) for c in found if c.value is not None and c.ci95 is not None]
    if len(seen) < 2:
        return 0.0, 0
    value = np.array([one for one, _ in seen])
    low, high = np.array([interval for _, interval in seen]).T
    mean = float(np.average(value, weights=(high - low)**-2.0))
    for _ in range(20):
        # An interval is not symmetric: what counts is its side towards the mean.
        error = np.where(value > mean, value - low, high - value) / 1.96
        mean = float(np.average(value, weights=error**-2.0))
    return float((((value - mean) / error)**2).sum()), len(value) - 1


def contradicts(whole: Coefficient, halves: Sequence[Coefficient]) -> bool:
    """Whether a value lies outside the intervals of both halves, or above their bounds."""
    if whole.value is None:
        return False
    return all(not half.ci95[0] <= whole.value <= half.ci95[1] if half.ci95 is not None
               else half.upper95 is not None and whole.value > half.upper95 for half in halves)


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--quarters', type=int, default=4, help='into how many parts')
    parser.add_argument('--workers', type=int, default=os.cpu_count())
    options = parser.parse_args()
    sums: dict[tuple[str, str], list[float]] = {}
    against: list[bool] = []
    with ProcessPoolExecutor(options.workers) as pool:
        for path in recordings():
            axes, rate_hz = of_recording(path)
            work = {name: pool.submit(fitted, samples, rate_hz, AXES[name].value,
                                      options.quarters) for name, samples in axes.items()}
            for name, future in work.items():
                whole, halves, quarters = future.result()
                for key in KEYS:
                    parts = [one.coefficients[key] for one in quarters]
                    chi, dof = chi_square(parts)
                    total = sums.setdefault((name.partition('_')[0], key), [0.0, 0])
                    total[0], total[1] = total[0] + chi, total[1] + dof
                    mine = whole.coefficients[key]
                    if mine.value is not None:
                        against.append(contradicts(mine, [h.coefficients[key] for h in halves]))
                    values = ' '.join(f'{c.value:9.3g}' if c.value is not None
                                      else f'<{c.upper95 or np.nan:8.3g}' for c in parts)
                    shown = f'{mine.value:.3g}' if mine.value is not None \
                        else f'< {mine.upper95 or np.nan:.3g}'
                    print(f'{path.name:16} {name:8} {mine.symbol} {values}   {chi:5.1f} / {dof}'
                          f'   whole {shown}', flush=True)
    for (sensor, key), (total_chi, total_dof) in sums.items():
        print(f'{sensor:6} {key:18} chi2/dof {total_chi / max(total_dof, 1):.2f}   '
              f'({total_dof:.0f} dof)')
    if against:
        print(f'the whole contradicts both halves: {np.mean(against):.3f} of {len(against)}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
