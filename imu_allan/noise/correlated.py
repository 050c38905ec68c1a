# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Noise that levels off: a first-order Gauss-Markov process beside the terms.

A random walk grows for ever. Where the slowest part of the spectrum does not, or where no sum of
the terms describes it, a process with a correlation time may.
"""

from dataclasses import dataclass
from functools import partial

from imu_allan.noise import chi_square
from imu_allan.noise.groups import Groups, QUANTIZATION, WHITE
from imu_allan.noise.intervals import CI95, crossing, estimate
from imu_allan.noise.likelihood import maximise, residual_power, Solution
from imu_allan.noise.spectrum import gauss_markov
from imu_allan.noise.trial import fit_columns, SMALLEST_P, Trial
import numpy as np

_SHORTEST_CORRELATION = 50
"""In samples: a shorter one is what a low-pass looks like."""
_SLOWEST = (4, 8, 16, 32, 64)
"""How many coefficients are asked together whether a walk levels off."""
_OBSERVABLE_PROCESS = 11.5
"""
Likelihood ratio of a process: two parameters, one of which is chosen from a range. Of 600 drawn
records of a clear random walk none reached it, of 300 of a weak one with flicker a single one.
"""
_TIMES = 12
"""Correlation times that are tried first, over all decades ..."""
_SLOW_TIMES = 6
"""A factor of 2.5 apart; the best is refined, and half the threshold is enough to be refined."""
_SLOW = 0.01
"""... and over the slowest two, where a walk asks whether it levels off."""
_LOG_TIME_ERROR = 0.2
"""Where the search for the ends of the interval of a correlation time begins."""
_LONGEST_CORRELATION = 100.0
"""End of an interval that has none, in longest times that the record can tell."""


def levels_off(trial: Trial) -> bool:
    """
    Whether the slowest coefficients are markedly smaller than the terms say.

    There are so few of them that the residuals of all half-octaves together do not show it.
    """
    expected = np.maximum(trial.groups.design @ trial.solution.theta, 1e-300)
    ratio = residual_power(trial.groups, trial.solution.theta) / expected
    # Groups stand in order of frequency.
    dof = np.cumsum(trial.groups.dof)
    power = np.cumsum(trial.groups.dof * ratio)
    some = [at for at in np.searchsorted(dof, _SLOWEST) if at < len(dof)]
    chance = 1 - chi_square.survival(power[some], dof[some])
    return bool(np.any(chance < SMALLEST_P / len(_SLOWEST)))


def with_process_column(groups: Groups, rolling: bool, dt: float, time: float) -> Groups:
    """Return the groups with a further column: a process of a correlation time, of unit sigma."""
    white = groups.design[:, WHITE]
    if rolling:
        white = white + groups.design[:, QUANTIZATION]
    density = dt * gauss_markov(np.minimum(groups.frequency * dt, 0.5), dt, time)
    return groups.with_design(np.column_stack((groups.design, white * density)))


@dataclass(frozen=True)
class Process:
    """
    A first-order Gauss-Markov process with its 95 % intervals.

    Attributes
    ----------
    sigma, correlation_time_s : float
    sigma_ci95, correlation_time_ci95 : (float, float)

    """

    sigma: float
    correlation_time_s: float
    sigma_ci95: tuple[float, float]
    correlation_time_ci95: tuple[float, float]


def with_gauss_markov(base: Trial, dt: float, *, slow: bool = False
                      ) -> tuple[Trial, Process] | None:
    """
    Fit the terms and a Gauss-Markov process to the band of a trial.

    A correlation time of a few samples is not considered: that is what a low-pass looks like.

    Parameters
    ----------
    base : Trial
        Without a process.
    dt : float
        Sample interval in seconds.
    slow : bool, optional
        Look for correlation times in the slowest two decades alone.

    Returns
    -------
    (Trial, Process) or None
        None where no process makes the data markedly more likely.

    """
    from scipy.optimize import minimize_scalar  # seldom needed, and slow to import

    groups = base.groups
    longest = 1 / (2 * np.pi * float(groups.frequency[0]))
    shortest = max(_SHORTEST_CORRELATION * dt, longest * _SLOW if slow else 0.0)
    if longest < 2 * shortest:
        return None

    def with_process(time: float) -> Groups:
        return with_process_column(groups, base.rolling, dt, time)

    nearest: Solution | None = None

    def attempt(log_time: float) -> float:
        nonlocal nearest
        nearest = maximise(with_process(float(np.exp(log_time))), nearest,
                           fixed={} if base.rolling else {QUANTIZATION: 0.0},
                           trend='restricted', tolerance=1e-3)
        return nearest.loss

    times = np.linspace(np.log(shortest), np.log(longest), _SLOW_TIMES if slow else _TIMES)
    losses = [attempt(time) for time in times]
    best = int(np.argmin(losses))
    if 2 * (base.solution.loss - losses[best]) < _OBSERVABLE_PROCESS / 2:
        return None
    around = (times[max(best - 1, 0)], times[min(best + 1, len(times) - 1)])
    log_time = float(minimize_scalar(attempt, bounds=around, method='bounded',
                                     options={'xatol': 0.01}).x)
    time = float(np.exp(log_time))
    trial = fit_columns(with_process(time), base.edge_hz, base.rolling)
    theta = trial.solution.theta
    if not trial.described or theta[WHITE] <= 0 or theta[-1] <= 0:
        return None
    if 2 * (base.solution.loss - trial.solution.loss) < _OBSERVABLE_PROCESS:
        return None

    def rise(distance: float, side: int) -> float:
        lost = attempt(log_time + side * distance) - trial.solution.loss
        return 2 * max(lost, 0.0) / trial.dispersion

    low, high = (float(np.exp(log_time + side * crossing(partial(rise, side=side), 0.0,
                                                         _LOG_TIME_ERROR, CI95)))
                 for side in (-1, 1))
    size = estimate(trial, groups.design.shape[1])
    return trial, Process(float(np.sqrt(theta[-1])), time, (size.low, size.high),
                          (max(low, dt), min(high, _LONGEST_CORRELATION * longest)))
