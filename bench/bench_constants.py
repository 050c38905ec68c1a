# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What the thresholds are worth that a user's number rests on: each as it is, halved and doubled.

Prints the table of docs/statistics.md. On one side stands what must not be found because it is not
there, on the other what should be found because it is.

    python bench/bench_constants.py --runs 100
    python bench/bench_constants.py --only OBSERVABLE _SIGMAS
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
import sys
from typing import Any

from bench_accuracy import CASES, drawn_cases, TERMS_OF_DRAWN
from drawn_spectra import draw, shape_of
from imu_allan.block import ImuBlock
from imu_allan.noise.axis_fit import AxisFit, fit_axes
from imu_allan.noise.estimator import Estimator
from imu_allan.noise.fit import Fit, fit
from imu_allan.noise.simulate import simulate
from imu_allan.noise.trends import RecordSpectrum
from imu_allan.timeline import TimelineOptions, TimelineStage
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Measure = Callable[[int], float]
"""A share, or a ratio, from so many records."""

N, B, K, R = 'noise_density', 'bias_instability', 'rate_random_walk', 'rate_ramp'


@contextmanager
def scaled(name: str, factor: float) -> Iterator[None]:
    """Multiply a constant in every module that has it under its name."""
    holders = [module for path, module in list(sys.modules.items())
               if path.startswith('imu_allan.') and name in vars(module)]
    before = [getattr(module, name) for module in holders]
    if not holders:
        raise ValueError(f'no module has a constant {name}')
    for module, value in zip(holders, before, strict=True):
        setattr(module, name, factor * value)
    try:
        yield
    finally:
        for module, value in zip(holders, before, strict=True):
            setattr(module, name, value)


@lru_cache(maxsize=4)
def _spectra(case: str, runs: int) -> tuple[float, list[RecordSpectrum]]:
    rate, hours, terms, courses = drawn_cases()[case]
    theta = [terms.get(key, 0.0) ** 2 for key in TERMS_OF_DRAWN]
    return 1 / rate, draw(shape_of(round(rate * hours * 3600)), theta, 1 / rate, runs,
                          np.random.default_rng(0), courses)


def _said(case: str, says: Callable[[Fit], bool]) -> Measure:
    """Share of drawn spectra of which a fit says something."""
    def measure(runs: int) -> float:
        dt, spectra = _spectra(case, runs)
        return float(np.mean([says(fit(one.groups(), dt, None, one)) for one in spectra]))
    return measure


def _seen(key: str) -> Callable[[Fit], bool]:
    return lambda found: found.estimates[key].observable


def _fitted(draw_one: Callable[[int], Array], rate_hz: float,
            asked: Callable[[AxisFit], float]) -> Measure:
    """Mean of an answer over records."""
    def measure(runs: int) -> float:
        answers = []
        for seed in range(runs):
            estimator = Estimator()
            estimator.update(draw_one(seed))
            [found] = fit_axes(estimator.finished(), 1 / rate_hz)
            assert found is not None
            answers.append(asked(found))
        return float(np.mean(answers))
    return measure


def _white(seed: int) -> Array:
    return np.random.default_rng(seed).standard_normal(360_000)


def _louder(share: float) -> Callable[[int], Array]:
    """White noise whose second half is louder by a share."""
    return lambda seed: _white(seed) * np.repeat([1.0, 1 + share], 180_000)


def _humming(amplitude: float) -> Callable[[int], Array]:
    """White noise with a line of so many standard deviations, between two bins."""
    line = amplitude * np.sin(2 * np.pi * 0.12345 * np.arange(360_000))
    return lambda seed: _white(seed) + line


def _markov(seed: int) -> Array:
    return simulate({N: 1e-3, 'gauss_markov': {'sigma': 1e-3, 'correlation_time_s': 60.0}},
                    72_000, 20.0, seed)


def _low_passed(seed: int) -> Array:
    return CASES['2nd order 20 Hz'].record(seed)[:360_000]


def _unsteady(found: AxisFit) -> bool:
    return found.steadiness is not None and not found.steadiness.steady


def _off(found: AxisFit) -> float:
    truth = CASES['2nd order 20 Hz'].truth(N)
    return abs(found.fit.estimates[N].value / truth - 1)


def _cut(disturbance: Callable[[Array], Array]) -> Measure:
    """Share of ten minutes at 100 Hz that is left out as motion."""
    def measure(runs: int) -> float:
        cut = []
        for seed in range(max(runs // 5, 1)):
            time = np.arange(60_000) / 100.0
            samples = np.random.default_rng(seed).normal(0, 0.01, (60_000, 6))
            samples[:, 5] += 9.81
            samples += disturbance(time)[:, None]
            stamps = 1_700_000_000_000_000_000 + np.rint(time * 1e9).astype(np.int64)
            stage = TimelineStage(TimelineOptions())
            block = ImuBlock(stamps, stamps, samples, np.zeros((60_000, 2), bool), 'imu')
            kept = sum(map(len, [*stage.push(block), *stage.flush()]))
            cut.append(1 - kept / 60_000)
        return float(np.mean(cut))
    return measure


def _shaken(sigmas: float) -> Callable[[Array], Array]:
    """Ring at 10 Hz for two of every ten seconds, so many standard deviations of a sample."""
    return lambda time: np.where(time % 10 < 2, sigmas * 0.01 * np.sin(20 * np.pi * time), 0.0)


def _share(value: float) -> str:
    return f'{100 * value:.3g} %'


CONSTANTS: dict[str, Sequence[tuple[str, Measure]]] = {
    'OBSERVABLE': (('K of flicker, an hour', _said('N + B', _seen(K))),
                   ('weak K (case A)', _said('A', _seen(K)))),
    'OBSERVABLE_RAMP': (('ramp of flicker', _said('N + B', _seen(R))),
                        ('ramp of 5 errors', _said('N + B + ramp of 5 standard errors',
                                                   _seen(R)))),
    '_WARMING': (('warm-up of a weak walk (case A)',
                  _said('A', lambda found: bool(found.warmings))),
                 ('warm-up of 10 B', _said('warm-up 10 B exp(-t/600 s)',
                                           lambda found: bool(found.warmings)))),
    '_CYCLING': (('cycle of a walk (case B)',
                  _said('B', lambda found: found.cycle_s is not None)),
                 ('cycle of 2 B, 2 h', _said('sine of 20 min, 2 B, 2 h',
                                             lambda found: found.cycle_s is not None))),
    '_OBSERVABLE_PROCESS': (
        ('process of a weak walk (case A)', _said('A', lambda one: one.gauss_markov is not None)),
        ('process of a minute, an hour',
         _fitted(_markov, 20.0, lambda found: found.fit.gauss_markov is not None))),
    '_LEAST_SPREAD': tuple(
        (f'told of noise louder by {_share(share)} in one half',
         _fitted(_louder(share), 100.0, _unsteady)) for share in (0.025, 0.05, 0.1)),
    'BENT_P': (
        ('band cut of white noise',
         _fitted(_white, 100.0, lambda found: found.fit.edge_hz is not None)),
        ('N off behind a low-pass of 20 Hz', _fitted(_low_passed, 100.0, _off))),
    'SMALLEST_P': (
        ('band cut of white noise',
         _fitted(_white, 100.0, lambda found: found.fit.edge_hz is not None)),
        ('N off behind a low-pass of 20 Hz', _fitted(_low_passed, 100.0, _off))),
    '_FALSE_ALARM': (
        ('lines of white noise', _fitted(_white, 100.0, lambda found: bool(found.lines))),
        ('line of 0.03 sigma',
         _fitted(_humming(0.03), 100.0, lambda found: bool(found.lines)))),
    '_SIGMAS': (('cut at rest', _cut(np.zeros_like)),
                *((f'cut of 20 % that ring with {size:g} sigma', _cut(_shaken(size)))
                  for size in (2, 4, 8))),
}


def main() -> int:
    """Print a row a constant and question."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--runs', type=int, default=100)
    parser.add_argument('--only', nargs='+', choices=list(CONSTANTS), default=list(CONSTANTS))
    options = parser.parse_args()
    print('| constant | what is found | halved | as it is | doubled |\n|' + ' --- |' * 5)
    for name in options.only:
        for question, measure in CONSTANTS[name]:
            cells: list[Any] = []
            for factor in (0.5, 1.0, 2.0):
                with scaled(name, factor):
                    cells.append(_share(measure(options.runs)))
            print(f'| `{name}` | {question} | {" | ".join(cells)} |', flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
