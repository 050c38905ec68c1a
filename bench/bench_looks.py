# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What a node publishes of a growing record, and whether it is wrong or vanishes again.

Simulated IMUs stand still for ten minutes, all axes with the same noise, once behind a low-pass.
They are fitted as often as the node fits them. A term is wrong where it is not in the noise, or
where its interval misses the truth by a half. It vanishes where a later fit does not show it any
more; so does a finding of `shown_terms.BY_CHANCE`.

    OPENBLAS_NUM_THREADS=1 python bench/bench_looks.py         # half an hour
    ... python bench/bench_looks.py --growth 1 --probable 0.9  # by other rules
    ... python bench/bench_looks.py --at-once                  # findings after a single fit
"""

import argparse
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

from imu_allan.block import ImuBlock
from imu_allan.characterization import Characterization
from imu_allan.node import shown_terms
from imu_allan.node.fitting import FIT_GROWTH
from imu_allan.noise.simulate import simulate
from imu_allan.noise.terms import AXES
from imu_allan.result import Result
import numpy as np
from scipy.signal import butter, lfilter

RATE_HZ, PERIOD_S, DURATION_S = 100.0, 10, 600
MISSES = 1.5
"""An interval that misses by so much has misled a user."""
WHITE = {'noise_density': 1.4e-4}
FLICKER = {**WHITE, 'bias_instability': 4.8e-5}
MODELS = {'N': WHITE, 'N, B': FLICKER, 'N, B, K': {**FLICKER, 'rate_random_walk': 4.8e-6},
          'N, B, low-pass': FLICKER}


def lengths_s(growth: float) -> Iterator[int]:
    """Give the lengths at which the node fits a record, each longer by a share."""
    length = PERIOD_S
    while length <= DURATION_S:
        yield length
        length += PERIOD_S * max(1, int(np.ceil(growth * length / PERIOD_S)))


def looks(name: str, seed: int, given: argparse.Namespace) -> Iterator[Result]:
    """Give what is published of one IMU."""
    samples = np.stack([simulate(MODELS[name], int(DURATION_S * RATE_HZ), RATE_HZ, seed + axis)
                        for axis in range(len(AXES))], axis=1)
    if 'low-pass' in name:
        samples = lfilter(*butter(2, 0.4), samples, axis=0)
    stamps = 1_700_000_000 * 10**9 + np.rint(np.arange(len(samples)) / RATE_HZ * 1e9).astype(int)
    imu, published, known = (Characterization(kind='topic', topic='/imu'),
                             shown_terms.ShownTerms(), 0)
    for length in lengths_s(given.fit_growth):
        new = slice(known, int(length * RATE_HZ))
        known = new.stop
        imu.update(ImuBlock(stamps[new], stamps[new], samples[new],
                            np.zeros((new.stop - new.start, 2), bool), 'imu'))
        result = imu.result()
        seen = published.judged(result)
        yield replace(seen, warnings=result.warnings) if given.at_once else seen


def count(name: str, seed: int, given: argparse.Namespace) -> tuple[Counter[str], list[float]]:
    """Count axes and terms of one IMU by what happens to them, and give when terms are shown."""
    shown: dict[tuple[str, str], float] = {}
    terms, findings, withdrawn = MODELS[name], set(), set()
    wrong, vanished, last = set(), set(), set()
    for result in looks(name, seed, given):
        now = set()
        found = {(one.code, axis) for one in result.warnings if one.code in shown_terms.BY_CHANCE
                 for axis in one.axes or ('',)}
        withdrawn |= findings - found
        findings |= found
        for name, axis in result.axes.items():
            for key, found in axis.coefficients.items():
                if key == 'noise_density' or not found.observable or found.ci95 is None:
                    continue
                now.add((name, key))
                low, high = found.ci95
                if key not in terms or not low / MISSES <= terms[key] <= high * MISSES:
                    wrong.add((name, key))
        vanished |= last - now
        shown = {**dict.fromkeys(now, result.timeline.duration_s), **shown}
        last = now
    return Counter(runs=1, axes=len(AXES), shown=len(shown), wrong=len(wrong),
                   vanished=len(vanished), wrong_runs=bool(wrong), findings=len(findings),
                   withdrawn=len(withdrawn)), list(shown.values())


def main() -> None:
    """Print a line for each model."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--seeds', default='0:11', metavar='FIRST:END')
    parser.add_argument('--fit-growth', type=float, default=FIT_GROWTH)
    parser.add_argument('--growth', type=float, default=shown_terms.GROWTH)
    parser.add_argument('--probable', type=float, default=shown_terms.PROBABLE)
    parser.add_argument('--at-once', action='store_true', help='findings after a single fit')
    given = parser.parse_args()
    shown_terms.GROWTH, shown_terms.PROBABLE = given.growth, given.probable
    first, end = map(int, given.seeds.split(':'))
    for number, name in enumerate(MODELS):
        total: Counter[str] = Counter()
        times: list[float] = []
        for seed in range(first, end):
            counts, shown_s = count(name, 1000 * seed + 100 * number, given)
            total += counts
            times += shown_s
        print(f'{name:14s} {total["runs"]} runs, {total["axes"]} axes: {total["shown"]} slow '
              f'terms shown, {total["wrong"]} of them wrong in {total["wrong_runs"]} runs, '
              f'{total["vanished"]} vanished again; {total["findings"]} findings, '
              f'{total["withdrawn"]} withdrawn; terms shown after, in s: '
              f'{" ".join(f"{time:.0f}" for time in sorted(times)) or "never"}', flush=True)


if __name__ == '__main__':
    main()
