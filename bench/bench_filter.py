# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What a filter fed with the drift model, or with the tuned pair, is worth on data nobody fitted.

Simulated: a record is fitted, the filter runs on over as much again. Loss is that of the mean
logarithmic score against the true model, in nats per step; NIS the mean normalised innovation
squared (1 is right, above 1 overconfident); coast the actual over the predicted variance of the
mean over that time without correction. Real: recordings named by IMU_ALLAN_DATA, fitted on one
half and filtered over the other, both ways; the interval of a median is that of its rank, as if
the halves were independent. And ten minutes of each, held against the hour behind it.

    python bench/bench_filter.py                 # some minutes on two cores
    python bench/bench_filter.py --hours 0.25 1 --runs 40

Behind the simulated rows of each length stands what the drift model was to reach, and how far the
largest loss and the ends of the ratios are from it.
"""

import argparse
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
import functools
from math import comb
import os
from pathlib import Path
import sys
from typing import Any

from imu_allan.characterization.axis import characterize
from imu_allan.noise.chi_square import NORMAL95
from imu_allan.noise.simulate import simulate
from imu_allan.recordings import choose_topic, open_recording, read_blocks
from imu_allan.result import AxisResult, DriftModel, GaussMarkov
from imu_allan.tuning.kalman import Filtered, run_filters
from imu_allan.tuning.state_space import space_of
from imu_allan.tuning.tune import tune
from imu_allan.tuning.uncertainty import spread_of_forecast
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DEGREE = np.pi / 180
N, B, K = 0.0045 * DEGREE, 0.0014 * DEGREE, 2.5e-4 * DEGREE
RATE_HZ = 50.0
DAY_RATE_HZ = 5.0
"""Of a day: a sample is a mean, so that is the same sensor; the model ends at 2.5 Hz or below."""
STEPS_S = (1.0, 10.0, 60.0)
COASTS_S = (10.0, 60.0, 300.0)
_LONGEST_SERIES = 40_000
GOALS: dict[float, dict[str, tuple[float, ...]]] = {
    0.25: {'loss 10': (0.015, 0.025), 'loss 60': (0.071, 0.13), 'nis': (0.93, 1.03),
           'coast 60': (0.76, 1.12)},
    1.0: {'loss 10': (0.0043, 0.017), 'loss 60': (0.020, 0.095), 'nis': (0.99, 1.03),
          'coast 60': (0.88, 1.05)},
    3.0: {'loss 10': (0.002, 0.0115), 'loss 60': (0.007, 0.070), 'nis': (0.98, 1.01),
          'coast 60': (0.86, 1.01)},
    24.0: {'loss 10': (0.0007, 0.006), 'loss 60': (0.004, 0.031), 'nis': (0.96, 1.08),
           'coast 60': (0.86, 1.15)}}
"""By hours: the largest loss of the sensors, of that with a process, the range of the ratios."""
WITH_PROCESS = 'N+B+100 s'
_MOST_NUMBERS = 20_000_000
"""In the covariances of filters that run side by side: 160 MB."""
_TOGETHER = 10
Models = Mapping[str, tuple[DriftModel, tuple[Any, ...]]]
Line = dict[tuple[str, str], float]

SENSORS: dict[str, Mapping[str, Any]] = {
    'N': {'noise_density': N},
    'N+K': {'noise_density': N, 'rate_random_walk': K},
    'N+B': {'noise_density': N, 'bias_instability': B},
    'N+B+K': {'noise_density': N, 'bias_instability': B, 'rate_random_walk': K},
    'N+B+100 s': {'noise_density': N, 'bias_instability': B,
                  'gauss_markov': {'sigma': 2 * B, 'correlation_time_s': 100.0}},
}


def truth(terms: Mapping[str, Any]) -> DriftModel:
    """Return a simulated sensor as a drift model; flicker as a dense bank of processes."""
    processes = []
    if 'bias_instability' in terms:
        # Processes two octaves apart, each of variance B^2 ln(ratio)/pi, ripple by 0.2 %.
        times = 0.01 * 4.0 ** np.arange(16)
        sigma = terms['bias_instability'] * np.sqrt(np.log(4.0) / np.pi)
        processes += [GaussMarkov(sigma, float(time)) for time in times]
    if 'gauss_markov' in terms:
        processes.append(GaussMarkov(**terms['gauss_markov']))
    return DriftModel(terms.get('noise_density', 0.0), terms.get('rate_random_walk', 0.0),
                      tuple(processes), 0.01, 1e9)


def means(samples: Array, size: int) -> Array:
    """Return means of `size` samples each."""
    count = len(samples) // size
    return np.asarray(samples[:count * size].reshape(count, size).mean(axis=1))


@dataclass(frozen=True)
class Score:
    """Sums over the steps that were tested."""

    steps: int
    nis: float
    log_score: float

    @classmethod
    def of(cls, found: Filtered, first: int, lane: int = 0) -> 'Score':
        """Score the innovations from the step `first` on."""
        e, s = found.innovation[lane, first:], found.variance[lane, first:]
        z = e**2 / s
        return cls(len(z), float(z.mean()), float(-0.5 * np.mean(np.log(s) + z)))


def coast_ratio(found: Filtered, model: DriftModel, tones: tuple[Any, ...], step_s: float,
                series: Array, first: int, horizon_s: float, lane: int = 0) -> float:
    """Mean square of actual minus predicted mean over the horizon, over the predicted variance."""
    m = round(horizon_s / step_s)
    starts = np.arange(first, len(series) - m + 1, m)
    if len(starts) < 2:
        return float('nan')
    total = np.concatenate(([0.0], np.cumsum(series)))
    actual = (total[starts + m] - total[starts]) / m
    over = space_of(model, tones, horizon_s)
    weight, rest = over.observation[0], over.measurement[0, 0]
    n = len(weight)
    predicted = found.state[lane, starts, :n] @ weight
    variance = np.einsum('i,kij,j->k', weight, found.covariance[lane, starts, :n, :n],
                         weight) + rest
    return float(np.mean((actual - predicted) ** 2 / variance))


def assessed(cases: Sequence[tuple[Models, Array]], first_s: float, cell_s: float
             ) -> list[Line]:
    """Score every model over means of each step, from a time on; the filter starts before."""
    lines: list[Line] = [{} for _ in cases]
    for step_s in STEPS_S:
        size = round(step_s / cell_s)
        length = min(len(series) for _, series in cases) // max(size, 1)
        if size < 1 or length < 12:
            continue
        first = int(first_s / step_s) + 1
        end = min(length, first + _LONGEST_SERIES)
        begin = max(0, first - _LONGEST_SERIES)
        # Filters run side by side: those of one record with few states, and the truth with many.
        for many in (False, True):
            lanes = [(place, name) for place, (models, _) in enumerate(cases) for name in models
                     if (name == 'truth') == many]
            side_by_side = max(1, _MOST_NUMBERS // ((end - begin) * (289 if many else 36)))
            for at in range(0, len(lanes), side_by_side):
                some = lanes[at:at + side_by_side]
                _score(lines, cases, some, step_s, size, begin, first, end)
    return lines


def _score(lines: list[Line], cases: Sequence[tuple[Models, Array]],
           lanes: Sequence[tuple[int, str]], step_s: float, size: int, begin: int, first: int,
           end: int) -> None:
    """Run some filters side by side and enter what they reach."""
    series = np.stack([means(cases[place][1], size)[begin:end] for place, _ in lanes])
    found = run_filters([space_of(*cases[place][0][name], step_s) for place, name in lanes],
                        series)
    for lane, (place, name) in enumerate(lanes):
        score = Score.of(found, first - begin, lane)
        lines[place][name, f'nis {step_s:g}'] = score.nis
        lines[place][name, f'log {step_s:g}'] = score.log_score
        if step_s == STEPS_S[0]:
            for horizon in COASTS_S:
                lines[place][name, f'coast {horizon:g}'] = coast_ratio(
                    found, *cases[place][0][name], step_s, series[lane], first - begin, horizon,
                    lane)


def fed(axis: AxisResult) -> dict[str, tuple[DriftModel, tuple[Any, ...]]]:
    """Give the models that filters are fed with, from what one record says."""
    assert axis.drift_model is not None
    measured = [c.value if c.observable else c.upper95 for c in
                (axis.coefficients['noise_density'], axis.coefficients['rate_random_walk'])]
    n, k = (float(value or 1e-12) for value in measured)
    tuned = tune(axis, 1.0, 60.0)
    careful = tune(axis, 1.0, 60.0, conservative=True)
    plain = functools.partial(DriftModel, processes=(), from_s=0.1, to_s=1e9)
    return {'drift model': (axis.drift_model, axis.tones),
            'tuned pair': (plain(tuned.noise_density, tuned.random_walk or 0.0), ()),
            'conservative': (plain(careful.noise_density, careful.random_walk or 0.0), ()),
            'as measured': (plain(n, k), ()), 'ten times K': (plain(n, 10 * k), ())}


def simulated(name: str, hours: float, seeds: Sequence[int]) -> list[Line]:
    """Fit records of a sensor and filter over the record that follows each."""
    terms = SENSORS[name]
    rate_hz = DAY_RATE_HZ if hours > 12 else RATE_HZ
    samples = round(3600 * hours * rate_hz)
    cases = []
    for seed in seeds:
        record = simulate(terms, 2 * samples, rate_hz, seed)
        models = {**fed(characterize(record[:samples], rate_hz)), 'truth': (truth(terms), ())}
        cases.append((models, means(record, round(rate_hz))))
    lines = assessed(cases, 3600 * hours, 1.0)
    for line in lines:
        for step in STEPS_S:
            if ('truth', f'log {step:g}') in line:
                for model in cases[0][0]:
                    line[model, f'loss {step:g}'] = (line['truth', f'log {step:g}']
                                                     - line[model, f'log {step:g}'])
    return lines


def show(title: str, lines: list[dict[tuple[str, str], float]], *, real: bool = False
         ) -> None:
    """Print means over simulated records, or medians and ranges over real axes."""
    print(f'\n{title}')
    columns = [f'nis {s:g}' for s in STEPS_S] + [f'coast {s:g}' for s in COASTS_S]
    columns += [f'{"log" if real else "loss"} {s:g}' for s in STEPS_S]
    wide = 42 if real else 11
    print(f'  {"":14}' + ''.join(f'{column:>{wide}}' for column in columns))
    for model in dict.fromkeys(key[0] for key in lines[0]):
        row = ''
        for column in columns:
            values = np.array([line.get((model, column), np.nan) for line in lines])
            values = values[np.isfinite(values)]
            if real and column.startswith('log'):
                values = np.array([line[model, column] - line['drift model', column]
                                   for line in lines if (model, column) in line])
            if not len(values):
                text = '-'
            elif real:
                both = '' if column.startswith('log') else f' {np.exp(np.log(values).mean()):.2f}'
                low, high = of_median(values)
                text = (f'{np.median(values):.3g} ({low:.2f}..{high:.2f}){both} '
                        f'[{values.min():.2f}..{values.max():.2f}]')
            else:
                text = f'{values.mean():.4f}'
            row += f'{text:>{wide}}'
        print(f'  {model:14}{row}', flush=True)
        if not real:
            row = ''.join(f'{f"+-{error(lines, model, column):.4f}":>11}' for column in columns)
            print(f'  {"":14}{row}')


def of_median(values: Array) -> tuple[float, float]:
    """Return the 95 % interval of a median: the values of the ranks that it is between."""
    n = len(values)
    below, rank = 0.0, 0
    while rank < n // 2 and (below := below + comb(n, rank) / 2**n) <= 0.025:
        rank += 1
    ordered = np.sort(values)
    return float(ordered[max(rank - 1, 0)]), float(ordered[n - max(rank, 1)])


def error(lines: list[dict[tuple[str, str], float]], model: str, column: str) -> float:
    """Return the standard error of a mean over records."""
    values = np.array([line.get((model, column), np.nan) for line in lines])
    values = values[np.isfinite(values)]
    return float(values.std() / np.sqrt(len(values))) if len(values) else float('nan')


def against_goal(hours: float, found: Mapping[str, list[dict[tuple[str, str], float]]]) -> None:
    """Print what the drift model reaches beside what it was to reach."""
    goals = GOALS.get(hours)
    if goals is None or set(found) != set(SENSORS):
        return
    means_ = {(name, column): float(np.nanmean([line.get(('drift model', column), np.nan)
                                                for line in lines]))
              for name, lines in found.items()
              for column in ('loss 10', 'loss 60', 'nis 1', 'nis 10', 'coast 60')}
    print(f'\n{hours:g} h, drift model: reached (goal)')
    for column in ('loss 10', 'loss 60'):
        for names, goal in (([n for n in found if n != WITH_PROCESS], goals[column][0]),
                            ([WITH_PROCESS], goals[column][1])):
            worst = max(names, key=lambda n: means_[n, column])
            value = means_[worst, column]
            print(f'  {column:9} {worst:10} {value:.5f} +- '
                  f'{error(found[worst], "drift model", column):.5f}  ({goal:g})  '
                  f'{value / goal:.2f} of it')
    for what, columns in (('nis', ('nis 1', 'nis 10')), ('coast 60', ('coast 60',))):
        cases = [(means_[n, c], error(found[n], 'drift model', c)) for n in found for c in columns]
        (low, low_error), (high, high_error) = min(cases), max(cases)
        print(f'  {what:9} {low:.3f} +- {low_error:.3f} to {high:.3f} +- {high_error:.3f}  '
              f'({goals[what][0]:g} to {goals[what][1]:g})', flush=True)


def recordings() -> list[Path]:
    """Real recordings at rest below IMU_ALLAN_DATA."""
    folder = os.environ.get('IMU_ALLAN_DATA')
    if not folder:
        print('IMU_ALLAN_DATA names no folder: no real recordings', file=sys.stderr)
        return []
    return sorted(path for path in Path(folder).glob('adis16405_*') if path.is_dir())


def of_recording(path: Path) -> tuple[dict[str, Array], float]:
    """Return the samples of every axis and the rate."""
    with open_recording(path) as recording:
        topic = choose_topic(recording)
        blocks = list(read_blocks(recording, topic))
    samples = np.concatenate([block.samples for block in blocks])
    stamps = np.concatenate([block.header_ns for block in blocks])
    rate = (len(stamps) - 1) / (float(stamps[-1] - stamps[0]) * 1e-9)
    names = [f'{sensor}_{letter}' for sensor in ('gyro', 'accel') for letter in 'xyz']
    return dict(zip(names, samples.T, strict=True)), rate


def real(record: Array, rate_hz: float, quantity: str) -> list[dict[tuple[str, str], float]]:
    """Fit one half of an axis and filter over the other, both ways."""
    half = len(record) // 2
    lines = []
    for ordered in (record, np.concatenate((record[half:], record[:half]))):
        axis = characterize(ordered[:half], rate_hz, quantity)
        series = means(ordered[half:], round(rate_hz))
        [line] = assessed([(fed(axis), series)], 0.0, round(rate_hz) / rate_hz)
        for horizon in COASTS_S:
            # The first segment is that in which the filter learns.
            outages = int(len(series) / horizon) - 1
            spread = np.hypot(spread_of_forecast(axis, np.array([horizon]))[0],
                              np.sqrt(0.5 / outages))
            off = np.log(line['drift model', f'coast {horizon:g}']) / 2
            line['band', f'{horizon:g}'] = float(abs(off) < NORMAL95 * spread)
        lines.append(line)
    return lines


def of_ten_minutes(record: Array, rate_hz: float, quantity: str) -> list[Line]:
    """Fit ten minutes and filter over the hour behind them, every twenty minutes."""
    cut, series, lines = round(600 * rate_hz), means(record, round(rate_hz)), []
    for begin in range(0, len(series) - 4200 + 1, 1200):
        at = begin * round(rate_hz)
        models = fed(characterize(record[at:at + cut], rate_hz, quantity))
        hour = series[begin + 600:begin + 4200]
        line = assessed([(models, hour)], 0.0, round(rate_hz) / rate_hz)[0]
        line['conservative', 'K'] = (models['conservative'][0].rate_random_walk
                                     / models['tuned pair'][0].rate_random_walk)
        lines.append(line)
    return lines


def show_overconfident(title: str, lines: list[Line]) -> None:
    """Print for each filter in what share of the lines it was overconfident, by column."""
    columns = [f'nis {s:g}' for s in STEPS_S] + [f'coast {s:g}' for s in COASTS_S]
    print(f'\n{title}\n  {"":14}' + ''.join(f'{column:>16}' for column in columns))
    for model in dict.fromkeys(key[0] for key in lines[0]):
        row = ''
        for column in columns:
            values = np.array([line[model, column] for line in lines if (model, column) in line])
            row += f'{f"{np.mean(values > 1):.2f} (<= {values.max():.2f})":>16}'
        print(f'  {model:14}{row}')
    wider = [line['conservative', 'K'] for line in lines]
    print(f'  conservative K over the tuned one: median {np.median(wider):.1f}, '
          f'at most {max(wider):.1f}', flush=True)


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--runs', type=int, default=100, help='simulated records of an hour')
    parser.add_argument('--hours', type=float, nargs='*', default=[0.25, 1.0, 3.0, 24.0])
    parser.add_argument('--only', nargs='+', choices=list(SENSORS), default=list(SENSORS))
    parser.add_argument('--workers', type=int, default=os.cpu_count())
    options = parser.parse_args()
    with ProcessPoolExecutor(options.workers) as pool:
        for hours in options.hours:
            # Longer records say more about a mean: fewer of them will do.
            runs = max(4, round(options.runs / np.sqrt(hours)))
            by_sensor = {}
            for name in options.only:
                # By so many that their filters run side by side and two processes have work.
                parts = [range(at, min(at + _TOGETHER, runs)) for at in range(0, runs, _TOGETHER)]
                lines = [line for part in pool.map(functools.partial(simulated, name, hours),
                                                   parts) for line in part]
                show(f'{name}, {hours:g} h, {runs} records', lines)
                by_sensor[name] = lines
            against_goal(hours, by_sensor)
    found: dict[str, list[Line]] = {'gyro': [], 'accel': []}
    short: dict[str, list[Line]] = {'gyro': [], 'accel': []}
    for path in recordings():
        axes, rate_hz = of_recording(path)
        for name, samples in axes.items():
            sensor = name.partition('_')[0]
            quantity = {'gyro': 'angular_velocity', 'accel': 'linear_acceleration'}[sensor]
            found[sensor] += real(samples, rate_hz, quantity)
            short[sensor] += of_ten_minutes(samples, rate_hz, quantity)
    for sensor, lines in found.items():
        if lines:
            inside = [line.pop(key) for line in lines for key in list(line) if key[0] == 'band']
            show(f'{sensor}: real recordings, {len(lines)} halves, median (95 %), geometric mean '
                 "of both ways [range]; log is the loss against the drift model's", lines,
                 real=True)
            print(f'  errors after {", ".join(f"{s:g}" for s in COASTS_S)} s within the band of '
                  f'the forecast: {sum(inside):g} of {len(inside)}', flush=True)
    for sensor, lines in short.items():
        if lines:
            show_overconfident(f'{sensor}: of {len(lines)} segments of ten minutes, fitted and '
                               'held against the hour behind: share overconfident (highest '
                               'ratio)', lines)
    return 0


if __name__ == '__main__':
    sys.exit(main())
