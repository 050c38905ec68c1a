# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What several records, many units and the sequential test are worth, by Monte Carlo.

    .venv/bin/python bench/bench_fleet.py joint 1500        # four records of 1 h, and their bound
    .venv/bin/python bench/bench_fleet.py moving 100        # the same where their means move
    .venv/bin/python bench/bench_fleet.py jumping 60        # the same where their walks jump
    .venv/bin/python bench/bench_fleet.py together 20       # the same where slow noise is f^-a
    .venv/bin/python bench/bench_fleet.py units 400         # populations of 5 to 40 units
    .venv/bin/python bench/bench_fleet.py sequential 200    # error rates and time of check --live
    .venv/bin/python bench/bench_fleet.py exponents 200     # the same beside slow noise of f^-a
    .venv/bin/python bench/bench_fleet.py dask 1000         # a cluster; one worker dies

The spectra of the joint fit are drawn in the spectral domain: every bin about its expectation, the
whole-record coefficients as normal numbers with a sign. That takes the noise model for granted,
which bench_accuracy.py does not. On the cluster, of a scheduler and two workers on this computer,
one worker is killed after a third of the recordings and another comes in its place. The recordings
are of an hour at 200 Hz; 25 are simulated, the others are the same files under other names.
"""

import argparse
from contextlib import ExitStack
from dataclasses import replace
import os
from pathlib import Path
import subprocess
import sys
from tempfile import TemporaryDirectory
import time
from typing import get_args

from drawn_spectra import draw, shape_of
from imu_allan.block import ImuBlock
from imu_allan.characterization import Characterization
from imu_allan.characterization.joint import joint_result
from imu_allan.errors import ImuAllanError
from imu_allan.noise.axis_fit import fit_axes
from imu_allan.noise.bins import Bins, bins_of
from imu_allan.noise.chi_square import NORMAL90
from imu_allan.noise.estimator import Estimator
from imu_allan.noise.fit import COLUMNS
from imu_allan.noise.groups import grouped
from imu_allan.noise.intervals import log_ratio
from imu_allan.noise.joint import fit_spectra, joint_fits, RecordedSpectrum
from imu_allan.noise.likelihood import maximise
from imu_allan.noise.periodogram import SpectrumPiece
from imu_allan.noise.random_effects import outliers, random_effects
from imu_allan.noise.sequential import borne_out, decide, Decision, SMALLEST_RECORD
from imu_allan.noise.simulate import flicker, simulate
from imu_allan.noise.temperature_course import JointTemperature, TemperatureCourse
from imu_allan.noise.trends import Course, RecordSpectrum
from imu_allan.recordings.write import write_recording
from imu_allan.sensor.noise_model import parse_model
from imu_allan.sensor.simulated_imu import simulated_blocks
import numpy as np

DEG = np.pi / 180
CASE_B = {'noise_density': .0045 * DEG, 'bias_instability': .0014 * DEG,
          'rate_random_walk': 2.5e-4 * DEG}
DT, SAMPLES, RECORDS = 1 / 200, 720_000, 4
DIFFERENT = 25


def shape() -> tuple[list[SpectrumPiece], Bins]:
    """Return pieces and bins of a record of an hour at 200 Hz, whatever its noise."""
    estimator = Estimator()
    estimator.update(np.random.default_rng(0).normal(size=SAMPLES))
    pieces = estimator.finished().periodogram.pieces()
    return pieces, bins_of(pieces, DT)


def drawn(bins: Bins, expected: np.ndarray, rng: np.random.Generator) -> Bins:
    """Draw the spectrum of a record with a ramp of its own."""
    regressor = np.sqrt(np.maximum(bins.ramp, 0))
    coefficient = rng.normal(size=len(expected)) * np.sqrt(expected) \
        + 3e-9 * rng.normal() * regressor
    power = rng.chisquare(bins.dof) / bins.dof * expected
    return replace(bins, power=np.where(bins.whole, coefficient**2, power)[None],
                   cross=np.where(bins.whole, coefficient * regressor, 0)[None],
                   coefficient=np.where(bins.whole, -coefficient, 0)[None])


def bound(bins: Bins, theta: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Cramer-Rao bound of the relative errors, the ramps taken out."""
    columns = [COLUMNS[key] for key in CASE_B]
    slope = bins.design[:, columns] / expected[:, None]
    information = (bins.dof[:, None] * slope).T @ slope / 2
    whole = bins.whole
    regressor = np.sqrt(np.maximum(bins.ramp[whole], 0) / expected[whole])
    share = regressor**2 / np.sum(regressor**2)
    part = slope[whole]
    lost = (share[:, None] * part).T
    information -= lost @ part
    information += np.outer(lost.sum(1), lost.sum(1)) / 2
    covariance = np.linalg.inv(RECORDS * information)
    return np.sqrt(np.diag(covariance)) / (2 * theta[columns])


def joint(runs: int) -> None:
    """Fit four records at once: error over the bound, coverage."""
    pieces, bins = shape()
    theta = np.zeros(bins.design.shape[1])
    for key, value in CASE_B.items():
        theta[COLUMNS[key]] = value**2
    expected = bins.design @ theta
    bounds = bound(bins, theta, expected)
    rng = np.random.default_rng(5)
    errors: dict[str, list[float]] = {key: [] for key in CASE_B}
    covered = dict.fromkeys(CASE_B, 0)
    cut = 0
    for _ in range(runs):
        spectra = []
        for _ in range(RECORDS):
            one = drawn(bins, expected, rng)
            first = maximise(grouped(one, 0), ramp=None)
            spectra.append(RecordedSpectrum(RecordSpectrum(pieces, one, 0, DT), [], first.theta,
                                            SAMPLES))
        fitted = fit_spectra(spectra, DT).fit
        cut += fitted.window_s is not None
        for key, truth in CASE_B.items():
            found = fitted.estimates[key]
            errors[key].append(found.value / truth - 1)
            covered[key] += found.observable and found.low <= truth <= found.high
    print(f'{RECORDS} records of 1 h, {runs} times; band cut in {cut}')
    for key, limit in zip(CASE_B, bounds, strict=True):
        error = np.array(errors[key])
        # Four times the interquartile half width: what a few cut bands do not move.
        robust = np.subtract(*np.quantile(error, (0.75, 0.25))) / 1.349
        ratio = float(np.sqrt(np.mean(error**2))) / limit
        print(f'{key:18} bound {100 * limit:.3f} %  RMSE/bound {ratio:.3f} '
              f'+- {ratio / np.sqrt(2 * runs):.3f}  by quartiles {robust / limit:.3f}  '
              f'coverage {covered[key] / runs:.3f}')


def moving(runs: int) -> None:
    """Fit four hours at once whose means move: how often a random walk is made of it."""
    rng = np.random.default_rng(3)
    dt, samples, flicker = 1 / 20, 72_000, 3e-4
    pieces = shape_of(samples)
    time = np.arange(0, samples * dt, 2.0)

    def celsius() -> np.ndarray:
        return 25 + 3 * np.sin(2 * np.pi * time / 2500 + rng.uniform(0, 2 * np.pi)) \
            + 5 * (1 - np.exp(-time / 900))

    def heated(course: np.ndarray) -> Course:
        return lambda t: 2e-4 * np.interp(t, time, course - course.mean())

    def sine(phase: float) -> Course:
        return lambda t: 2 * flicker * np.sin(2 * np.pi * t / 1200 + phase)

    for name, walk in (('still', 0.0), ('warm-up', 0.0), ('cycle', 0.0), ('temperature', 0.0),
                       ('walk', 5e-5), ('walk, unrelated temperature', 5e-5)):
        seen, covered, depends = 0, 0, 0
        for _ in range(runs):
            heat = [celsius() for _ in range(RECORDS)]
            spectra = []
            for course in heat:
                moved: dict[str, Course] = {
                    'warm-up': lambda t: 10 * flicker * np.exp(-t / 400),
                    'cycle': sine(rng.uniform(0, 2 * np.pi)), 'temperature': heated(course)}
                one, = draw(pieces, [0, 1e-6, flicker**2, walk**2], dt, 1, rng,
                            [moved[name]] if name in moved else [])
                spectra.append(RecordedSpectrum(one, [], maximise(one.groups(), ramp=None).theta,
                                                samples))
            known = JointTemperature(tuple(TemperatureCourse(time, course) for course in heat))
            found = fit_spectra(spectra, dt, known if 'temperature' in name else None).fit
            own = found.estimates['rate_random_walk']
            seen += own.observable
            covered += own.observable and own.low <= walk <= own.high
            depends += found.temperature is not None
        print(f'{name:28} K in {seen / runs:.3f} of {runs}, covers '
              f'{covered / max(seen, 1):.3f}  temperature in {depends / runs:.3f}', flush=True)


def together(runs: int) -> None:
    """Put recordings of a quarter of an hour together whose slow noise goes with f^-a."""
    density, rate, samples = 1e-3, 50.0, 45_000
    stamps = np.int64(1.7e18) + np.arange(samples) * np.int64(1e9 / rate)
    absent = np.tile([False, True], (samples, 1))
    for exponents_of, crossing_hz in [(of, crossing_hz) for of in (
            (.7, .7, .7), (.85, .85, .85), (.7, 1., 1.3)) for crossing_hz in (.1, 1.)]:
        held, apart, refused = [], [], 0
        for run in range(runs):
            recordings = []
            for number, exponent in enumerate(exponents_of):
                rng = np.random.default_rng([run, number])
                size = np.sqrt(rate * (2 * np.pi * crossing_hz / rate)**exponent)
                rows = np.full((samples, 6), np.nan)
                for axis in range(3):
                    rows[:, axis] = density * (np.sqrt(rate) * rng.standard_normal(samples)
                                               + size * flicker(samples, rng, exponent))
                recordings.append(Characterization(kind='recording', path=f'{number}'))
                recordings[-1].update(ImuBlock(stamps, stamps, rows, absent, 'imu'))
            try:
                axes = joint_result(recordings).axes
            except ImuAllanError:
                # A single result takes its slow noise for a filter's.
                refused += 1
                continue
            for axis in axes.values():
                interval = axis.coefficients['noise_density'].ci95
                if axis.spectrum is not None and interval is not None:
                    held.append(interval[0] <= density <= interval[1])
                    apart.append(axis.power_law is None)
        print(f'f^-a of {exponents_of} from {crossing_hz} Hz: N holds in {np.mean(held):.2f} of '
              f'{len(held)}, no common exponent in {np.mean(apart):.2f}, '
              f'refused {refused} of {runs}', flush=True)


def jumping(runs: int) -> None:
    """Fit four hours at once whose walk goes in jumps: whether the interval of K holds."""
    rng = np.random.default_rng(11)
    rate, samples, walk = 10.0, 36_000, 3e-4
    hours = samples / rate / 3600
    for name, share, an_hour in (('even', 0.0, 1), ('3 jumps an hour', 1.0, 3),
                                 ('6', 1.0, 6), ('12', 1.0, 12), ('6, half of the power', .5, 6)):
        seen, covered, half = 0, 0, []
        for run in range(runs):
            records = []
            for part in range(RECORDS):
                steps = walk * np.sqrt((1 - share) / rate) * rng.standard_normal(samples)
                jumps = rng.poisson(an_hour * hours)
                size = walk * np.sqrt(share * 3600 / an_hour)
                np.add.at(steps, rng.integers(0, samples, jumps), size * rng.normal(size=jumps))
                record = Estimator()
                record.update(np.cumsum(steps) + simulate({'noise_density': 1e-3}, samples, rate,
                                                          RECORDS * run + part))
                records.append(record.finished())
            (found,) = joint_fits(records, 1 / rate)
            assert found is not None
            own = found.fit.estimates['rate_random_walk']
            seen += own.observable
            covered += own.low <= walk <= own.upper
            half += [own.upper / own.value - 1] if own.observable else []
        print(f'{name:22} K in {seen / runs:.3f} of {runs}, interval or bound holds '
              f'{covered / runs:.3f}, up to {100 * np.median(half):.0f} % above', flush=True)


def units(runs: int) -> None:
    """Fit populations whose spread is 1, measured with errors of so many times that."""
    rng = np.random.default_rng(1)
    for count in (5, 10, 20, 40):
        for ratio in (0.0, 0.5, 1.0):
            between, covered, kept, false = [], 0, 0, 0
            for _ in range(runs):
                errors = ratio * np.exp(rng.normal(0, .2, count))
                values = rng.normal(size=count) + errors * rng.normal(size=count)
                effects = random_effects(values, errors)
                between.append(effects.between)
                covered += effects.between_ci95[0] <= 1 <= effects.between_ci95[1]
                # 95 % of a standard normal population lie below 1.645.
                kept += effects.tolerance() >= 1.645
                false += outliers(values, errors).any()
            print(f'{count:3} units, error {ratio:.1f}: spread {np.mean(between):.3f}  '
                  f'its interval {covered / runs:.3f}  95/95 limit {kept / runs:.3f}  '
                  f'false outlier {false / runs:.3f}')


def sequential(runs: int) -> None:
    """Watch records grow until they are decided: error rates, and how long it takes."""
    model = {'noise_density': 1e-3, 'bias_instability': 3e-4, 'rate_random_walk': 2e-5}
    for key, margin, rate, samples, shares in (
            ('noise_density', .1, 100., 20_000, (1.0, .8, 1.25)),
            ('bias_instability', .2, 10., 60_000, (1.0, .6, 1.6))):
        for share in shares:
            outcomes: dict[str, int] = {}
            times = []
            for run in range(runs):
                outcome, seconds = watched(model, key, model[key] / share, margin, rate, samples,
                                           7000 + run)
                outcomes[outcome] = outcomes.get(outcome, 0) + 1
                times.append(seconds)
            print(f'{key} {share} of its limit, margin {margin}: '
                  f'{ {name: count / runs for name, count in outcomes.items()} }  '
                  f'after {np.median(times):.0f} s (median), {np.quantile(times, .9):.0f} s '
                  f'(90 %) of {samples / rate:.0f} s')
            at_once = above_at_once(model, key, share, rate, samples, runs)
            print(f'    all of it at once by one test: above in {at_once:.3f}', flush=True)


def exponents(runs: int) -> None:
    """Watch N beside slow noise of an exponent that is not flicker's."""
    for exponent, crossing_hz in ((.7, .1), (.85, .1), (.7, 1.), (.7, 5.)):
        for share in (1.0, .8, 1.25):
            found = [watched({'noise_density': 1e-3}, 'noise_density', 1e-3 / share, .1, 100.,
                             20_000, 9000 + run, (exponent, crossing_hz)) for run in range(runs)]
            shares = {name: sum(outcome == name for outcome, _ in found) / runs
                      for name in get_args(Decision)}
            print(f'f^-{exponent} from {crossing_hz} Hz, N {share} of its limit: {shares}  after '
                  f'{np.median([seconds for _, seconds in found]):.0f} s (median)', flush=True)


def above_at_once(model: dict[str, float], key: str, share: float, rate: float, samples: int,
                  runs: int) -> float:
    """Return how often whole records are above the limit by the ratio of one test at 5 %."""
    above = 0
    for run in range(runs):
        estimator = Estimator()
        estimator.update(simulate(model, samples, rate, 7000 + run))
        (found,) = fit_axes(estimator.finished(), 1 / rate)
        assert found is not None
        trial, column = found.fit.trial, COLUMNS[key]
        limit, value = model[key] / share, float(np.sqrt(trial.solution.theta[column]))
        above += value > limit and 2 * log_ratio(trial, column, value, limit) > NORMAL90**2
    return above / runs


def dask(recordings: int) -> None:
    """Analyze hours on a cluster of which a worker is killed, and count what is lost."""
    model = parse_model('gyro: {noise_density: 0.005 deg/s/sqrt(Hz)}')
    with TemporaryDirectory() as name, ExitStack() as ending:
        folder = Path(name)
        units = [folder / f'unit{number}' for number in range(recordings)]
        for number, unit in enumerate(units):
            if number < DIFFERENT:
                write_recording(unit, simulated_blocks(model, 1 / DT, SAMPLES, seed=number))
                continue
            unit.mkdir()
            for file in units[number % DIFFERENT].iterdir():
                (unit / file.name).hardlink_to(file)

        def started(role: str, *options: str) -> subprocess.Popen[bytes]:
            process = subprocess.Popen(
                [sys.executable, '-m', f'distributed.cli.dask_{role}', *options], cwd=folder,
                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            ending.callback(process.wait)
            ending.callback(process.terminate)
            return process

        def worker() -> subprocess.Popen[bytes]:
            return started('worker', 'tcp://127.0.0.1:18786', '--nthreads', '1', '--no-nanny',
                           '--no-dashboard')

        scheduler = started('scheduler', '--port', '18786', '--no-dashboard',
                            '--scheduler-file', 'scheduler.json')
        while not (folder / 'scheduler.json').exists():
            time.sleep(0.1)
        workers = [worker(), worker()]
        command = subprocess.Popen(
            [sys.executable, '-m', 'imu_allan', 'analyze', *map(str, units),
             '--dask', 'tcp://127.0.0.1:18786', '--no-progress'],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert command.stdout is not None
        assert command.stderr is not None
        tenth = max(recordings // 10, 1)
        lost = before = 0.0
        count = 0
        for line in command.stdout:
            if not line.startswith('unit'):
                continue
            count += 1
            if count % tenth == 0:
                spent = lost + sum(map(processor_time, workers))
                print(f'to number {count}: {(spent - before) / tenth:.2f} s of processor time '
                      f'each, scheduler {resident(scheduler):.0f} MB', flush=True)
                before = spent
            if count == recordings // 3:
                lost += processor_time(workers[0])
                workers[0].kill()
                workers[0] = worker()
        complaints = command.stderr.read()
        print(f'{count} of {recordings} results, status {command.wait()}, complaints '
              f'{complaints.strip() or "none"}')


def processor_time(process: subprocess.Popen[bytes]) -> float:
    """Return the seconds that a process and those that it started have worked."""
    fields = Path(f'/proc/{process.pid}/stat').read_text().rpartition(')')[2].split()
    return sum(map(int, fields[11:15])) / os.sysconf('SC_CLK_TCK')


def resident(process: subprocess.Popen[bytes]) -> float:
    """Return the MB of memory that a process holds."""
    return int(Path(f'/proc/{process.pid}/statm').read_text().split()[1]) / 256


def watched(model: dict[str, float], key: str, limit: float, margin: float, rate: float,
            most: int, seed: int, law: tuple[float, float] | None = None) -> tuple[str, float]:
    """
    Watch one record; return the decision and the seconds that it took.

    A `law` is the exponent of slow noise, and at what frequency it is as strong as N.
    """
    samples, estimator = simulate(model, most, rate, seed), Estimator()
    if law is not None:
        exponent, crossing_hz = law
        size = model['noise_density'] * np.sqrt(rate * (2 * np.pi * crossing_hz / rate)**exponent)
        samples += size * flicker(most, np.random.default_rng([seed, 77]), exponent)
    done, look, decision = 0, SMALLEST_RECORD, 'open'
    while done < most and decision == 'open':
        estimator.update(samples[done:look])
        done, look = look, min(most, round(1.15 * look))
        (found,) = fit_axes(estimator.finished(), 1 / rate)
        if found.fit.acceptable:
            decision = decide(found.fit.trial, COLUMNS[key], limit, margin=margin,
                              pass_error=.05, fail_error=.05,
                              dt=1 / rate if key == 'noise_density' else None)
            if key == 'noise_density':
                own = found.fit.estimates[key]
                decision = borne_out(decision, limit, own.value, (own.low, own.high), .05)
    return decision, done / rate


PARTS = {'joint': joint, 'moving': moving, 'together': together, 'jumping': jumping,
         'units': units, 'sequential': sequential, 'exponents': exponents, 'dask': dask}


def main() -> int:
    """Run one part."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('part', choices=list(PARTS))
    parser.add_argument('runs', type=int, nargs='?', default=100)
    options = parser.parse_args()
    PARTS[options.part](options.runs)
    return 0


if __name__ == '__main__':
    sys.exit(main())
