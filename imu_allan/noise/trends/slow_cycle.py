# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Strong periodic drift of the mean, such as the cycle of a heater or of air conditioning.

Dozens of its harmonics may exceed the noise, and pass for flicker, a random walk or a low-pass.
So all possible harmonics are removed first. The remaining noise then shows which of them are
significant, and whether they form a cycle. A weak cycle is fitted like any other trend.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from imu_allan.arrays import Array
from imu_allan.noise import chi_square
from imu_allan.noise.posterior.prepared_spectra import of_slower_half, smoothed
from imu_allan.noise.record.bins import Bins
from imu_allan.noise.record.groups import Groups, RANDOM_WALK
from imu_allan.noise.trends import harmonics
from imu_allan.noise.trends.gains import AxisBank, Bank
from imu_allan.noise.trends.regressors import RecordSpectrum
import numpy as np

_COMB = 8
"""Harmonics that are tested together, as all of them may have passed for a random walk."""
_MOST_CYCLES = 32.0
"""Most cycles per record; faster ones cannot be confused with a random walk."""


@dataclass(frozen=True)
class SlowCycle:
    """Cycle of the mean, and the record without it."""

    cycle: harmonics.Cycle
    record: RecordSpectrum

    @property
    def period_s(self) -> float:
        """Period of the cycle in seconds."""
        return 1 / self.cycle.frequency_hz


def strong_cycle(whole: RecordSpectrum, lines_hz: Sequence[float], bank: Bank
                 ) -> SlowCycle | None:
    """
    Find and remove the cycle of an axis, if it is significant.

    `lines_hz`: of the axis; those too fast for a cycle are no part of one. `bank`: trends to look
    for.
    """
    if bank.duration_s == 0:
        return None
    record = without_lines(whole, [hz for hz in lines_hz if hz > _fastest(whole)])
    noise = of_slower_half(record.groups())
    frequency_hz = _likeliest(record, noise, bank)
    variance = _expected(whole.bins, noise)
    # Continue only with harmonics that are unlikely by chance.
    if _chance(record, variance, frequency_hz) > 1e-3:
        return None
    # A starting value for the fit of all harmonics, from four.
    frequency_hz = harmonics.refined(record, variance, frequency_hz, 4).frequency_hz
    # A strict significance level, because many frequencies are tried.
    certain = 1e-11
    # Most candidates are chance, which shows when only the tested harmonics are removed.
    comb = harmonics.refined(record, variance, frequency_hz, _COMB)
    rest = harmonics.without(record, comb, variance)
    left = _expected(whole.bins, of_slower_half(rest.groups()))
    if _chance(record, left, comb.frequency_hz) >= certain:
        return None
    found = _taken_out(whole, variance, frequency_hz)
    left = _no_less_than_left(whole, found.record)
    # With less than two periods, a cycle cannot be distinguished from a mean that bends.
    if (record.duration_s < 2 * found.period_s
            or _chance(record, left, 1 / found.period_s) >= certain):
        return None
    return found


def known_cycle(record: RecordSpectrum, frequencies_hz: Sequence[float]) -> SlowCycle | None:
    """Remove the strongest cycle at frequencies of other axes, as a heater affects all axes."""
    if record.duration_s == 0 or not frequencies_hz:
        return None
    variance = _expected(record.bins, of_slower_half(record.groups()))
    ratio, frequency_hz = max((float(harmonics.ratios(record, variance, hz, 1)[0]), hz)
                              for hz in frequencies_hz)
    return _taken_out(record, variance, frequency_hz) if ratio > harmonics.SIGNIFICANT else None


def without_lines(record: RecordSpectrum, lines_hz: Sequence[float]) -> RecordSpectrum:
    """Remove lines from the coefficients of the whole record, where side lobes pass for trends."""
    slow = [hz for hz in lines_hz if hz < record.bins.frequency[record.bins.whole].max(initial=0)]
    if slow:
        variance = _expected(record.bins, of_slower_half(record.groups()))
        for hz in slow:
            line = harmonics.refined(record, variance, hz, 1)
            record = harmonics.without(record, line, variance)
    return record


def _expected(spectrum: Bins | Groups, noise: Array) -> Array:
    """Return the expected power of the noise in each bin or group."""
    return np.asarray(np.maximum(spectrum.design @ noise, 1e-300))


def _no_less_than_left(record: RecordSpectrum, calm: RecordSpectrum) -> Array:
    """
    Return the power of the noise in each bin, from the record without a cycle.

    It is at least the smoothed residual power, which the terms may not describe (after a filter).
    """
    noise, groups = of_slower_half(calm.groups()), calm.groups()
    expected = _expected(groups, noise)
    ratio = np.maximum(smoothed(groups, groups.power, expected) / expected, 1.0)
    return np.asarray(_expected(record.bins, noise) * np.exp(np.interp(
        np.log(record.bins.frequency), np.log(groups.frequency), np.log(ratio))))


def _fastest(record: RecordSpectrum) -> float:
    """Return the frequency, in Hz, up to which a line may be a slow cycle."""
    # A period above 30 s is a slow cycle, as no vibration on the ground is that slow.
    return min(_MOST_CYCLES / record.duration_s, 1 / 30)


def _likeliest(record: RecordSpectrum, noise: Array, bank: Bank) -> float:
    """Return the frequency with the largest gain, for noise without a random walk."""
    groups = record.groups()
    keep = record.keep | (record.bins.frequency < _fastest(record))
    theta = noise.copy()
    theta[RANDOM_WALK] = 0.0
    number = [kind.key for kind in bank.kinds].index('slow_cycle')
    gains = AxisBank(bank, replace(record, keep=keep)).whitened(
        groups.frequency, _expected(groups, theta), ()).gains(number)[0]
    return float(bank.grids[number][int(np.argmax(gains))])


def _chance(record: RecordSpectrum, variance: Array, frequency_hz: float) -> float:
    """Return the p-value of the harmonics of a frequency in given noise."""
    ratio = float(harmonics.ratios(record, variance, frequency_hz, _COMB).sum())
    return float(chi_square.survival(ratio, 2 * _COMB))


def _taken_out(record: RecordSpectrum, variance: Array, frequency_hz: float) -> SlowCycle:
    """Fit a cycle, and remove it from the record."""
    # First remove all possible harmonics; only then can the significant ones be identified. If all
    # of 32 show, there are more: a jagged cycle of 100 times B has.
    for most in (32, 96):
        every = harmonics.refined(record, variance, frequency_hz, most)
        calm = harmonics.without(record, every, variance)
        frequency_hz = every.frequency_hz
        variance = _expected(record.bins, of_slower_half(calm.groups()))
        there = harmonics.present(record, variance, frequency_hz, most)
        if there < most:
            break
    found = harmonics.refined(record, variance, frequency_hz, there)
    return SlowCycle(found, harmonics.without(record, found, variance))
