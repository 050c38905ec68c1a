# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
How well any method can tell a random walk from drift of the mean, and how well the fit does.

Records of N, B and K (case A or B of the battery) are compared with records of N and B whose mean
drifts. No test is better than a likelihood ratio (Neyman and Pearson). Three are tried:

- oracle: everything is known except the time of the drift and its sign
- one kind: B, K, and the size and shape of the drift are unknown, within the ranges below
- any kind: the kind of drift is unknown as well, each being as likely as none

Each has two figures: false random walks when 0.92 of the true ones are reported, and true ones
when 0.02 are reported falsely. The likelihood is exact for 360 means of a record, without their
own mean and slope. Drift begins at multiples of 1/180 of the record.

    PYTHONPATH=bench:. python bench/bench_walk_or_drift.py --records 300 --fits 100
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace

from battery.cases import CONSUMER, FLICKER, HOUR, STILL, WALKING
from battery.sensors import Array, K, N, Sensor, Trend
from imu_allan.noise.axis_fit import fit_axes
from imu_allan.noise.record.estimator import Estimator
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

Index = NDArray[np.int64]
CELLS, PLACES, REPORTED, FALSE = 360, 180, 0.92, 0.02
CASES = {'A': Sensor(100, 3 * HOUR, CONSUMER), 'B': Sensor(200, HOUR, WALKING)}
LEVELS, WALKS = np.geomspace(0.5, 2, 5), np.geomspace(10**-0.5, 10**0.5, 7)
"""Equally likely B and K, relative to the true ones, where they are unknown."""
SIZES = np.geomspace(2, 20, 4)    # likewise, standard deviations of the size of a drift, in B


def drifts(duration_s: float) -> dict[str, list[Trend]]:
    """Return the equally likely drifts of each kind, in units of B; the sign is as likely."""
    def steps(up: float, down: float = np.inf) -> Trend:
        return lambda time: 5.0 * (time > up) - 7.5 * (time > down)

    def bump(at: float) -> Trend:
        return lambda time: np.asarray(10 * np.exp(-((time - at) / 300)**2 / 2))

    def cycle(phase: float) -> Trend:
        return lambda time: np.asarray(2 * np.sin(np.pi * (time / 600 + phase)))

    places = duration_s * (np.arange(PLACES) + 0.5) / PLACES
    return {'none': [np.zeros_like], 'step of 5 B': [steps(at) for at in places],
            'two steps of 5 B': [steps(up, down) for up in places for down in places],
            'bump of 10 B': [bump(at) for at in places],
            'cycle of 2 B': [cycle(phase) for phase in np.arange(48) / 24],
            'settling of 10 B': [lambda time: np.asarray(10 * np.exp(-time / 600))]}


def parts(span: float) -> dict[str, tuple[Array, Index, Index]]:
    """Return columns of drifts of any shape, and which two of them may occur together."""
    time = span * (np.arange(CELLS) + 0.5) / CELLS
    at = span * (np.arange(PLACES)[:, None] + 0.5) / PLACES
    steps = 1.0 * (time > at)
    bumps = np.concatenate([np.exp(-((time - at) / (span * width))**2 / 2)
                            for width in np.geomspace(1 / 60, 1 / 6, 5)])
    waves = np.exp(2j * np.pi * np.arange(1.5, 16.1, 0.25)[:, None] * time / span)
    settling = np.exp(-time / (span * np.geomspace(0.01, 2, 15))[:, None])
    alone = {'step of 5 B': steps, 'bump of 10 B': bumps, 'settling of 10 B': settling}
    index = np.arange(len(waves))
    # The second column of a drift with one column is zero.
    return {**{kind: (np.pad(own, ((0, 1), (0, 0))), np.arange(len(own)), np.full(len(own), -1))
               for kind, own in alone.items()},
            'two steps of 5 B': (steps, *np.triu_indices(PLACES, 1)),
            'cycle of 2 B': (np.concatenate((waves.real, waves.imag)), index, index + len(waves))}


def mean_of(logs: Array) -> Array:
    """Return the log of the mean over the last axis."""
    return np.asarray(np.logaddexp.reduce(logs, axis=-1) - np.log(logs.shape[-1]))


def covariances(duration_s: float) -> tuple[Array, Array, Array]:
    """Return those of the cells for N, for B and for K of 1, in units of B."""
    cell_s, lag = duration_s / CELLS, np.arange(CELLS + 1.0)
    lag = np.abs(lag - lag[:, None])
    # The mean of flicker has no variance, so that only differences of this are covariances.
    phase = lag**2 * np.log(np.maximum(lag, 1)) / (2 * np.pi)
    index = np.arange(CELLS)
    return (STILL[N]**2 / FLICKER**2 / cell_s * np.eye(CELLS),
            phase[1:, 1:] + phase[:-1, :-1] - phase[1:, :-1] - phase[:-1, 1:],
            cell_s * (np.minimum(index, index[:, None]) + 0.5 - np.eye(CELLS) / 6))


class Noise:
    """Likelihood of cells, in units of B, under Gaussian noise with a free mean and slope."""

    def __init__(self, covariance: Array) -> None:
        line = np.column_stack((np.ones(CELLS), np.arange(CELLS)))
        self._contrasts = np.linalg.qr(line, 'complete')[0][:, 2:]
        self._root = np.linalg.cholesky(self._contrasts.T @ covariance @ self._contrasts)

    def whitened(self, cells: Array) -> Array:
        """Return independent values of unit variance, shape (records, CELLS - 2)."""
        return np.asarray(solve_triangular(self._root, (cells @ self._contrasts).T, lower=True).T)

    def log_likelihood(self, cells: Array) -> Array:
        """Return the log likelihood of each record."""
        square = (self.whitened(cells)**2).sum(axis=1) / 2
        return np.asarray(-np.log(np.diag(self._root)).sum() - square)

    def with_one_of(self, means: Array, cells: Array) -> Array:
        """Return the log likelihood if one of some means is added, with either sign."""
        white = self.whitened(means)
        along, half = self.whitened(cells) @ white.T, (white**2).sum(axis=1) / 2
        return self.log_likelihood(cells) + mean_of(
            np.logaddexp(along, -along) - half - np.log(2))

    def with_any(self, columns: Array, first: Index, second: Index, cells: Array) -> Array:
        """Return the same if the mean is made of one of some pairs of columns."""
        white = self.whitened(columns)
        gram, added, each = white @ white.T, [], SIZES[:, None]**2
        a, b = gram[first, first] + 1 / each, gram[second, second] + 1 / each
        both, determinant = gram[first, second], a * b - gram[first, second]**2
        for along in self.whitened(cells) @ white.T:
            one, two = along[first], along[second]
            square = (b * one**2 + a * two**2 - 2 * both * one * two) / determinant
            added.append(mean_of((square - np.log(determinant * each**2)).ravel() / 2))
        return self.log_likelihood(cells) + np.array(added)


def ratios(case: Sensor, cells: Array, kinds: dict[str, Array]) -> dict[str, Array]:
    """Return log likelihood ratios by kind of drift: oracle, one kind, any kind."""
    (white, flicker, walk), size = covariances(case.duration_s), (case.terms[K] / FLICKER)**2
    known = Noise(white + flicker + size * walk).log_likelihood(cells)
    free = mean_of(np.array([
        Noise(white + level**2 * flicker + relative**2 * size * walk).log_likelihood(cells)
        for level in LEVELS for relative in WALKS]).T)
    levels = [Noise(white + level**2 * flicker) for level in LEVELS]
    against = {'none': mean_of(np.array([each.log_likelihood(cells) for each in levels]).T)}
    for kind, pairs in parts(case.duration_s).items():
        against[kind] = mean_of(np.array([each.with_any(*pairs, cells) for each in levels]).T)
    any_kind = free - mean_of(np.array(list(against.values())).T)
    return {kind: np.array([known - Noise(white + flicker).with_one_of(means, cells),
                            free - against[kind], any_kind]) for kind, means in kinds.items()}


def fitted(sensor: Sensor, means: list[Trend], seeds: Sequence[list[int]]) -> str:
    """Return the share of records in which the fit reports a random walk."""
    found = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        sign, mean = rng.choice([-1, 1]), means[rng.integers(len(means))]
        estimator, time = Estimator(1), np.arange(0.5, sensor.samples) / sensor.rate_hz
        estimator.update(np.asarray(sensor.record(rng) + sign * FLICKER * mean(time)))
        [axis] = fit_axes(estimator.finished(), 1 / sensor.rate_hz)
        found.append(axis is not None and axis.fit.estimates['rate_random_walk'].observable)
    return share(np.array(found)) if found else '-'


def share(found: NDArray[np.bool_]) -> str:
    """Return a share with its standard error."""
    value = float(found.mean())
    return f'{value:.2f} +- {np.sqrt(value * (1 - value) / len(found)):.2f}'


def main() -> None:
    """Print a table of one case by kind of drift."""
    parser = argparse.ArgumentParser()
    parser.add_argument('--case', choices=CASES, default='B')
    for name, default in (('--records', 300), ('--fits', 0), ('--seed', 0)):
        parser.add_argument(name, type=int, default=default)
    options = parser.parse_args()
    case, count, rng = CASES[options.case], options.records, np.random.default_rng(options.seed)
    drifting, (white, flicker, walk) = drifts(case.duration_s), covariances(case.duration_s)
    time = (np.arange(8 * CELLS) + 0.5) * case.duration_s / CELLS / 8
    kinds = {kind: np.array([mean(time).reshape(CELLS, 8).mean(axis=1) for mean in means])
             for kind, means in drifting.items()}

    def drawn(covariance: Array) -> Array:
        # The mean of flicker is free, so that adding a constant changes nothing.
        return rng.standard_normal((count, CELLS)) @ np.linalg.cholesky(covariance + 1e3).T

    true = ratios(case, drawn(white + flicker + (case.terms[K] / FLICKER)**2 * walk), kinds)
    seeds = [[options.seed, number] for number in range(options.fits)]
    print(f'{"false, true":17s}{"oracle":30s}{"one kind":30s}{"any kind":30s}fit\n'
          f'{"random walk":107s}{fitted(case, [np.zeros_like], seeds)}')
    for kind, means in kinds.items():
        cells = drawn(white + flicker)
        cells += rng.choice([-1, 1], (count, 1)) * means[rng.integers(len(means), size=count)]
        false = ratios(case, cells, {kind: means})[kind]
        pairs = [f'{share(no > np.quantile(yes, 1 - REPORTED))}  '
                 f'{share(yes > np.quantile(no, 1 - FALSE)):16s}'
                 for yes, no in zip(true[kind], false, strict=True)]
        print(f'{kind:17s}' + ''.join(pairs) + fitted(
            replace(case, terms=STILL), drifting[kind], seeds), flush=True)


if __name__ == '__main__':
    main()
