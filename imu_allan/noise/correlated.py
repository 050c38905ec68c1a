# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Noise that levels off: a first-order Gauss-Markov process beside the terms.

A random walk grows for ever. Where the slowest part of the spectrum does not, or where no sum of
the terms describes it, a process with a correlation time may.
"""

from dataclasses import dataclass, replace
from functools import partial

from imu_allan.noise import chi_square
from imu_allan.noise.bins import Bins
from imu_allan.noise.groups import Groups, QUANTIZATION, WHITE
from imu_allan.noise.intervals import CI95, crossing, spread
from imu_allan.noise.likelihood import maximise, residual_power, Solution
from imu_allan.noise.minimum import lowest_near
from imu_allan.noise.spectrum import gauss_markov
from imu_allan.noise.trial import fit_columns, SMALLEST_P, Trial
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SHORTEST_CORRELATION = 50
"""In samples: a shorter one is what a low-pass looks like."""
_SLOWEST = (4, 8, 16, 32, 64)
"""How many coefficients are asked together whether a walk levels off."""
_OBSERVABLE_PROCESS = 18.0
"""
Likelihood ratio of a process. Its time is chosen from several decades, so that of records without
one exp(-ratio / 2) reach a ratio (Davies' bound, where the time goes past as many independent
values as here): one in ten thousand this one.
"""
_BY_SELECTION = 1.5**2
"""
On the ratios of the intervals below twice that threshold. Where a process is as likely as not to
be told, it is where it looks stronger and faster than it is.
"""
_TIMES = 12
"""From the shortest to the longest; the best is refined, if half the threshold is reached."""
_PROMISING = 2.0
"""Score statistic above which one is looked for: it falls short of the ratio that it foretells."""
_LOG_TIME_ERROR = 0.2
"""Where the search for the ends of the interval of a correlation time begins."""
_LONGEST_CORRELATION = 100.0
"""End of an interval that has none, in longest times that the record can tell."""


def levels_off(trial: Trial) -> bool:
    """
    Whether the slowest coefficients are markedly smaller than the terms say.

    There are so few of them that the residuals of all half-octaves together do not show it.
    """
    return falls_short(trial, SMALLEST_P)


def falls_short(trial: Trial, chance: float) -> bool:
    """Whether the slowest coefficients are smaller than the terms make them by such a chance."""
    expected = np.maximum(trial.groups.design @ trial.solution.theta, 1e-300)
    ratio = residual_power(trial.groups, trial.solution.theta) / expected
    # Groups stand in order of frequency.
    dof = np.cumsum(trial.groups.dof)
    power = np.cumsum(trial.groups.dof * ratio)
    some = [at for at in np.searchsorted(dof, _SLOWEST) if at < len(dof)]
    below = 1 - chi_square.survival(power[some], dof[some])
    return bool(np.any(below < chance / len(_SLOWEST)))


def with_process_column(groups: Groups, rolling: bool, dt: float, time: float) -> Groups:
    """Return the groups with a further column: a process of a correlation time, of unit sigma."""
    white = groups.design[:, WHITE]
    if rolling:
        white = white + groups.design[:, QUANTIZATION]
    return groups.with_design(np.column_stack(
        (groups.design, white * _over_white(groups.frequency, dt, time))))


def process_column(spectrum: Groups | Bins, dt: float, time: float) -> Array:
    """Return the power that a process of unit sigma gives, shape of the frequencies."""
    return np.asarray(spectrum.design[:, WHITE] * _over_white(spectrum.frequency, dt, time))


def _over_white(frequency: Array, dt: float, time: float) -> Array:
    """Density of a process of unit sigma over that of white noise of unit density."""
    return np.asarray(dt * gauss_markov(np.minimum(frequency * dt, 0.5), dt, time))


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


class _Search:
    """Fits of the terms and a process to groups, each from the one before it."""

    def __init__(self, groups: Groups, rolling: bool, dt: float) -> None:
        self._groups, self._rolling, self._dt = groups, rolling, dt
        self.nearest: Solution | None = None
        self.shortest, self.longest = _range(groups, dt)
        self.times = np.linspace(np.log(self.shortest), np.log(self.longest), _TIMES)

    @property
    def is_possible(self) -> bool:
        """Whether there are correlation times to choose from."""
        return self.longest >= 2 * self.shortest

    def with_process(self, time: float) -> Groups:
        """Return the groups with a process of a correlation time."""
        return with_process_column(self._groups, self._rolling, self._dt, time)

    def loss(self, log_time: float, limit: float = np.inf) -> float:
        """Fit a process of a correlation time, which is then the nearest."""
        self.nearest = maximise(self.with_process(float(np.exp(log_time))), self.nearest,
                                fixed={} if self._rolling else {QUANTIZATION: 0.0},
                                trend='restricted', tolerance=1e-3, limit=limit)
        return self.nearest.loss


def with_gauss_markov(base: Trial, dt: float) -> tuple[Trial, Process] | None:
    """
    Fit the terms and a Gauss-Markov process to the band of a trial.

    A correlation time of a few samples is not considered: that is what a low-pass looks like.

    Parameters
    ----------
    base : Trial
        Without a process.
    dt : float
        Sample interval in seconds.

    Returns
    -------
    (Trial, Process) or None
        None where no process makes the data markedly more likely.

    """
    search = _Search(base.groups, base.rolling, dt)
    if not search.is_possible:
        return None
    limit = base.solution.loss - _OBSERVABLE_PROCESS / 4
    losses = [search.loss(time, limit) for time in search.times]
    best = int(np.argmin(losses))
    if losses[best] > limit:
        return None
    log_time, _ = lowest_near(search.loss, search.times, best, 0.01)
    time = float(np.exp(log_time))
    trial = fit_columns(search.with_process(time), base.edge_hz, base.rolling)
    theta = trial.solution.theta
    if not trial.described or theta[WHITE] <= 0 or theta[-1] <= 0:
        return None
    gain = 2 * (base.solution.loss - trial.solution.loss)
    if gain < _OBSERVABLE_PROCESS:
        return None
    level = CI95 * (_BY_SELECTION if gain < 2 * _OBSERVABLE_PROCESS else 1.0)

    def rise(distance: float, side: int) -> float:
        lost = search.loss(log_time + side * distance) - trial.solution.loss
        return 2 * max(lost, 0.0) / trial.dispersion

    low, high = (float(np.exp(log_time + side * crossing(partial(rise, side=side), 0.0,
                                                         _LOG_TIME_ERROR, level)))
                 for side in (-1, 1))
    low, high = max(low, dt), min(high, _LONGEST_CORRELATION * search.longest)
    sizes = []
    for other in (low, np.sqrt(low * time), time, np.sqrt(time * high), high):
        # Amplitude and time go together, so the interval is that of both at once: for every
        # time what the ratio leaves to the amplitude.
        left = max(level - 2 * max(search.loss(float(np.log(other))) - trial.solution.loss, 0.0)
                   / trial.dispersion, 0.0)
        assert search.nearest is not None
        size = max(float(np.sqrt(search.nearest.theta[-1])), 1e-300)
        beside = replace(trial, groups=search.with_process(float(other)))
        error = np.sqrt(left) * spread(beside, search.nearest, base.groups.design.shape[1]) / size
        sizes += [size * np.exp(-error), size * np.exp(error)]
    return trial, Process(float(np.sqrt(theta[-1])), time, (min(sizes), max(sizes)), (low, high))


def likeliest_process(groups: Groups, dt: float, start: Solution) -> float:
    """
    Fit the terms and the likeliest of some processes.

    Parameters
    ----------
    groups : Groups
        Of the whole band.
    dt : float
        Sample interval in seconds.
    start : Solution
        A fit of the terms alone.

    Returns
    -------
    float
        The loss: the negative logarithm of the likelihood.

    """
    search = _Search(groups, False, dt)
    if not search.is_possible:
        return start.loss
    losses = [search.loss(time) for time in search.times]
    return min(start.loss,
               lowest_near(search.loss, search.times, int(np.argmin(losses)), 0.01)[1])


def promising_time(trial: Trial, dt: float) -> float | None:
    """
    Find the correlation time for which a search for a process is worth its time.

    Parameters
    ----------
    trial : Trial
        Without one.
    dt : float
        Sample interval in seconds.

    Returns
    -------
    float or None
        The most promising of the correlation times that a search begins with, in seconds, by the
        score of the process's power: how steeply the likelihood rises, the other terms following.
        None where none of them promises enough.

    """
    groups = trial.groups
    shortest, longest = _range(groups, dt)
    if longest < 2 * shortest:
        return None
    theta = trial.solution.theta
    expected = np.maximum(groups.design @ theta, 1e-300)
    root = np.sqrt(groups.dof / 2)
    seen = (theta > 0) & ~np.isin(np.arange(len(theta)), list(trial.fixed))
    basis = np.linalg.qr((groups.design[:, seen] / expected[:, None]) * root[:, None])[0]
    off = root * (residual_power(groups, theta) / expected - 1)
    best, found = _PROMISING, None
    for time in np.geomspace(shortest, longest, _TIMES):
        column = with_process_column(groups, trial.rolling, dt, float(time)).design[:, -1]
        column = root * column / expected
        column = column - basis @ (basis.T @ column)
        size = float(column @ column)
        score = float(column @ off)
        if size > 0 and score > 0 and score**2 / size > best:
            best, found = score**2 / size, float(time)
    return found


def longest_correlation(groups: Groups) -> float:
    """Return the longest correlation time that a spectrum can tell, in seconds."""
    return 1 / (2 * np.pi * float(groups.frequency[0]))


def _range(groups: Groups, dt: float) -> tuple[float, float]:
    """Return the shortest and the longest correlation time that are looked for."""
    return _SHORTEST_CORRELATION * dt, longest_correlation(groups)
