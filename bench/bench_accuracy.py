# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Monte Carlo benchmark of the estimator: bias, error over the Cramer-Rao bound, coverage.

Every record is drawn by the exact simulators and fitted as by the public `characterize`. Beside it
stand peers that can be installed (allan-variance and allantools from PyPI) and the tangent method:
N read off the curve at 1 s, K off the +1/2 line through its end, B as its minimum.

    python bench/bench_accuracy.py --runs 200            # minutes on two cores
    python bench/bench_accuracy.py --only A B --peers
    python bench/bench_accuracy.py --drawn --runs 1000   # spectra drawn from the model
"""

import argparse
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
import functools
import os
import sys
from typing import Any

from imu_allan.characterization.axis import characterize
from imu_allan.noise.axis_fit import fit_axes
from imu_allan.noise.bins import bins_of
from imu_allan.noise.estimator import Estimator
from imu_allan.noise.fit import Fit
from imu_allan.noise.periodogram import SpectrumPiece
from imu_allan.noise.simulate import flicker, simulate
from imu_allan.noise.terms import FLICKER_FLOOR
import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter

Array = NDArray[np.float64]

DEGREE = np.pi / 180
N, B, K = 'noise_density', 'bias_instability', 'rate_random_walk'
SPECTRAL = ('quantization_noise', N, B, K)
PROCESS = 'gauss_markov'
CONSUMER = {N: 0.0045 * DEGREE, B: 0.0014 * DEGREE, K: 6.5e-5 * DEGREE}
WALKING = {**CONSUMER, K: 2.5e-4 * DEGREE}
_SETTLING = 2000


@dataclass(frozen=True)
class Case:
    """
    A simulated sensor.

    Attributes
    ----------
    terms : dict
        SI coefficient by key; a Gauss-Markov process as `simulate` wants it.
    rate_hz, duration_s : float
    low_pass : tuple or None
        Numerator and denominator of a filter in the sensor.
    power_law : tuple or None
        Exponent of slow noise that is no flicker, and where it crosses the white noise, in Hz.
    louder : float
        How many times the noise is as large in the second half.
    opening : float
        Size of what a sensor does in its first 90 s that no term is, in units of B.

    """

    terms: dict[str, Any]
    rate_hz: float
    duration_s: float
    low_pass: tuple[Sequence[float], Sequence[float]] | None = None
    power_law: tuple[float, float] | None = None
    louder: float = 1.0
    opening: float = 0.0

    def truth(self, key: str) -> float:
        """Return the true coefficient, or standard deviation of the process; 0 where absent."""
        value = self.terms.get(key, 0.0)
        return float(value['sigma'] if isinstance(value, dict) else value)

    def record(self, seed: int) -> Array:
        """Draw a record, in rad/s."""
        samples = round(self.rate_hz * self.duration_s)
        if self.power_law is not None:
            exponent, crossing_hz = self.power_law
            size = self.terms[N] * (2 * np.pi * crossing_hz / self.rate_hz)**(exponent / 2)
            slow = flicker(samples, np.random.default_rng([seed, 77]), exponent)
            return np.asarray(simulate(self.terms, samples, self.rate_hz, seed)
                              + size * np.sqrt(self.rate_hz) * slow)
        if self.low_pass is None:
            found = simulate(self.terms, samples, self.rate_hz, seed)
            found[samples // 2:] *= self.louder
            time = np.arange(round(90 * self.rate_hz)) / self.rate_hz
            found[:len(time)] += self.opening * self.terms.get(B, 0.0) * np.sin(time / 5)
            return found
        raw = simulate(self.terms, samples + _SETTLING, self.rate_hz, seed)
        return np.asarray(lfilter(*self.low_pass, raw)[_SETTLING:])


_HOUR = 3600.0
CASES = {
    'A': Case(CONSUMER, 100, 3 * _HOUR),
    'B': Case(WALKING, 200, _HOUR),
    'N': Case({N: CONSUMER[N]}, 100, _HOUR),
    'NK': Case({N: CONSUMER[N], K: WALKING[K]}, 100, 3 * _HOUR),
    'NB': Case({N: CONSUMER[N], B: CONSUMER[B]}, 100, 3 * _HOUR),
    'NBK': Case(WALKING, 100, 3 * _HOUR),
    'QNB': Case({'quantization_noise': 3e-6, N: CONSUMER[N], B: CONSUMER[B]}, 100, 3 * _HOUR),
    'GM': Case({N: 1e-3, PROCESS: {'sigma': 1e-3, 'correlation_time_s': 60.0}}, 100, _HOUR),
    '1st order 20 Hz': Case(CONSUMER, 100, 3 * _HOUR, low_pass=butter(1, 20, fs=100)),
    '2nd order 20 Hz': Case(CONSUMER, 100, 3 * _HOUR, low_pass=butter(2, 20, fs=100)),
    '2nd order 5 Hz': Case(CONSUMER, 100, 3 * _HOUR, low_pass=butter(2, 5, fs=100)),
    '4th order 10 Hz': Case(CONSUMER, 100, 3 * _HOUR, low_pass=butter(4, 10, fs=100)),
    'boxcar 8': Case(CONSUMER, 100, 3 * _HOUR, low_pass=([1 / 8] * 8, [1.0])),
    'f^-0.7': Case({N: CONSUMER[N]}, 100, _HOUR, power_law=(0.7, 5.0)),
    'f^-1.3': Case({N: CONSUMER[N]}, 100, _HOUR, power_law=(1.3, 5.0)),
    'louder by 20 %': Case(CONSUMER, 100, _HOUR, louder=1.2),
    'louder by 50 %': Case(CONSUMER, 100, _HOUR, louder=1.5),
    'first 90 s': Case(CONSUMER, 100, _HOUR, opening=20.0),
}

Estimates = dict[str, tuple[float, float, float, bool]]
"""Value, 95 % interval and observable by key; an upper bound is the interval from zero."""
Words = dict[str, bool]
"""What is said of the record besides."""


def ours(record: Array, rate_hz: float) -> tuple[Estimates, list[tuple[float, ...]], Words]:
    """
    Estimates of this package, its curve (tau, adev, low, high), and what it says besides.

    Where a coefficient is not observable the result file has no value; here the most likely one
    counts, as it does for the peers, and its interval reaches from zero to the upper bound.
    """
    estimator = Estimator()
    estimator.update(record)
    fitted = fit_axes(estimator.finished(), 1 / rate_hz)[0]
    if fitted is None:
        raise RuntimeError('the record is too short')
    found: Estimates = {
        key: (e.value, e.low, e.high, True) if e.observable else (e.value, 0.0, e.upper, False)
        for key, e in fitted.fit.estimates.items()}
    process = fitted.fit.gauss_markov
    found[PROCESS] = ((process.sigma, *process.sigma_ci95, True) if process
                      else (0.0, np.nan, np.nan, False))
    axis = characterize(record, rate_hz)
    curve = [(tau, adev, *bounds) for tau, adev, bounds
             in zip(axis.curve.tau_s, axis.curve.adev, axis.curve.ci95, strict=True)]
    steady = axis.stationarity is None or axis.stationarity.steady
    return found, curve, {'not steady': not steady, 'fits': axis.goodness_of_fit.acceptable}


def tangents(record: Array, rate_hz: float) -> Estimates:
    """Slopes laid on the curve by eye's rule: N at 1 s, K at the end, B at the minimum."""
    import allantools
    size = np.unique(np.geomspace(1, len(record) // 10, 100).astype(int))
    tau, adev, _, _ = allantools.oadev(record, rate=rate_hz, data_type='freq',
                                       taus=size / rate_hz)
    density = float(np.exp(np.interp(0.0, np.log(tau), np.log(adev))))
    values = {N: density, B: float(adev.min()) / FLICKER_FLOOR,
              K: float(adev[-1] * np.sqrt(3 / tau[-1]))}
    return {key: (value, np.nan, np.nan, True) for key, value in values.items()}


def least_squares(record: Array, rate_hz: float) -> Estimates:
    """Use the PyPI package allan-variance: relative non-negative least squares on the curve."""
    import allan_variance
    tau, avar = allan_variance.compute_avar(record, 1 / rate_hz)
    found, _ = allan_variance.estimate_parameters(tau, avar)
    names = {N: 'white', B: 'flicker', K: 'walk', 'quantization_noise': 'quantization'}
    return {key: (float(found[name]), np.nan, np.nan, float(found[name]) > 0)
            for key, name in names.items()}


PEERS: dict[str, Callable[[Array, float], Estimates]] = {
    'tangents on the curve': tangents,
    'allan-variance (NNLS)': least_squares,
}


def trial(name: str, peers: Sequence[str], seed: int
          ) -> tuple[dict[str, Estimates], list[tuple[float, ...]], Words]:
    """One record through every method."""
    case = CASES[name]
    record = case.record(seed)
    found, curve, words = ours(record, case.rate_hz)
    return ({'imu_allan': found,
             **{peer: PEERS[peer](record, case.rate_hz) for peer in peers}}, curve, words)


def run(name: str, runs: int, peers: Sequence[str] = (), first_seed: int = 0,
        workers: int | None = None) -> list[Any]:
    """Monte Carlo of one case, in `workers` processes."""
    job = functools.partial(trial, name, list(peers))
    seeds = range(first_seed, first_seed + runs)
    if workers == 1:
        return [job(seed) for seed in seeds]
    with ProcessPoolExecutor(workers or os.cpu_count()) as pool:
        return list(pool.map(job, seeds, chunksize=4))


def figures(name: str, trials: Sequence[Any], method: str = 'imu_allan'
            ) -> dict[str, dict[str, float]]:
    """Bias, root mean square error, coverage and share observable by coefficient."""
    case, summary = CASES[name], {}
    for key in trials[0][0][method]:
        rows = np.array([[float(v) for v in t[0][method][key]] for t in trials])
        truth = case.truth(key)
        inside = (rows[:, 1] <= truth) & (truth <= rows[:, 2])
        line = {'observable': float(rows[:, 3].mean()), 'coverage': float(inside.mean())}
        if truth:
            error = rows[:, 0] / truth - 1
            line['bias'] = float(error.mean())
            line['rmse'], line['rmse_error'] = root_mean_square(error)
        summary[key] = line
    return summary


def bounds(terms: dict[str, Any], rate_hz: float, duration_s: float) -> dict[str, float]:
    """
    Return the relative Cramer-Rao bound of every term of a sensor, by Whittle's likelihood.

    It is that of all coefficients of the record, the mean being all else that is unknown.
    """
    samples = round(rate_hz * duration_s)
    nothing = np.zeros((1, samples))
    bins = bins_of([SpectrumPiece(1, samples, 1, 1, samples, nothing, nothing)], 1 / rate_hz)
    keys = [key for key in SPECTRAL if key in terms]
    parts = bins.design[:, [SPECTRAL.index(key) for key in keys]] \
        * [terms[key]**2 for key in keys]
    shares = parts / parts.sum(axis=1, keepdims=True)
    information = (shares * bins.dof[:, None] / 2).T @ shares
    # Of a square the relative error is twice that of its root.
    errors = np.sqrt(np.diag(np.linalg.inv(information))) / 2
    return dict(zip(keys, errors.tolist(), strict=True))


def root_mean_square(errors: Array) -> tuple[float, float]:
    """Return the root of the mean square, and its standard error."""
    squares = errors**2
    size = float(np.sqrt(squares.mean()))
    return size, float(squares.std() / np.sqrt(len(squares)) / (2 * max(size, 1e-300)))


def share_with_error(share: float, of: int) -> str:
    """Write a share of so many records with its standard error."""
    return f'{share:.3f} +- {np.sqrt(share * (1 - share) / of):.3f}'


def right_terms(name: str, trials: Sequence[Any], method: str = 'imu_allan') -> float:
    """Share of records in which just the terms of the truth are observable."""
    wanted = set(CASES[name].terms)
    return float(np.mean([{key for key, v in t[0][method].items() if v[3]} == wanted
                          for t in trials]))


def curve_coverage(name: str, trials: Sequence[Any]) -> list[tuple[float, float]]:
    """Averaging time and coverage of the curve's 95 % interval, octave by octave."""
    from imu_allan.noise.terms import allan_variance
    terms = CASES[name].terms
    found = []
    for octave in range(len(trials[0][1])):
        rows = np.array([t[1][octave] for t in trials])
        truth = float(np.sqrt(allan_variance(terms, rows[0, 0])))
        found.append((float(rows[0, 0]), float(np.mean((rows[:, 2] <= truth)
                                                       & (truth <= rows[:, 3])))))
    return found


def show(name: str, trials: Sequence[Any]) -> None:
    """Print one case."""
    case, runs = CASES[name], len(trials)
    print(f'\n{name}: {case.rate_hz:g} Hz x {case.duration_s / 3600:g} h, {runs} records')
    bound = {} if PROCESS in case.terms else bounds(case.terms, case.rate_hz, case.duration_s)
    for method in trials[0][0]:
        print(f'  {method}')
        for key, line in figures(name, trials, method).items():
            if 'rmse' not in line:
                print(f'    {key:20} not in truth, reported in {100 * line["observable"]:5.1f} %')
                continue
            over = ('' if key not in bound else f'{line["rmse"] / bound[key]:8.2f} +- '
                    f'{line["rmse_error"] / bound[key]:.2f} x bound')
            held = (f'coverage {share_with_error(line["coverage"], runs)}'
                    if method == 'imu_allan' and key != PROCESS else '')
            print(f'    {key:20} bias {100 * line["bias"]:+8.3f} %  rmse '
                  f'{100 * line["rmse"]:8.3f} %{over}  observable '
                  f'{100 * line["observable"]:5.1f} %  {held}')
        print(f'    just the true terms in {100 * right_terms(name, trials, method):.1f} %')
    print('  ' + ', '.join(
        f'{word} {share_with_error(float(np.mean([words[word] for *_, words in trials])), runs)}'
        for word in trials[0][2]))
    if (case.low_pass is None and case.power_law is None and PROCESS not in case.terms
            and case.louder == 1 and not case.opening):
        worst = [f'{tau:g} s {share:.3f}' for tau, share in curve_coverage(name, trials)]
        print('  coverage of the curve: ' + ', '.join(worst))


_WEAK_Q = CONSUMER[N] * np.sqrt(np.sqrt(2 / 360_000) * 0.01 / 2 * 1.15)
"""Quantization noise whose square is one standard error, in an hour at 100 Hz."""


@dataclass(frozen=True)
class Drawn:
    """
    A simulated sensor of which spectra are drawn.

    Attributes
    ----------
    rate_hz, hours : float
    terms : dict
        SI coefficient by key.
    courses : tuple of callable
        What the mean follows over time.
    low_pass : tuple or None
        Numerator and denominator of a filter in the sensor.

    """

    rate_hz: float
    hours: float
    terms: dict[str, float]
    courses: tuple[Callable[[Array], Array], ...] = ()
    low_pass: tuple[Sequence[float], Sequence[float]] | None = None


def drawn_cases() -> dict[str, Drawn]:
    """Sensors by name."""
    still = {N: CONSUMER[N], B: CONSUMER[B]}
    flicker = CONSUMER[B]

    def ramp(slope: float) -> Callable[[Array], Array]:
        return lambda time: slope * time

    def warming(size: float, time_s: float) -> Callable[[Array], Array]:
        return lambda time: size * flicker * np.exp(-time / time_s)

    def turning(time: Array) -> Array:
        return np.asarray(2 * flicker * np.sin(2 * np.pi * time / 1200))

    steep = 3 * WALKING[K] / np.sqrt(_HOUR)
    return {
        'A': Drawn(100, 3, CONSUMER),
        'B': Drawn(200, 1, WALKING),
        'N + B': Drawn(100, 1, still),
        'N + B + ramp of 5 standard errors': Drawn(100, 1, still, (ramp(4.4 * flicker / _HOUR),)),
        'N + B + K + ramp of 3 standard errors': Drawn(100, 1, WALKING, (ramp(steep),)),
        'warm-up 10 B exp(-t/600 s)': Drawn(100, 2, still, (warming(10, 600),)),
        'warm-up 1000 B exp(-t/1800 s)': Drawn(100, 2, still, (warming(1000, 1800),)),
        'warm-up 100 B exp(-t/120 s) + 50 B exp(-t/1800 s)': Drawn(
            100, 2, still, (warming(100, 120), warming(50, 1800))),
        'warm-up 100 B exp(-t/600 s) beside the weak K of case A': Drawn(
            100, 2, CONSUMER, (warming(100, 600),)),
        'sine of 20 min, 2 B, 1 h': Drawn(100, 1, still, (turning,)),
        'sine of 20 min, 2 B, 2 h': Drawn(100, 2, still, (turning,)),
        **{f'Q of {errors} standard errors': Drawn(
            100, 1, {**still, 'quantization_noise': _WEAK_Q * np.sqrt(errors)})
           for errors in (1, 2, 3, 4)},
        **{f'white noise {percent} % lower at the band edge': Drawn(
            100, 1, still, low_pass=_mean_of_two(percent / 100)) for percent in (1, 2, 3)},
    }


def _mean_of_two(share: float) -> tuple[Sequence[float], Sequence[float]]:
    """Return a weighted mean with the sample before, which takes a share of the highest power."""
    other = (1 - np.sqrt(1 - share)) / 2
    return [1 - other, other], [1.0]


def coverage(fits: Sequence[Fit], key: str, truth: float) -> float:
    """Share of the intervals of a coefficient, and of its upper bounds, that hold."""
    return float(np.mean([one.low <= truth <= one.high if one.observable else truth <= one.upper
                          for one in (fit.estimates[key] for fit in fits)]))


def show_drawn(name: str, records: int) -> None:
    """Draw spectra of a case, fit them, and print the figures with their standard errors."""
    from drawn_spectra import draw, shape_of
    from imu_allan.noise.fit import fit
    case = drawn_cases()[name]
    dt = 1 / case.rate_hz
    theta = [case.terms.get(key, 0.0)**2 for key in SPECTRAL]
    spectra = draw(shape_of(round(case.rate_hz * case.hours * _HOUR)), theta, dt, records,
                   np.random.default_rng(0), case.courses, low_pass=case.low_pass)
    found = [fit(one.groups(), dt, None, one) for one in spectra]
    bound = bounds(case.terms, case.rate_hz, case.hours * _HOUR)
    print(f'\n{name}: {case.rate_hz:g} Hz x {case.hours:g} h, {records} drawn spectra')
    for key in SPECTRAL:
        estimates = [one.estimates[key] for one in found]
        seen = 'observable ' + share_with_error(
            float(np.mean([one.observable for one in estimates])), records)
        truth = case.terms.get(key, 0.0)
        if not truth:
            print(f'    {key:20} not in truth, {seen}')
            continue
        rmse, error = root_mean_square(np.array([one.value / truth - 1 for one in estimates]))
        print(f'    {key:20} rmse {100 * rmse:.3f} +- {100 * error:.3f} % '
              f'{rmse / bound[key]:6.2f} +- {error / bound[key]:.2f} x bound  {seen}  coverage '
              f'{share_with_error(coverage(found, key, truth), records)}')
    words = {'two exponentials': [len(one.warmings) > 1 for one in found],
             'low-pass': [one.window_s is not None for one in found],
             'warm-up': [bool(one.warmings) for one in found],
             'cycle': [one.cycle_s is not None for one in found],
             'trend or walk': [one.walk_unclear for one in found],
             'Gauss-Markov': [one.gauss_markov is not None for one in found],
             'ramp': [one.estimates['rate_ramp'].observable for one in found],
             'fits': [one.acceptable for one in found]}
    print('    ' + ', '.join(f'{word} {share_with_error(float(np.mean(said)), records)}'
                             for word, said in words.items()))


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--runs', type=int, default=100)
    parser.add_argument('--only', nargs='+', choices=list(CASES), default=list(CASES))
    parser.add_argument('--peers', action='store_true', help='also run the installed peers')
    parser.add_argument('--workers', type=int)
    parser.add_argument('--drawn', action='store_true',
                        help='fit spectra drawn from the model, trends and weak terms among them')
    options = parser.parse_args()
    if options.drawn:
        for name in drawn_cases():
            show_drawn(name, options.runs)
        return 0
    peers = []
    if options.peers:
        for peer, package in zip(PEERS, ('allantools', 'allan_variance'), strict=True):
            try:
                __import__(package)
                peers.append(peer)
            except ImportError:
                print(f'{peer}: not installed (pip install {package.replace("_", "-")})',
                      file=sys.stderr)
    for name in options.only:
        show(name, run(name, options.runs, peers, workers=options.workers))
    return 0


if __name__ == '__main__':
    sys.exit(main())
