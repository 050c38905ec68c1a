# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
A strong periodic drift of the mean: the cycle of a heater or of an air conditioning.

It stands above the noise in dozens of harmonics, which pass for flicker, a random walk or a
low-pass while they are in it. All that there may be are taken out first; the noise that is left
says which there are, and whether they are a cycle. A weak cycle is a trend like any other.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from imu_allan.noise import chi_square
from imu_allan.noise.posterior.maximum import maximise
from imu_allan.noise.posterior.prepared import smoothed
from imu_allan.noise.posterior.regression import about_mean
from imu_allan.noise.posterior.trends import Bank, TrendKind
from imu_allan.noise.record.groups import QUANTIZATION, RANDOM_WALK
from imu_allan.noise.trends.harmonics import (
    Cycle,
    HARMONICS,
    harmonics_of,
    KNOWN,
    ratios,
    refined,
    without,
)
from imu_allan.noise.trends.regressors import RecordSpectrum
from imu_allan.noise.trends.waveforms import cycle
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_COMB = 8
"""Harmonics that are asked together: all of them may have passed for a random walk."""
_CERTAIN_COMB = 1e-11
"""Probability of so large ones in the noise that is left: many frequencies are tried."""
_MOST_CYCLES = 32.0
"""In the record: of more, each has little to do with a random walk."""
_FEW = (1, 4)
"""Harmonics by which the frequency is fitted first."""

_KIND = TrendKind('slow_cycle', 0.0, lambda duration: np.arange(
    1.0, _MOST_CYCLES + 0.1, 0.25) / duration, lambda frequency, _: cycle(frequency))


@dataclass(frozen=True)
class SlowCycle:
    """A cycle, and the record without it."""

    cycle: Cycle
    record: RecordSpectrum

    @property
    def period_s(self) -> float:
        """Seconds from one cycle to the next."""
        return 1 / self.cycle.frequency_hz


def strong_cycles(records: Sequence[RecordSpectrum]) -> list[SlowCycle | None]:
    """Find the cycle of every axis that stands above the noise, and take it out."""
    if records[0].duration_s == 0:
        return [None] * len(records)
    bank = Bank(records[0], (_KIND,))
    return [_strong_cycle(record, bank) for record in records]


def _strong_cycle(record: RecordSpectrum, bank: Bank) -> SlowCycle | None:
    noise = _noise(record)
    frequency_hz = _likeliest(record, noise, bank)
    variance = _variance(record, noise)
    for few in _FEW:
        frequency_hz = refined(record, variance, frequency_hz, few).frequency_hz
    # Harmonics that are rarer by chance are taken out to see.
    if (_chance(record, variance, frequency_hz) > 1e-3
            and not _has_outlier(record, noise)):
        return None
    # Most are chance, which shows already where as few harmonics are out as are asked.
    comb = refined(record, variance, frequency_hz, _COMB)
    left = _variance(record, _noise(without(record, comb, variance)))
    if _chance(record, left, comb.frequency_hz) >= _CERTAIN_COMB:
        return None
    found = _taken_out(record, variance, frequency_hz)
    left = _no_less_than_left(record, found.record)
    # Below, a strong one cannot be distinguished from a mean that bends.
    if (record.duration_s < 2 * found.period_s
            or _chance(record, left, 1 / found.period_s) >= _CERTAIN_COMB):
        return None
    return found


def known_cycle(record: RecordSpectrum, frequencies_hz: Sequence[float]) -> SlowCycle | None:
    """Take out the strongest cycle of frequencies that other axes have: what heats one, all."""
    if record.duration_s == 0:
        return None
    variance = _variance(record, _noise(record))
    ratio, frequency_hz = max((float(ratios(record, variance, hz, 1)[0]), hz)
                              for hz in frequencies_hz)
    return _taken_out(record, variance, frequency_hz) if ratio > KNOWN else None


def _noise(record: RecordSpectrum) -> Array:
    """Fit the terms, squared, to the slower half of the band: a low-pass bends the other."""
    groups = record.groups()
    last = len(groups.frequency) - 1
    # Of fewer than 24 bands the slow noise is not known.
    below = groups.below(float(groups.frequency[min(max(24, last // 2), last)]))
    return maximise(below, fixed={QUANTIZATION: 0.0}, moving_mean=True, tolerance=1e-2).theta


def _variance(record: RecordSpectrum, noise: Array) -> Array:
    """Return the power that noise gives to every bin."""
    return np.asarray(np.maximum(record.bins.design @ noise, 1e-300))


def _no_less_than_left(record: RecordSpectrum, calm: RecordSpectrum) -> Array:
    """
    Return the power of the noise in every bin, from what is left without a cycle.

    Behind a filter, say, the terms do not describe what is left: it is no less than it is.
    """
    noise, groups = _noise(calm), calm.groups()
    expected = np.maximum(groups.design @ noise, 1e-300)
    ratio = np.maximum(smoothed(groups, groups.power, expected) / expected, 1.0)
    return np.asarray(_variance(record, noise) * np.exp(np.interp(
        np.log(record.bins.frequency), np.log(groups.frequency), np.log(ratio))))


def _has_outlier(record: RecordSpectrum, noise: Array) -> bool:
    """Whether a slow coefficient is an outlier beside the fitted terms, or is a line."""
    groups = record.groups()
    expected = np.maximum(groups.design @ noise, 1e-300)
    ratio = about_mean(groups)(expected).noise / expected
    slow = groups.frequency <= 2 * _MOST_CYCLES * groups.frequency[0]
    # A coefficient that is rarer by chance is worth a search for a cycle.
    if np.any(chi_square.survival((groups.dof * ratio)[slow], np.maximum(groups.dof[slow], 1e-9))
              < 1e-5):
        return True
    slow_bins = record.bins.whole & (record.bins.frequency < _fastest(record))
    return record.keep is not None and not record.keep[slow_bins].all()


def _fastest(record: RecordSpectrum) -> float:
    """Return the frequency, in Hz, up to which a line may be a slow cycle."""
    # A line of half a minute is a slow cycle: nothing on the ground swings so slowly.
    return min(_MOST_CYCLES / record.duration_s, 1 / 30)


def _likeliest(record: RecordSpectrum, noise: Array, bank: Bank) -> float:
    """Return the frequency that explains most under noise without a random walk."""
    groups = record.groups()
    keep = None if record.keep is None else record.keep | (
        record.bins.frequency < _fastest(record))
    theta = noise.copy()
    theta[RANDOM_WALK] = 0.0
    lam = np.maximum(groups.design @ theta, 1e-300)
    axis = bank.of(replace(record, keep=keep))
    gains = axis.gains(axis.about(groups.frequency, lam, ()), 0)[0]
    return float(bank.grids[0][int(np.argmax(gains))])


def _chance(record: RecordSpectrum, variance: Array, frequency_hz: float) -> float:
    """Probability of harmonics so large in a given noise."""
    ratio = float(ratios(record, variance, frequency_hz, _COMB).sum())
    return float(chi_square.survival(ratio, 2 * _COMB))


def _taken_out(record: RecordSpectrum, variance: Array, frequency_hz: float) -> SlowCycle:
    """Fit a cycle, and take it out of the record."""
    there = HARMONICS[0]
    # All harmonics that there may be are taken out first: only then it shows which there are.
    for most in HARMONICS:
        every = refined(record, variance, frequency_hz, most)
        calm = without(record, every, variance)
        frequency_hz, variance = every.frequency_hz, _variance(record, _noise(calm))
        there = harmonics_of(record, variance, frequency_hz, most)
        if there < most:
            break
    found = refined(record, variance, frequency_hz, there)
    return SlowCycle(found, without(record, found, variance))
