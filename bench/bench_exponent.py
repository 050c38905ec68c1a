# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Monte Carlo of slow noise that goes with f^-a: what becomes of N, and what passes for it.

Spectra of an hour at 100 Hz are drawn from the model. First white noise beside f^-a that crosses
it at a frequency; then noise that is something else, behind low-passes among others, of which the
share is told that an exponent is found in, that it levels out again above the band, or that a
filter has taken out its slow part.

    python bench/bench_exponent.py --runs 100
    python bench/bench_exponent.py --runs 40 --exponents 1.3
"""

import argparse
from collections.abc import Iterable, Sequence
import sys

from bench_accuracy import B, CONSUMER, coverage, K, N
from drawn_spectra import draw, shape_of
from imu_allan.noise.fit import Fit, fit
from imu_allan.noise.high_pass import high_pass_beside_flicker
from imu_allan.noise.trends import RecordSpectrum
import numpy as np
from scipy.signal import butter

DT = 0.01
HOUR = 360_000
EXPONENTS = (0.5, 0.7, 0.85, 1.15, 1.3, 1.6)
CROSSINGS_HZ = (0.1, 1.0, 5.0, 20.0)
LOW_PASSES = {
    '1st order 40 Hz': butter(1, 40, fs=100), '1st order 20 Hz': butter(1, 20, fs=100),
    '2nd order 20 Hz': butter(2, 20, fs=100), '2nd order 5 Hz': butter(2, 5, fs=100),
    '4th order 10 Hz': butter(4, 10, fs=100), 'boxcar 2': ([0.5, 0.5], [1.0]),
    'boxcar 8': ([1 / 8] * 8, [1.0]), '4 % off at the edge': ([0.99, 0.01], [1.0]),
}
TERMS = {'N': (N,), 'N + B': (N, B), 'N + B + K': (N, B, K)}
PROCESSES = {'3 B over 5 s': (3, 5.0), '10 B over 2 s': (10, 2.0), '3 B over 30 s': (3, 30.0),
             '3 B over 100 s': (3, 100.0)}


def fitted(spectra: Sequence[RecordSpectrum]) -> list[Fit]:
    """Fit every spectrum."""
    return [fit(one.groups(), DT, None, one) for one in spectra]


def told(found: Sequence[Fit]) -> float:
    """Share of the fits with an exponent."""
    return float(np.mean([one.power_law is not None for one in found]))


def show(name: str, spectra: Iterable[RecordSpectrum]) -> None:
    """Print what is told of noise that is something else."""
    spectra = list(spectra)
    found = fitted(spectra)
    levels = np.mean([one.plateau is not None for one in found])
    behind = [high_pass_beside_flicker(one.groups(), DT, own)
              for one, own in zip(spectra, found, strict=True)]
    falls = np.mean([one is not None and one.certain for one in behind])
    print(f'| {name} | {told(found):.3f} | {levels:.3f} | {falls:.3f} |', flush=True)


def squares(*keys: str) -> list[float]:
    """Squared coefficients of a sensor that has these terms."""
    return [0.0, *(CONSUMER[key]**2 if key in keys else 0.0 for key in (N, B, K))]


def main() -> int:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--runs', type=int, default=100)
    parser.add_argument('--exponents', type=float, nargs='*', default=EXPONENTS)
    options = parser.parse_args()
    runs = options.runs
    pieces, density = shape_of(HOUR), CONSUMER[N]
    print('| exponent | crosses N at | told | its interval holds | N off, rms | N holds | K |\n|'
          + ' --- |' * 7)
    for exponent in options.exponents:
        for crossing_hz in CROSSINGS_HZ:
            law = density * (2 * np.pi * crossing_hz)**(exponent / 2), exponent
            rng = np.random.default_rng([round(100 * exponent), round(10 * crossing_hz)])
            found = fitted(draw(pieces, squares(N), DT, runs, rng, power_law=law))
            whites = [one.estimates[N] for one in found]
            off = np.sqrt(np.mean([(one.value / density - 1)**2 for one in whites]))
            laws = [one.power_law.ci95 for one in found if one.power_law is not None]
            inside = [low <= exponent <= high for low, high in laws]
            walks = np.mean([one.estimates[K].observable for one in found])
            print(f'| {exponent} | {crossing_hz:g} Hz | {told(found):.2f} '
                  f'| {np.mean(inside) if inside else np.nan:.2f} | {100 * off:.2f} % '
                  f'| {coverage(found, N, density):.2f} | {walks:.2f} |', flush=True)
    print('\n| something else | an exponent told | a plateau told | a high-pass told |\n|'
          + ' --- |' * 4)
    rng = np.random.default_rng(1)
    for name, keys in TERMS.items():
        show(name, draw(pieces, squares(*keys), DT, runs, rng))
    for exponent in options.exponents:
        law = density * (2 * np.pi * 0.02)**(exponent / 2), exponent
        show(f'f^-{exponent:g} that crosses N at 0.02 Hz', draw(
            pieces, squares(N), DT, runs, rng, power_law=law))
    for name, low_pass in LOW_PASSES.items():
        show(name, draw(pieces, squares(N, B, K), DT, runs, rng, low_pass=low_pass))
    for share, crossing_hz in ((0.26, 0.7), (0.2, 2.0), (0.12, 5.0)):
        strong = [0.0, density**2, 2 * np.pi * crossing_hz * density**2, 0.0]
        show(f'recursive mean of {share}, flicker up to {crossing_hz} Hz', draw(
            pieces, strong, DT, runs, rng, low_pass=([1 - share], [1.0, -share])))
    for name, (size, time) in PROCESSES.items():
        show(f'process of {name}', draw(
            pieces, squares(N, B), DT, runs, rng, process=(size * CONSUMER[B], time)))
    for time in (0.05, 0.1):
        # At the slow end it is as strong as the white noise.
        show(f'white noise, and as much over {time:g} s', draw(
            pieces, squares(N), DT, runs, rng, process=(density / np.sqrt(2 * time), time)))
    return 0


if __name__ == '__main__':
    sys.exit(main())
