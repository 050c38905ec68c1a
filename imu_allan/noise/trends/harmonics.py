# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Periodic trend of the mean of any shape: fit its harmonics and frequency, and remove it.

The harmonics are regressed together with the derivative by the logarithm of the frequency, whose
coefficient is the error of the frequency (Gauss-Newton). The fitted cycle is removed from the
coefficients of the whole record, and its leakage from the blocks. A coefficient with leverage h
keeps the variance 1 - h, and its degrees of freedom are reduced accordingly.

References
----------
D. M. Bates and D. G. Watts, "Nonlinear Regression Analysis and Its Applications", 1988, ch. 2.
D. C. Hoaglin and R. E. Welsch, Am. Stat. 32 (1978): the leverage h.

"""

from dataclasses import dataclass, replace
from math import pi

from imu_allan.arrays import Array
from imu_allan.noise.posterior.regression import RIDGE
from imu_allan.noise.trends.kinds import cycle
from imu_allan.noise.trends.regressors import RecordSpectrum
import numpy as np
from numpy.typing import NDArray

SIGNIFICANT = 13.8
"""Chi-square above which a harmonic of known frequency is significant, at 0.1 %."""


@dataclass(frozen=True)
class Cycle:
    """Periodic trend of the mean of one record."""

    frequency_hz: float
    middle_s: float    # middle of the record, where phases are zero
    # (harmonics,): complex amplitudes, cosine less i times sine, in the unit of a sample
    sizes: NDArray[np.complex128]
    leverage: Array    # (bins,): of each coefficient

    def trend(self, time: Array) -> Array:
        """Return the cycle at given times."""
        return self._sum(time, self.sizes)

    def log_frequency_derivative(self, time: Array) -> Array:
        """Return the derivative of the cycle by the logarithm of the frequency."""
        order = np.arange(1, len(self.sizes) + 1)
        return (2 * pi * self.frequency_hz * (time - self.middle_s)
                * self._sum(time, 1j * order * self.sizes))

    def _sum(self, time: Array, sizes: NDArray[np.complex128]) -> Array:
        turn = np.exp(2j * pi * self.frequency_hz * (time - self.middle_s))
        # Horner's scheme for a polynomial in `turn`, with one power for each harmonic.
        found = np.zeros(len(time), dtype=np.complex128)
        for size in sizes[::-1].tolist():
            found = (found + size) * turn
        return np.asarray(found.real)


def refined(record: RecordSpectrum, variance: Array, frequency_hz: float, harmonics: int) -> Cycle:
    """
    Fit a cycle: equation (7) of docs/statistics.md, with its frequency by Gauss-Newton steps.

    `variance`: expected power of the noise in the bins. `frequency_hz`: starting value, within a
    quarter of a cycle over the record.
    """
    # The linear approximation holds within a quarter of a cycle over the record.
    longest = 0.25 / (frequency_hz * record.duration_s)
    # Two or three steps usually suffice.
    for _ in range(8):
        part = _Slow(record, variance, frequency_hz, harmonics)
        # Fit the amplitudes of harmonics, then the error of the frequency as well.
        sizes, _, _ = part.regressed(part.waves)
        cycle = Cycle(frequency_hz, part.middle_s, sizes[::2] - 1j * sizes[1::2], np.zeros(0))
        sizes, errors, taken = part.regressed(
            np.column_stack((part.waves, record.regressors(
                [cycle.log_frequency_derivative], part.last))))
        # A further step would not change anything of importance.
        if abs(sizes[-1]) < 0.02 * errors[-1]:
            break
        frequency_hz *= float(np.exp(np.clip(sizes[-1], -longest, longest)))
    leverage = np.zeros(len(variance))
    leverage[part.here] = taken
    return replace(cycle, sizes=sizes[:-1:2] - 1j * sizes[1:-1:2], leverage=leverage)


def present(record: RecordSpectrum, variance: Array, frequency_hz: float, most: int) -> int:
    """Return twice the order of the last significant harmonic, at most `most`."""
    there = ratios(record, variance, frequency_hz, most) >= SIGNIFICANT
    # The next harmonics are not significant alone, but together pass for a Gauss-Markov process.
    return min(2 * (int(np.flatnonzero(there).max(initial=0)) + 1), most)


def ratios(record: RecordSpectrum, variance: Array, frequency_hz: float, harmonics: int) -> Array:
    """Return the chi-square of each harmonic of a cycle for given noise, shape (harmonics,)."""
    part = _Slow(record, variance, frequency_hz, harmonics)
    sizes, errors, _ = part.regressed(part.waves)
    return np.asarray(((sizes / errors)**2).reshape(-1, 2).sum(axis=1))


def without(record: RecordSpectrum, cycle: Cycle, variance: Array) -> RecordSpectrum:
    """Return a copy of a record, of one axis, without a cycle."""
    calm = record.without_leak(cycle.trend, variance)
    bins = calm.bins
    coefficient = bins.coefficient - record.regressors([cycle.trend]).T
    # The limit keeps the band of a coefficient that the cycle explains completely.
    left = np.maximum(1 - cycle.leverage, 1e-9)
    # With a leverage of more than half, too little of a coefficient is noise.
    return replace(calm, keep=calm.keep & (cycle.leverage < 0.5), bins=replace(
        bins, power=np.where(bins.whole, coefficient**2, bins.power), coefficient=coefficient,
        dof=left * bins.dof, design=left[:, None] * bins.design, ramp=record.bins.ramp))


class _Slow:
    """Coefficients of one record that a cycle and its harmonics contribute to."""

    def __init__(self, record: RecordSpectrum, variance: Array, frequency_hz: float,
                 harmonics: int) -> None:
        bins = record.bins
        # At least one, and no more than lie below the highest coefficient of the whole record.
        fastest = float(bins.frequency[bins.whole].max(initial=0.0))
        harmonics = max(min(harmonics, int(fastest / frequency_hz)), 1)
        self.middle_s = record.duration_s / 2
        # Include side lobes: a quarter of the frequency of the highest harmonic, 64 coefficients.
        highest = 1.25 * harmonics * frequency_hz
        self.last = int(np.ceil(2 * record.duration_s * highest)) + 64
        self.here = bins.whole & (bins.index <= self.last)
        self._root = 1 / np.sqrt(variance[self.here])
        self._signal = self._root * bins.coefficient[record.axis, self.here]
        self._known = self._root[:, None] * np.column_stack((
            bins.of_ramp[self.here], record.regressors(record.in_every_fit, self.last)))
        waves = [wave for order in range(1, harmonics + 1)
                 for wave in cycle(order * frequency_hz, self.middle_s)]
        self.waves = record.regressors(waves, self.last)

    def regressed(self, columns: Array) -> tuple[Array, Array, Array]:
        """Regress on columns beside the known trends: sizes, standard errors and leverages."""
        own = slice(self._known.shape[1], None)
        every = np.column_stack((self._known, self._root[:, None] * columns))
        gram = every.T @ every
        # Columns are zero in a record without slow coefficients.
        scale = np.sqrt(np.where(np.diagonal(gram) > 0, np.diagonal(gram), 1.0))
        half = np.linalg.inv(np.linalg.cholesky(
            gram / np.outer(scale, scale) + RIDGE * np.eye(len(gram)))) / scale
        # The last rows belong to `columns`, orthogonal to the known trends.
        half = half[own]
        whitened = every @ half.T
        sizes = half.T @ (whitened.T @ self._signal)
        return sizes[own], np.sqrt(np.sum(half[:, own]**2, axis=0)), np.sum(whitened**2, axis=1)
