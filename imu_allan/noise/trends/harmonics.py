# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
A periodic trend of the mean of any shape: its harmonics, its frequency, and a record without it.

The harmonics are regressed together with a last trend, the derivative by the logarithm of the
frequency, whose coefficient says how far the frequency is off (Gauss and Newton). What they
explain is taken out of the coefficients of the whole record, and of the blocks what it leaks
there. A coefficient of which the regressors explain the share h, whatever it holds, keeps the
variance 1 - h, and counts so much.

References
----------
D. M. Bates and D. G. Watts, "Nonlinear Regression Analysis and Its Applications", 1988, ch. 2.
D. C. Hoaglin and R. E. Welsch, Am. Stat. 32 (1978): the share h, the leverage.

"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import pi

from imu_allan.noise.posterior.regression import RIDGE
from imu_allan.noise.trends.mean_in_blocks import Waveform
from imu_allan.noise.trends.regressors import RecordSpectrum, regressors
from imu_allan.noise.trends.waveforms import cycle
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

KNOWN = 13.8
"""Likelihood ratio above which a harmonic of a known frequency is there (0.1 %)."""
HARMONICS = (32, 96)
"""So many are fitted, and more where all of these show: a jagged cycle of a hundred times B."""


@dataclass(frozen=True)
class Cycle:
    """A periodic trend of the mean of one record."""

    frequency_hz: float
    middle_s: float    # of the record, from where phases count
    # (harmonics,): sizes, in the unit of a sample
    cosines: Array
    sines: Array
    # How far the logarithm of the frequency is from the likeliest one, and its standard error
    off: float
    error: float
    # (bins,): share of each coefficient that the regressors explain whatever it holds
    taken: Array

    @property
    def amplitude(self) -> float:
        """Half of what lies between the highest and the lowest value."""
        # At so many phases its highest and its lowest value are looked for.
        time = np.linspace(0.0, 1 / self.frequency_hz, 512)
        return float(np.ptp(self.trend(time))) / 2

    def trend(self, time: Array) -> Array:
        """Return the cycle over time."""
        return self._sum(time, self.cosines, self.sines)

    def faster(self, time: Array) -> Array:
        """Return its derivative by the logarithm of the frequency."""
        order = np.arange(1, len(self.sines) + 1)
        return (2 * pi * self.frequency_hz * (time - self.middle_s)
                * self._sum(time, order * self.sines, -order * self.cosines))

    def _sum(self, time: Array, cosines: Array, sines: Array) -> Array:
        turn = np.exp(2j * pi * self.frequency_hz * (time - self.middle_s))
        # Horner: a power of the turn for each harmonic.
        found = np.zeros(len(time), dtype=np.complex128)
        for size in (cosines - 1j * sines)[::-1].tolist():
            found = (found + size) * turn
        return np.asarray(found.real)


def refined(record: RecordSpectrum, variance: Array, frequency_hz: float, harmonics: int) -> Cycle:
    """
    Fit a cycle: equation (7) of docs/statistics.md, the frequency by Gauss and Newton.

    `variance` is what the noise gives to the bins. The frequency to begin at has to lie within a
    quarter of a cycle over the record.
    """
    # Beyond a quarter of a cycle over the record the derivative no longer says where it lies.
    longest = 0.25 / (frequency_hz * record.duration_s)
    # Two or three steps are the rule.
    for _ in range(8):
        found = _cycle(record, variance, frequency_hz, harmonics)
        # Another step is not worth its time.
        if abs(found.off) < 0.02 * found.error:
            break
        frequency_hz *= float(np.exp(np.clip(found.off, -longest, longest)))
    return found


def _cycle(record: RecordSpectrum, variance: Array, frequency_hz: float, harmonics: int) -> Cycle:
    """Fit the sizes of harmonics, then how far the frequency is off."""
    part = _Slow(record, variance, frequency_hz, harmonics)
    sizes, _, _ = part.regressed(part.waves)
    plain = Cycle(frequency_hz, part.middle_s, sizes[::2], sizes[1::2], 0.0, 0.0, np.zeros(0))
    sizes, errors, taken = part.regressed(
        np.column_stack((part.waves, part.transformed([plain.faster]))))
    every = np.zeros(len(variance))
    every[part.here] = taken
    return replace(plain, cosines=sizes[:-1:2], sines=sizes[1:-1:2], off=float(sizes[-1]),
                   error=float(errors[-1]), taken=every)


def most_harmonics(record: RecordSpectrum, frequency_hz: float) -> int:
    """Count the harmonics that the coefficients of a whole record can hold, at least one."""
    highest = float(record.bins.frequency[record.bins.whole].max(initial=0.0))
    return max(min(HARMONICS[-1], int(highest / frequency_hz)), 1)


def harmonics_of(record: RecordSpectrum, variance: Array, frequency_hz: float, most: int) -> int:
    """Count the harmonics up to the last that stands above the noise, and as many again."""
    there = ratios(record, variance, frequency_hz, most) >= KNOWN
    # As many again as show: those behind add up to what passes for a process.
    return min(2 * (int(np.flatnonzero(there).max(initial=0)) + 1), most)


def ratios(record: RecordSpectrum, variance: Array, frequency_hz: float, harmonics: int
           ) -> Array:
    """Likelihood ratio of each harmonic of a cycle under a noise that is given."""
    part = _Slow(record, variance, frequency_hz, harmonics)
    sizes, errors, _ = part.regressed(part.waves)
    return np.asarray(((sizes / errors)**2).reshape(-1, 2).sum(axis=1))


def without(record: RecordSpectrum, cycle: Cycle, variance: Array) -> RecordSpectrum:
    """Take a cycle out of a record, which is left as it is; the other is of one axis."""
    calm = record.without_leak(cycle.trend, variance)
    assert calm.keep is not None
    bins = calm.bins
    coefficient = bins.coefficient - regressors(record.sections, record.dt, [cycle.trend]).T
    # Nothing of a coefficient that is all the cycle's, but its band stays.
    left = np.maximum(1 - cycle.taken, 1e-9)
    # Where more of a coefficient is the cycle's, too little of it is noise.
    return replace(calm, keep=calm.keep & (cycle.taken < 0.5), bins=replace(
        bins, power=np.where(bins.whole, coefficient**2, bins.power), coefficient=coefficient,
        dof=left * bins.dof, design=left[:, None] * bins.design, ramp=record.bins.ramp))


class _Slow:
    """The coefficients of one record that a cycle and its harmonics reach."""

    def __init__(self, record: RecordSpectrum, variance: Array, frequency_hz: float,
                 harmonics: int) -> None:
        bins, self._record = record.bins, record
        harmonics = min(harmonics, most_harmonics(record, frequency_hz))
        self.middle_s = record.duration_s / 2
        # Up to a quarter beyond the highest harmonic its side lobes count, and 64 coefficients.
        highest = 1.25 * harmonics * frequency_hz
        self._last = int(np.ceil(2 * record.duration_s * highest)) + 64
        self.here = bins.whole & (bins.index <= self._last)
        self._root = 1 / np.sqrt(variance[self.here])
        self._signal = self._root * bins.coefficient[record.axis, self.here]
        known = [bins.of_ramp[self.here, None]]
        if record.trends:
            known.append(self.transformed(record.trends))
        self._known = self._root[:, None] * np.column_stack(known)
        self.waves = self.transformed([
            partial(self._about_middle, wave) for order in range(1, harmonics + 1)
            for wave in cycle(order * frequency_hz)])

    def _about_middle(self, wave: Waveform, time: Array) -> Array:
        return wave(time - self.middle_s)

    def transformed(self, trends: Sequence[Waveform]) -> Array:
        """Transform trends of the mean, shape (coefficients, trends)."""
        return regressors(self._record.sections, self._record.dt, trends, self._last)

    def regressed(self, columns: Array) -> tuple[Array, Array, Array]:
        """Return sizes and errors of columns beside what the mean follows, and what they take."""
        every = np.column_stack((self._known, self._root[:, None] * columns))
        gram = every.T @ every
        # A record without slow coefficients says nothing of any column.
        scale = np.sqrt(np.where(np.diagonal(gram) > 0, np.diagonal(gram), 1.0))
        half = np.linalg.inv(np.linalg.cholesky(
            gram / np.outer(scale, scale) + RIDGE * np.eye(len(gram)))) / scale
        # The last rows are of the columns about what the mean follows anyway.
        own = half[self._known.shape[1]:]
        whitened = every @ own.T
        sizes = own.T @ (whitened.T @ self._signal)
        here = slice(self._known.shape[1], None)
        return sizes[here], np.sqrt(np.sum(own[:, here]**2, axis=0)), np.sum(whitened**2, axis=1)
