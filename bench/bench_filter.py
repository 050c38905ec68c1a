# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What a filter fed with the drift model, or with the tuned pair, is worth on data nobody fitted.

A record is fitted, and filters run over means of a second that follow, as `tune --verify` runs
them. NIS is the mean normalised innovation squared (1 is right, above 1 overconfident); coast the
actual over the predicted variance of the mean over that time without correction; loss that of the
mean logarithmic score against the true model, or the drift model, in nats per step. Simulated:
over as much again. Real: recordings named by IMU_ALLAN_DATA, fitted on one half and filtered over
the other, both ways; and ten minutes of each, held against the hour behind it.

    python bench/bench_filter.py                 # some minutes on two cores
    python bench/bench_filter.py --hours 1 3 --only N+B --runs 40
"""

import argparse
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
import os
import sys
from typing import Any

from battery.recordings import axes, QUANTITY
from imu_allan.characterization.axis import characterize
from imu_allan.noise.chi_square import NORMAL95
from imu_allan.noise.simulate import simulate
from imu_allan.result import AxisResult, DriftModel, GaussMarkov, Tone
from imu_allan.tuning.backtest import COASTS_S, filtered, INTERVALS_S, MOST_STEPS, run_filters
from imu_allan.tuning.forecast import spread_of_forecast
from imu_allan.tuning.state_space import space_of
from imu_allan.tuning.tune import FilterTuning, tune
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Models = Mapping[str, tuple[DriftModel, tuple[Tone, ...]]]
Line = dict[tuple[str, str], float]
"""What filters met in one record, by model and column."""

DEGREE = np.pi / 180
N, B, K = 0.0045 * DEGREE, 0.0014 * DEGREE, 2.5e-4 * DEGREE
SENSORS: dict[str, Mapping[str, Any]] = {
    'N': {'noise_density': N},
    'N+K': {'noise_density': N, 'rate_random_walk': K},
    'N+B': {'noise_density': N, 'bias_instability': B},
    'N+B+K': {'noise_density': N, 'bias_instability': B, 'rate_random_walk': K},
    'N+B+100 s': {'noise_density': N, 'bias_instability': B,
                  'gauss_markov': {'sigma': 2 * B, 'correlation_time_s': 100.0}},
}
SCORED_S = (10.0, 60.0)
COLUMNS = (*(f'nis {s:g}' for s in INTERVALS_S), *(f'coast {s:g}' for s in COASTS_S),
           *(f'loss {s:g}' for s in SCORED_S))


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


def fed(axis: AxisResult) -> Models:
    """Give the models that filters are fed with, from what one record says."""
    assert axis.drift_model is not None
    n, k = (float((c.value if c.observable else c.upper95) or 1e-12) for c in
            (axis.coefficients['noise_density'], axis.coefficients['rate_random_walk']))

    def pair(n: float, k: float) -> tuple[DriftModel, tuple[Tone, ...]]:
        return DriftModel(n, k, (), 0.1, 1e9), ()

    def tuned(numbers: FilterTuning) -> tuple[DriftModel, tuple[Tone, ...]]:
        return pair(numbers.noise_density, numbers.random_walk or 0.0)

    return {'drift model': (axis.drift_model, axis.tones),
            'tuned pair': tuned(tune(axis, 1.0, 60.0)),
            'conservative': tuned(tune(axis, 1.0, 60.0, conservative=True)),
            'as measured': pair(n, k), 'ten times K': pair(n, 10 * k)}


def means(samples: Array, size: int) -> Array:
    """Return means of `size` samples each."""
    return np.asarray(samples[:len(samples) // size * size].reshape(-1, size).mean(axis=1))


def run(models: Models, samples: Array, rate_hz: float) -> Line:
    """Run a filter with each model over means of a second of what was not fitted."""
    series = np.tile(means(samples, round(rate_hz)), (len(models), 1))
    met = filtered(list(models.values()), (series[:, at:at + MOST_STEPS] for at in
                                           range(0, series.shape[1], MOST_STEPS)),
                   round(rate_hz) / rate_hz)
    line: Line = {}
    for lane, name in enumerate(models):
        innovations, coasts = met.of(lane)
        line |= {(name, f'nis {round(row.interval_s)}'): row.nis for row in innovations}
        line |= {(name, f'coast {round(row.horizon_s)}'):
                 (row.observed_rms / row.predicted_sigma)**2 for row in coasts}
    for step_s in SCORED_S:
        # The first steps only learn the bias and the slow processes.
        if len(samples) // round(step_s * rate_hz) <= 5:
            continue
        found = run_filters([space_of(*model, step_s) for model in models.values()],
                            np.tile(means(samples, round(step_s * rate_hz)), (len(models), 1)))
        scores = dict(zip(models, -0.5 * np.mean(
            np.log(found.variance) + found.innovation**2 / found.variance, axis=1,
            where=np.arange(found.variance.shape[1]) >= 5), strict=True))
        best = scores.get('truth', scores['drift model'])
        line |= {(name, f'loss {step_s:g}'): best - score for name, score in scores.items()}
    return line


def simulated(name: str, hours: float, seed: int) -> Line:
    """Fit a record of a sensor and filter over what follows."""
    # Of a day at a lower rate: a sample is a mean, so that is the same sensor.
    rate_hz = 5.0 if hours > 12 else 50.0
    samples = round(3600 * hours * rate_hz)
    record = simulate(SENSORS[name], 2 * samples, rate_hz, seed)
    models = {**fed(characterize(record[:samples], rate_hz)), 'truth': (truth(SENSORS[name]), ())}
    return run(models, record[samples:], rate_hz)


def both_ways(record: Array, rate_hz: float, quantity: str) -> list[Line]:
    """Fit one half of an axis and filter over the other, both ways."""
    lines = []
    for fitted, other in (halves := np.array_split(record, 2)), halves[::-1]:
        axis = characterize(fitted, rate_hz, quantity)
        line = run(fed(axis), other, rate_hz)
        # Short recordings have none of the longest.
        for horizon in (one for one in COASTS_S if ('drift model', f'coast {one:g}') in line):
            # The first segment is that in which the filter learns.
            outages = int(len(other) / rate_hz / horizon) - 1
            spread = np.hypot(spread_of_forecast(axis, np.array([horizon]))[0],
                              np.sqrt(0.5 / outages))
            off = np.log(line['drift model', f'coast {horizon:g}']) / 2
            line['within its band', f'coast {horizon:g}'] = float(abs(off) < NORMAL95 * spread)
        lines.append(line)
    return lines


def of_ten_minutes(record: Array, rate_hz: float, quantity: str) -> list[Line]:
    """Fit ten minutes and filter over the hour behind them, every twenty minutes."""
    minute = round(60 * rate_hz)
    return [run(fed(characterize(record[at:at + 10 * minute], rate_hz, quantity)),
                record[at + 10 * minute:at + 70 * minute], rate_hz)
            for at in range(0, len(record) - 70 * minute + 1, 20 * minute)]


def show(title: str, lines: Sequence[Line], *, real: bool = False) -> None:
    """Print means over simulated records; of real ones medians, ranges and how many are above."""
    print(f'\n{title}\n  {"":15}' + ''.join(f'{column:>26}' for column in COLUMNS))
    for model in dict.fromkeys(name for line in lines for name, _ in line):
        row = ''
        for column in COLUMNS:
            values = np.array([line[model, column] for line in lines if (model, column) in line])
            text = '-' if not len(values) else (
                f'{values.mean():.3f} +- {values.std() / np.sqrt(len(values)):.3f}'
                if not real or model == 'within its band' else
                f'{np.median(values):.2f} ({values.min():.2f}, {values.max():.2f})'
                + ('' if column.startswith('loss') else f' {np.mean(values > 1):.0%}'))
            row += f'{text:>26}'
        print(f'  {model:15}{row}', flush=True)


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--runs', type=int, default=40, help='simulated records of an hour')
    parser.add_argument('--hours', type=float, nargs='*', default=[0.25, 1.0, 3.0, 24.0])
    parser.add_argument('--only', nargs='+', choices=list(SENSORS), default=list(SENSORS))
    parser.add_argument('--workers', type=int, default=os.cpu_count())
    options = parser.parse_args()
    with ProcessPoolExecutor(options.workers) as pool:
        for hours in options.hours:
            # Longer records say more about a mean: fewer of them will do.
            runs = max(4, round(options.runs / np.sqrt(hours)))
            for name in options.only:
                show(f'{name}, {hours:g} h, {runs} records',
                     list(pool.map(partial(simulated, name, hours), range(runs))))
        records = list(axes())
        for sensor, quantity in QUANTITY.items():
            for what, test in (('halves', both_ways), ('ten minutes, then an hour',
                                                       of_ten_minutes)):
                of_axes = [pool.submit(test, samples, rate_hz, quantity)
                           for _, name, samples, rate_hz in records if name.startswith(sensor)]
                if lines := [line for future in of_axes for line in future.result()]:
                    show(f'{sensor}: {len(lines)} real {what}: median (range), share above 1',
                         lines, real=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
