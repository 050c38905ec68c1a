# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What the thresholds are worth that a user's number rests on: each as it is, halved and doubled.

Prints the table of docs/statistics.md, each share with its standard error. On one side stands what
must not be found because it is not there, on the other what should be found because it is.

    python bench/bench_constants.py --runs 100
    python bench/bench_constants.py --only OBSERVABLE _SIGMAS
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
import sys

from bench_accuracy import CONSUMER, drawn_cases, SPECTRAL, WALKING
from bench_settling import fitted as settling
from drawn_spectra import draw, shape_of
from imu_allan.block import ImuBlock
from imu_allan.noise.axis_fit import AxisFit, fit_axes
from imu_allan.noise.bias_step import bias_step
from imu_allan.noise.estimator import Estimator
from imu_allan.noise.fit import Fit, fit
from imu_allan.noise.signal_over_time import Signal
from imu_allan.noise.simulate import simulate
from imu_allan.noise.trends import RecordSpectrum
from imu_allan.timeline import TimelineOptions, TimelineStage
import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter

Array = NDArray[np.float64]
Measure = Callable[[int], Sequence[float]]
"""Answers of so many records: yes or no, or a ratio."""

Filter = tuple[Sequence[float], Sequence[float]]

N, B, K, R = 'noise_density', 'bias_instability', 'rate_random_walk', 'rate_ramp'

_LOW_PASS: Filter = butter(2, 20, fs=100)
_WEAK: Filter = ([0.99, 0.01], [1.0])


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
    drawn = drawn_cases()[case]
    dt, samples = 1 / drawn.rate_hz, round(drawn.rate_hz * drawn.hours * 3600)
    theta = [drawn.terms.get(key, 0.0) ** 2 for key in SPECTRAL]
    return dt, draw(shape_of(samples), theta, dt, runs, np.random.default_rng(0), drawn.courses,
                    low_pass=drawn.low_pass)


def _said(case: str, says: Callable[[Fit], bool]) -> Measure:
    """Whether a fit says something of drawn spectra."""
    def measure(runs: int) -> Sequence[float]:
        dt, spectra = _spectra(case, runs)
        return [says(fit(one.groups(), dt, None, one)) for one in spectra]
    return measure


def _seen(key: str) -> Callable[[Fit], bool]:
    return lambda found: found.estimates[key].observable


def _fitted(draw_one: Callable[[int], Array], rate_hz: float,
            asked: Callable[[AxisFit], float]) -> Measure:
    """Answers of records that are fitted from their samples on."""
    def measure(runs: int) -> Sequence[float]:
        answers = []
        for seed in range(runs):
            estimator = Estimator()
            estimator.update(draw_one(seed))
            [found] = fit_axes(estimator.finished(), 1 / rate_hz)
            assert found is not None
            answers.append(asked(found))
        return answers
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
                    144_000, 20.0, seed)


def _bent(asked: Callable[[Fit], float], *, low_pass: Filter | None = None,
          flicker_up_to_hz: float = 0.0, exponent: float = 1.0,
          process: tuple[float, float] | None = None) -> Measure:
    """Answers of an hour at 100 Hz: white noise with slow noise or a process, behind a filter."""
    @lru_cache(maxsize=1)
    def spectra(runs: int) -> list[RecordSpectrum]:
        density = CONSUMER[N]
        law = density * (2 * np.pi * flicker_up_to_hz)**(exponent / 2), exponent
        return draw(shape_of(360_000), [0.0, density**2, 0.0, 0.0], 0.01, runs,
                    np.random.default_rng(0), process=process,
                    power_law=law if flicker_up_to_hz else None, low_pass=low_pass)

    return lambda runs: [asked(fit(one.groups(), 0.01, None, one)) for one in spectra(runs)]


def _stepped(size: float, walk: float = 0.0) -> Measure:
    """Whether a step of so many B in the middle of two hours of flicker, or a walk, is told."""
    @lru_cache(maxsize=1)
    def signals(runs: int) -> list[Signal]:
        found = []
        for seed in range(runs):
            samples = simulate({**CONSUMER, K: walk}, 72_000, 10.0, seed)
            samples[36_000:] += size * CONSUMER[B]
            found.append(Signal(1))
            found[-1].absorb(samples[None, :])
        return found

    return lambda runs: [bias_step(one.columns(), 0) is not None for one in signals(runs)]


def _walks(sensor: str, shape: str, size: float) -> Measure:
    """Whether a walk is found in two hours whose mean moves by so many times B."""
    return lambda runs: [settling(sensor, shape, size, seed).estimates[K].observable
                         for seed in range(runs)]


def _unsteady(found: AxisFit) -> bool:
    return found.steadiness is not None and not found.steadiness.steady


def _off(found: Fit) -> float:
    return abs(found.estimates[N].value / CONSUMER[N] - 1)


def _widened(found: Fit) -> bool:
    return found.trial is not None and found.trial.dispersion > 1


def _is_power_law(found: Fit) -> bool:
    return found.power_law is not None


def _levels_out(found: Fit) -> bool:
    return found.plateau is not None


def _cut(disturbance: Callable[[Array], Array]) -> Measure:
    """Share of ten minutes at 100 Hz that is left out as motion."""
    def measure(runs: int) -> Sequence[float]:
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
        return cut
    return measure


def _shaken(sigmas: float) -> Callable[[Array], Array]:
    """Ring at 10 Hz for two of every ten seconds, so many standard deviations of a sample."""
    return lambda time: np.where(time % 10 < 2, sigmas * 0.01 * np.sin(20 * np.pi * time), 0.0)


def _cell(answers: Sequence[float]) -> str:
    """Write a mean in per cent with its standard error."""
    mean, error = 100 * np.mean(answers), 100 * np.std(answers) / np.sqrt(len(answers))
    return f'{mean:.2g} ± {error:.1g} %' if error else f'{mean:.3g} %'


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
        ('process of a minute, two hours',
         _fitted(_markov, 20.0, lambda found: found.fit.gauss_markov is not None))),
    '_LEAST_SPREAD': tuple(
        (f'told of noise louder by {100 * share:g} % in one half',
         _fitted(_louder(share), 100.0, _unsteady)) for share in (0.025, 0.05, 0.1)),
    'BENT_P': (
        ('band cut of flicker', _said('N + B', lambda found: found.edge_hz is not None)),
        ('N off behind a low-pass of 20 Hz', _bent(_off, low_pass=_LOW_PASS)),
        ('N off behind a mean that takes 4 % at the edge', _bent(_off, low_pass=_WEAK))),
    'SMALLEST_P': (
        ('interval widened of flicker', _said('N + B', _widened)),
        ('N off behind a low-pass of 20 Hz', _bent(_off, low_pass=_LOW_PASS)),
        ('N off behind a mean that takes 4 % at the edge', _bent(_off, low_pass=_WEAK))),
    '_OBSERVABLE_EXPONENT': (
        ('exponent of flicker behind a recursive mean',
         _bent(_is_power_law, flicker_up_to_hz=5.0, low_pass=([0.88], [1.0, -0.12]))),
        ('exponent 0.7 that crosses N at 0.1 Hz',
         _bent(_is_power_law, flicker_up_to_hz=0.1, exponent=0.7)),
        ('exponent 0.85 that crosses N at 0.1 Hz',
         _bent(_is_power_law, flicker_up_to_hz=0.1, exponent=0.85))),
    '_LEVEL_ERROR': (
        ('plateau behind a low-pass of 5 Hz', _bent(_levels_out, low_pass=butter(2, 5, fs=100))),
        ('plateau behind a mean of 8 samples', _bent(_levels_out, low_pass=([1 / 8] * 8, [1.0]))),
        *((f'white noise over noise of {time:g} s',
           _bent(_levels_out, process=(CONSUMER[N] / np.sqrt(2 * time), time)))
          for time in (0.02, 0.05, 0.1))),
    '_OUTSTANDING': (
        ('step in a walk, 2 h', _stepped(0.0, WALKING[K])),
        ('step in flicker', _stepped(0.0)),
        *((f'step of {size:g} B in flicker', _stepped(size)) for size in (3.0, 5.0, 10.0)),
        ('step of 10 B in a walk', _stepped(10.0, WALKING[K]))),
    **{name: (('K of a warm-up of 300 B in two stages', _walks('N + B', 'two stages', 300.0)),
              ('K of one of 30 B that is logistic', _walks('N + B', 'logistic', 30.0)),
              ('a true K', _walks('N + B + K', 'still', 0.0)),
              ('a true K beside a warm-up of 30 B', _walks('N + B + K', 'exponential', 30.0)))
       for name in ('_CLEAR_WALK', '_BENT_BY_CHANCE')},
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
            cells = []
            for factor in (0.5, 1.0, 2.0):
                with scaled(name, factor):
                    cells.append(_cell(measure(options.runs)))
            print(f'| `{name}` | {question} | {" | ".join(cells)} |', flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
