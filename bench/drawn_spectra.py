# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Records drawn as spectra: thousands a minute, for thresholds and coverage.

Every bin of a record's spectrum is independent with a known law: a whole-record coefficient is
normal with the variance that the model gives it, the power of n blocks a chi-square of n degrees.
"""

from collections.abc import Sequence
from dataclasses import replace

from imu_allan.noise import spectrum
from imu_allan.noise.record.bins import bins_of
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.record.groups import FLICKER, WHITE
from imu_allan.noise.record.periodogram import SpectrumSection
from imu_allan.noise.trends.leakage import leaks, Waveform
from imu_allan.noise.trends.regressors import RecordSpectrum
import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct
from scipy.signal import freqz

Array = NDArray[np.float64]


def shape_of(samples: int) -> list[SpectrumSection]:
    """Return the sections of the spectrum of a record of so many samples."""
    estimator = Estimator()
    zeros = np.zeros(1 << 20)
    for begin in range(0, samples, len(zeros)):
        estimator.update(zeros[:samples - begin])
    return estimator.finished().periodogram.sections()


def draw(sections: Sequence[SpectrumSection], theta: Sequence[float], dt: float, records: int,
         rng: np.random.Generator, trends: Sequence[Waveform] = (),
         process: tuple[float, float] | None = None,
         power_law: tuple[float, float] | None = None,
         low_pass: tuple[Sequence[float], Sequence[float]] | None = None
         ) -> list[RecordSpectrum]:
    """
    Draw spectra.

    Parameters
    ----------
    sections : sequence of SpectrumSection
        As `shape_of` gives them.
    theta : sequence of float
        Squared coefficients of quantization, white noise, flicker and random walk.
    dt : float
        Sample interval in seconds.
    records : int
        How many.
    rng : Generator
        Source of the random numbers.
    trends : sequence of Waveform
        Their sum is added to the mean of every record.
    process : (float, float), optional
        Standard deviation and correlation time of a Gauss-Markov process besides.
    power_law : (float, float), optional
        Amplitude and exponent of slow noise besides that is no flicker.
    low_pass : tuple, optional
        Numerator and denominator of a filter that all of it has come through.

    """
    def mean(time: Array) -> Array:
        return np.asarray(sum(trend(time) for trend in trends))

    drawn = []
    for section in sections:
        lines = np.arange(section.first, section.last)
        power = np.zeros((records, section.length))
        bins = bins_of([section], dt)
        variance = bins.design @ np.asarray(theta)
        nu = np.minimum(bins.frequency * dt, 0.5)
        if process is not None:
            # The column of white noise has the shape that gaps leave it, and that of a block.
            sigma, time_s = process
            variance += (sigma**2 * bins.design[:, WHITE]
                         * dt * spectrum.gauss_markov(nu, dt, time_s))
        if power_law is not None:
            # What the ends of a record do to it is taken to be what they do to flicker.
            amplitude, exponent = power_law
            variance += (amplitude**2 * bins.design[:, FLICKER]
                         * spectrum.power_law(nu, dt, exponent) / spectrum.flicker(nu, dt))
        if low_pass is not None:
            white = theta[WHITE] * bins.design[:, WHITE]
            variance = ((variance - white) * np.abs(freqz(*low_pass, 2 * np.pi * nu)[1])**2
                        + white * _folded(low_pass, nu, section.step))
        if section.coefficients is None:
            dof = section.blocks
            power[:, lines] = variance * rng.chisquare(dof, (records, len(lines))) / dof
            if trends:
                length_s = RecordSpectrum(sections, bins, 0, dt, bins.whole).duration_s
                power[:, lines] += leaks([section], bins, dt, length_s, mean)
            drawn.append(replace(section, power=power))
            continue
        signed = np.zeros((records, section.length))
        signed[:, lines] = np.sqrt(variance) * rng.standard_normal((records, len(lines)))
        time = (section.start + (np.arange(section.length) + 0.5) * section.step) * dt
        for trend in trends:
            signed[:, lines] += dct(trend(time), norm='ortho')[lines]
        drawn.append(replace(section, power=signed**2, coefficients=signed))
    bins = bins_of(drawn, dt)
    every = np.ones(len(bins.index), dtype=bool)
    return [RecordSpectrum(drawn, bins, axis, dt, every) for axis in range(records)]


def _folded(low_pass: tuple[Sequence[float], Sequence[float]], nu: Array, step: int) -> Array:
    """Share of white noise behind a filter that means of so many samples see."""
    other = nu[:, None] + np.arange(step) / step
    share = (np.sin(np.pi * step * nu)[:, None] / (step * np.sin(np.pi * other)))**2
    through = np.abs(freqz(*low_pass, 2 * np.pi * other.ravel())[1])**2
    return np.asarray((share * through.reshape(other.shape)).sum(axis=1))
