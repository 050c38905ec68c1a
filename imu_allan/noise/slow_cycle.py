# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
A mean that repeats itself slowly: the cycle of a heater or of an air conditioning.

A strong cycle stands above the noise in dozens of harmonics, which pass for flicker, a walk or a
low-pass while they are in it. All that there may be are taken out first; the noise that is left
says which there are, and whether they are a cycle.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from imu_allan.noise import chi_square
from imu_allan.noise.correlated import Process, process_column
from imu_allan.noise.courses import best_course, in_each, likelihood_ratio, Spectrum, with_courses
from imu_allan.noise.harmonics import (
    Cycle,
    HARMONICS,
    harmonics_of,
    KNOWN,
    like,
    ratios,
    refined,
    without,
)
from imu_allan.noise.likelihood import residual_power, Solution
from imu_allan.noise.shapes import cycle
from imu_allan.noise.trends import RecordSpectrum
from imu_allan.noise.trial import Trial
from imu_allan.noise.warm_up import Choose
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_CYCLING = 25.0
"""Likelihood ratio above which a slow cycle is one; its frequency is searched over many."""
_STICKS_OUT = 1e-5
"""Probability of a slow coefficient so large that a search for a cycle is worth its time."""
_COMB = 8
"""Harmonics that are asked together, where all of them may have passed for a walk ..."""
_COMB_CHANCE = 1e-3
"""... and the probability of so large ones from where on they are taken out to see."""
_NO_VIBRATION_S = 30.0
"""From this period on a line is a slow cycle: nothing on the ground swings so slowly."""
_CYCLES = np.arange(1.0, 32.1, 0.25)
"""Cycles in the record that are tried: of more, each has little to do with a walk."""
_CERTAIN_COMB = 1e-11
"""The same in the noise beside them, where they are a cycle: of frequencies many are tried."""
_FEW = (1, 4)
"""Harmonics by which the frequency is fitted first."""


@dataclass(frozen=True)
class SlowCycle:
    """
    A cycle that was found, and the fit without it.

    Attributes
    ----------
    trial : Trial
    process : Process or None
        A Gauss-Markov process that is part of the trial.
    record : RecordSpectrum or JointSpectrum
        Without the cycle.
    cycles : tuple of Cycle
        What was taken out of each record.
    variances : tuple of ndarray, shape (bins,)
        What the noise gave to the bins of each then.

    """

    trial: Trial
    process: Process | None
    record: Spectrum
    cycles: tuple[Cycle, ...]
    variances: tuple[Array, ...]

    @property
    def period_s(self) -> float:
        """Seconds from one cycle to the next."""
        return 1 / self.cycles[0].frequency_hz


def sticks_out(trial: Trial, record: Spectrum) -> bool:
    """Whether a slow coefficient is larger than the terms can mean it to be, or is a line."""
    groups = trial.groups
    slow = groups.frequency <= 2 * _CYCLES[-1] * groups.frequency[0]
    expected = np.maximum(groups.design @ trial.solution.theta, 1e-300)
    ratio = residual_power(groups, trial.solution.theta) / expected
    return (bool(np.any(chi_square.survival((groups.dof * ratio)[slow], groups.dof[slow])
                        < _STICKS_OUT))
            or any(one.keep is not None and not one.keep[
                one.bins.whole & (one.bins.frequency < _fastest(one))].all()
                for one in record.records))


def likeliest_cycle(trial: Trial, record: Spectrum, still: Solution) -> tuple[float, float]:
    """Return the frequency that explains most under noise without a walk, and how much."""
    with_lines = [one if one.keep is None else replace(
        one, keep=one.keep | (one.bins.frequency < _fastest(one))) for one in record.records]
    return best_course(trial, like(record, with_lines), still,
                       (_CYCLES / record.duration_s).tolist(), cycle)


def _fastest(record: RecordSpectrum) -> float:
    """Return the frequency, in Hz, up to which a line may be a slow cycle."""
    return min(float(_CYCLES[-1]) / record.duration_s, 1 / _NO_VIBRATION_S)


def slow_cycle(trial: Trial, process: Process | None, record: Spectrum, frequency_hz: float,
               choose: Choose, *, known: bool = False, ratio: float | None = None
               ) -> SlowCycle | None:
    """
    Fit a cycle, beginning at a frequency, and the noise without it.

    Parameters
    ----------
    trial : Trial
        A fit with the ramp and the courses of the record.
    process : Process or None
        A Gauss-Markov process that is part of it.
    record : RecordSpectrum or JointSpectrum
        That it was fitted to.
    frequency_hz : float
        Where to begin.
    choose : callable
        Chooses the model anew beside it.
    known : bool, optional
        Whether the frequency is that of another axis, not searched in this one.
    ratio : float, optional
        Likelihood ratio of a cycle of that frequency, where it is known.

    Returns
    -------
    SlowCycle or None
        None where the data does not ask for it.

    """
    level = in_each(KNOWN if known else _CYCLING, 2, len(record.records))
    variances = _variances(trial, process, record)
    if ratio is None:
        ratio = likelihood_ratio(trial, with_courses(trial, record, cycle(frequency_hz)))
    certain = ratio >= level
    if not certain:
        if known:
            return None
        # The harmonics of a strong cycle pass for noise, a walk above all, in which it is lost.
        frequency_hz = _nearer(record, variances, frequency_hz)
        if (_chance(record, variances, frequency_hz) > _COMB_CHANCE
                and not sticks_out(trial, record)):
            return None
    found = taken_out(trial, process, record, frequency_hz, choose)
    variances = _variances(found.trial, found.process, record)
    if not certain and _chance(record, variances, 1 / found.period_s) >= _CERTAIN_COMB:
        return None
    # Beside what comes but once, a turn of the sensor, say, a part of it looks like any cycle.
    return found if found.trial.good else None


def _nearer(record: Spectrum, variances: Sequence[Array], frequency_hz: float) -> float:
    """Fit the frequency by the first harmonics: the others know it better, but only nearby."""
    for few in _FEW:
        frequency_hz = refined(record, variances, frequency_hz, few)[0].frequency_hz
    return frequency_hz


def _chance(record: Spectrum, variances: Sequence[Array], frequency_hz: float) -> float:
    """Probability of harmonics so large in a given noise."""
    ratio = sum(float(ratios(one, variance, frequency_hz, _COMB).sum())
                for one, variance in zip(record.records, variances, strict=True))
    return float(chi_square.survival(ratio, 2 * _COMB * len(record.records)))


def taken_out(trial: Trial, process: Process | None, record: Spectrum, frequency_hz: float,
              choose: Choose) -> SlowCycle:
    """Fit a cycle that is there, and the noise without it."""
    frequency_hz = _nearer(record, _variances(trial, process, record), frequency_hz)
    # All harmonics that there may be are taken out first: only then it shows which there are.
    for most in HARMONICS:
        every = _beside(trial, process, record, frequency_hz, most, choose)
        frequency_hz = 1 / every.period_s
        trial, process = every.trial, every.process
        there = max(harmonics_of(one, variance, frequency_hz, most) for one, variance in zip(
            record.records, _variances(trial, process, record), strict=True))
        if there < most:
            break
    return _beside(trial, process, record, frequency_hz, there, choose)


def _beside(trial: Trial, process: Process | None, record: Spectrum, frequency_hz: float,
            harmonics: int, choose: Choose) -> SlowCycle:
    """Fit so many harmonics, then the noise."""
    variances = _variances(trial, process, record)
    cycles = refined(record, variances, frequency_hz, harmonics)
    calm = without(record, cycles, variances)
    return SlowCycle(*choose(calm.groups(), trial.solution), calm, cycles, variances)


def _variances(trial: Trial, process: Process | None, record: Spectrum) -> tuple[Array, ...]:
    return tuple(_variance(trial, process, one) for one in record.records)


def _variance(trial: Trial, process: Process | None, record: RecordSpectrum) -> Array:
    """Return the power that the noise of a fit gives to every bin."""
    bins, theta = record.bins, trial.solution.theta[:4].copy()
    if trial.rolling:
        # The column of the roll-off is none of the terms, and nothing at the slow end.
        theta[0] = 0.0
    noise = bins.design @ theta
    if process is not None:
        noise = noise + trial.solution.theta[-1] * process_column(
            bins, record.dt, process.correlation_time_s)
    return np.asarray(np.maximum(noise, 1e-300))
