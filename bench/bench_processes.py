# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
How often a Gauss-Markov process is found, by length of the record, correlation time and amplitude.

Spectra are drawn from the model: white noise and flicker of a consumer gyroscope, and a process
whose standard deviation is a multiple of B. Beside the share of records in which it is found, and
how often the intervals hold the truth, stands the likelihood ratio that a record without chance
would give against the best sum of power laws: what no test can do without. Then records without a
process, and such with a warm-up, in which none is to be found. Last, short records, in which a
process passes for a random walk: how often it is one all the same, and is a bound as it levels
off; how often the interval of K holds the walk that it begins as, and would if it were taken for
one that goes on for ever; beside walks that do.

    python bench/bench_processes.py                        # minutes
    python bench/bench_processes.py --runs 1000 --clean    # only those without
    python bench/bench_processes.py --runs 400 --walks     # only those that pass for a walk
"""

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
import os
import sys

from drawn_spectra import draw, shape_of
from imu_allan.noise.bins import bins_of
from imu_allan.noise.correlated import process_column, with_process_column
from imu_allan.noise.doubt_of_walk import doubt_of_walk
from imu_allan.noise.fit import Fit, fit
from imu_allan.noise.groups import FLICKER, grouped, QUANTIZATION, WALK
from imu_allan.noise.intervals import estimate
from imu_allan.noise.likelihood import maximise
from imu_allan.noise.periodogram import SpectrumPiece
from imu_allan.noise.shapes import warming
import numpy as np

DEGREE = np.pi / 180
N, B, K = 0.0045 * DEGREE, 0.0014 * DEGREE, 6.5e-5 * DEGREE
STEP_S = 0.05
SENSOR = (0.0, N**2, B**2, 0.0)
TABLE = {1: ((60, (4,)),),
         3: ((60, (2,)), (100, (1, 2, 4)), (300, (4, 8))),
         6: ((100, (1, 2)), (300, (1, 2, 4))),
         12: ((100, (1,)), (300, (1, 2)), (1000, (2, 4, 8))),
         24: ((300, (1,)), (1000, (1, 2, 4))),
         72: ((1000, (1,)), (2500, (1, 2, 4)))}
CLEAN = {'N': (0.0, N**2, 0.0, 0.0), 'N+B': SENSOR, 'N+K': (0.0, N**2, 0.0, K**2),
         'N+B+K': (0.0, N**2, B**2, K**2)}
PASSING = (*((0.7, time, size) for time in (60, 130, 300) for size in (2, 3)), (3, 300, 3))
WALKS = {'case B': (1, 2.5e-4 * DEGREE), 'K of case B': (3, 2.5e-4 * DEGREE), 'case A': (3, K)}


def ratio(pieces: Sequence[SpectrumPiece], sigma: float, time_s: float) -> float:
    """Likelihood ratio of a record that is as expected in every frequency."""
    bins = bins_of([replace(piece, power=np.ones((1, piece.length)),
                            coefficients=None if piece.coefficients is None
                            else np.zeros((1, piece.length))) for piece in pieces], STEP_S)
    power = bins.design @ np.asarray(SENSOR) + sigma**2 * process_column(bins, STEP_S, time_s)
    groups = grouped(replace(bins, power=power[None]), 0)
    plain, full = (maximise(some, fixed={QUANTIZATION: 0.0}, trend='restricted') for some in
                   (groups, with_process_column(groups, False, STEP_S, time_s)))
    return 2 * (plain.loss - full.loss)


def fitted(hours: float, theta: Sequence[float], runs: int, seed: int,
           process: tuple[float, float] | None = None, warm_up: float = 0.0) -> list[Fit]:
    """Draw records and fit them as `characterize` does."""
    pieces = shape_of(round(3600 * hours / STEP_S))
    settles = warming(600.0)
    courses = [lambda time: warm_up * settles(time)] if warm_up else []
    records = draw(pieces, theta, STEP_S, runs, np.random.default_rng(seed), courses, process)
    return [fit(record.groups(), STEP_S, None, record) for record in records]


def row(hours: float, time_s: float, size: float, runs: int) -> str:
    """Return a line of the table."""
    found = [one.gauss_markov for one in
             fitted(hours, SENSOR, runs, 1, (size * B, time_s))]
    some = [one for one in found if one is not None]
    line = (f'{hours:4} h {time_s:6} s {size:3} B   found {len(some) / runs:.2f}   '
            f'ratio {ratio(shape_of(round(3600 * hours / STEP_S)), size * B, time_s):6.1f}')
    if not some:
        return line
    sigma, time = (np.mean([low <= truth <= high for low, high in intervals])
                   for truth, intervals in ((size * B, [one.sigma_ci95 for one in some]),
                                            (time_s, [one.correlation_time_ci95
                                                      for one in some])))
    median = np.median([one.correlation_time_s for one in some])
    return f'{line}   coverage sigma {sigma:.2f} Tc {time:.2f}   median Tc {median:.0f} s'


def clean(hours: float, name: str, runs: int, warm_up: float = 0.0) -> str:
    """Return how many records without a process show one."""
    found = [one.gauss_markov for one in
             fitted(hours, CLEAN[name], runs, 2, warm_up=warm_up * B)]
    return (f'{hours:4} h {name:6} {f"and a warm-up of {warm_up:g} B" if warm_up else "":24}'
            f'{sum(one is not None for one in found)} of {runs}')


def walk(name: str, hours: float, rise: float, runs: int,
         process: tuple[float, float] | None = None) -> str:
    """Return how often the interval of a random walk holds, with doubt about it and without."""
    theta = SENSOR if process else (0.0, N**2, B**2, rise**2)
    fits = fitted(hours, theta, runs, 3, process)
    found = [(one, one.estimates['rate_random_walk'], estimate(one.trial, WALK)) for one in fits]
    seen = [(doubted, plain) for _, doubted, plain in found if doubted.observable]
    off = [one.walk_unclear and doubt_of_walk(one.trial, STEP_S, plain).is_likelier
           for one, _, plain in found]
    line = f'{hours:4} h {name:16} K in {len(seen) / runs:.2f}, levels off in {np.mean(off):.2f}'
    if not seen:
        return line
    shares = [np.mean([one.low <= rise <= one.high for one in some]) for some in
              zip(*seen, strict=True)]
    doubted, sure = (f'{share:.3f} +- {np.sqrt(share * (1 - share) / len(seen)):.3f}'
                     for share in shares)
    wider = np.median([one.high / other.high for one, other in seen])
    flicker = [one.estimates['bias_instability'] for one, walk, _ in found if walk.observable]
    sure_of_it = [estimate(one.trial, FLICKER) for one, walk, _ in found if walk.observable]
    above, without = (sum(one.observable and one.low > B for one in some)
                      for some in (flicker, sure_of_it))
    return (f'{line}   holds {doubted}, without doubt {sure}   upper end {wider:.2f} times as high'
            f'   B of {len(seen)} too large in {above}, without doubt {without}, '
            f'a bound in {sum(not one.observable for one in flicker)}')


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--runs', type=int, default=100)
    parser.add_argument('--clean', action='store_true', help='only records without a process')
    parser.add_argument('--walks', action='store_true', help='only what passes for a walk')
    parser.add_argument('--workers', type=int, default=os.cpu_count())
    options = parser.parse_args()
    with ProcessPoolExecutor(options.workers) as pool:
        lines = [] if options.clean or options.walks else [
            pool.submit(row, hours, time, size, options.runs)
            for hours, times in TABLE.items() for time, sizes in times for size in sizes]
        if not options.walks:
            lines += [pool.submit(clean, hours, name, options.runs)
                      for hours in (1, 3, 12) for name in CLEAN]
            lines += [pool.submit(clean, 2, name, options.runs, size)
                      for name in ('N+B', 'N+B+K') for size in (10, 100)]
        if not options.clean:
            lines += [pool.submit(walk, f'{time} s of {size} B', hours,
                                  size * B * np.sqrt(2 / time), options.runs, (size * B, time))
                      for hours, time, size in PASSING]
            lines += [pool.submit(walk, name, hours, size, options.runs)
                      for name, (hours, size) in WALKS.items()]
        for line in lines:
            print(line.result(), flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
