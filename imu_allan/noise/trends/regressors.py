# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Deterministic trends of the mean as regressors on the whole-record coefficients.

A slow trend of the mean appears in the slowest coefficients, which also determine the random walk.
A trend is a function of time. Its cosine transform over the cells of the series gives the
coefficients of a record that contains nothing else.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

from imu_allan.arrays import Array, Bools, Ints
from imu_allan.noise.record.bins import Bins, quantization_leak
from imu_allan.noise.record.groups import grouped, Groups, QUANTIZATION
from imu_allan.noise.record.periodogram import SpectrumSection
from imu_allan.noise.trends.leakage import LARGEST_LEAK, leaks, Waveform
import numpy as np
from scipy.fft import dct

_ENDS: tuple[Waveform, ...] = (
    lambda time: np.asarray(np.arange(len(time)) == 0, np.float64),
    lambda time: np.asarray(np.arange(len(time)) == len(time) - 1, np.float64))


@dataclass(frozen=True)
class RecordSpectrum:
    """Spectrum of one axis, to which trends of the mean can be fitted."""

    sections: Sequence[SpectrumSection]
    bins: Bins    # of these sections
    axis: int
    dt: float    # sample interval in seconds
    keep: Bools    # (bins,): False for bins of a line
    # Trends that are regressors of every fit
    trends: tuple[Waveform, ...] = ()
    # Whether the first and the last cell are regressors of every fit, before the trends
    ends: bool = False
    # Groups of all bins: their bands are kept, those without bins at zero weight, so that all axes
    # have the same ones
    bands: Groups | None = None

    @property
    def duration_s(self) -> float:
        """Seconds from the beginning of the record to its end, with runs joined."""
        return max(((section.start + section.length * section.step) * self.dt
                    for section in self.sections if section.coefficients is not None), default=0.0)

    def groups(self, *trends: Waveform) -> Groups:
        """Return the spectrum in narrow bands, with the ramp and trends as regressors."""
        if not trends:
            return self._without_trends
        columns = np.column_stack((self._columns, self.regressors(trends)))
        return grouped(self.bins, self.axis, self._weight, columns, known=self._without_trends)

    @cached_property
    def _columns(self) -> Array:
        """Regressors of the trends that are part of every fit."""
        return self.regressors(self.in_every_fit)

    @cached_property
    def _without_trends(self) -> Groups:
        """Return the groups without further trends; cached, as they are needed repeatedly."""
        found, bands = grouped(self.bins, self.axis, self._weight, self._columns), self.bands
        # Axes are fitted together at common frequencies, whatever was left out of one of them.
        return found if bands is None else replace(
            found, frequency=bands.frequency, step=bands.step, length=bands.length)

    @property
    def _weight(self) -> Array | Bools:
        """Weight of each bin: of those left out negligible instead of 0 if bands are kept."""
        return self.keep if self.bands is None else np.maximum(self.keep, 1e-15)

    @property
    def in_every_fit(self) -> tuple[Waveform, ...]:
        """Return the regressors of every fit, in order after the ramp."""
        return (*(_ENDS if self.ends else ()), *self.trends)

    @property
    def leak_of_ends(self) -> Array:
        """Power that quantization noise 1 leaks into the whole-record bins from its ends."""
        bins = self.bins
        return bins.whole * quantization_leak(bins.index, bins.length, bins.step * self.dt)

    def beside_ends(self) -> 'RecordSpectrum':
        """
        Return the same spectrum with the first and the last cell as regressors of every fit.

        Quantization noise telescopes, so that it leaks from just these two into all slow
        coefficients, which then vary together. A fit that allows for both is free of it.
        """
        design = self.bins.design.copy()
        design[:, QUANTIZATION] = np.maximum(design[:, QUANTIZATION] - self.leak_of_ends, 0.0)
        return replace(self, bins=replace(self.bins, design=design), ends=True)

    def with_trends(self, trends: Sequence[Waveform]) -> 'RecordSpectrum':
        """Return the same spectrum with further trends in every fit."""
        return replace(self, trends=(*self.trends, *trends)) if trends else self

    def mean(self, sizes: Array) -> Waveform:
        """Return the mean with the given sizes of the ramp and of each trend."""
        def ramp(time: Array) -> Array:
            return time

        return lambda time: np.asarray(sum(size * trend(time) for size, trend in zip(
            sizes.ravel(), (ramp, *self.trends), strict=True)))

    def without_leak(self, trend: Waveform, noise: Array) -> 'RecordSpectrum':
        """
        Return the spectrum of this axis without the leakage of a trend into the blocks.

        Regressors apply to the coefficients of the whole record only; blocks are shorter and keep
        only power. Bins with too much leakage, compared with `noise` of shape (bins,), are left
        out.
        """
        bins, own = self.bins, slice(self.axis, self.axis + 1)
        leak = leaks(self.sections, bins, self.dt, self.duration_s, trend)
        keep = self.keep & (leak < LARGEST_LEAK * noise)
        power = np.maximum(bins.power[own] - leak, 0.0)
        one = replace(bins, power=power, coefficient=bins.coefficient[own],
                      ramp=np.maximum(bins.ramp, 0.0))
        return replace(self, bins=one, axis=0, keep=keep)

    def regressors(self, trends: Sequence[Waveform], slowest: int | None = None) -> Array:
        """
        Transform trends of the mean like the record: X of (7) in docs/statistics.md.

        `trends`: one per column. `slowest`: last index to return, for slow trends. Returns shape
        (bins, trends), zero outside the whole-record part. With `slowest`, only for the slowest
        coefficients of the whole-record parts.
        """
        places, parts, rows = _layout(tuple(
            (section.start, section.length, section.step, section.last)
            for section in self.sections if section.coefficients is not None), slowest)
        time = places * self.dt
        values = np.array([trend(time) for trend in trends]).reshape(len(trends), len(time))
        found = np.zeros((len(self.bins.whole) if slowest is None else rows, len(trends)))
        for points, indices, scale in parts if trends else ():
            transforms = dct(values[:, points], norm='ortho')[:, :, 1:indices.shape[1] + 1]
            found[indices] = transforms.transpose(1, 2, 0) * scale
        return found


@lru_cache(maxsize=8)
def _layout(whole: tuple[tuple[int, int, int, int], ...], slowest: int | None
            ) -> tuple[Array, list[tuple[Ints, Ints, float]], int]:
    """
    Return the points at which trends are transformed, in samples, and the number of coefficients.

    `whole`: start, length, step and last index of each whole-record part. There may be hundreds of
    parts, so each trend is computed at the points of all, and equally long ones are transformed at
    once. Of these, also returned: points, coefficients in order after the first, and a factor.
    """
    lengths = np.array([length for _, length, _, _ in whole], np.int64)
    used = np.array([last for *_, last in whole], np.int64) - 1
    counts = lengths
    if slowest is not None:
        # 1024 points are enough for trends with a few dozen cycles in the record.
        counts, used = np.minimum(lengths, max(1024, slowest + 1)), np.minimum(used, slowest)
    places = [start + (np.arange(count) + 0.5) * (length / count) * step
              for (start, length, step, _), count in zip(whole, counts.tolist(), strict=True)]
    parts = []
    for length in np.unique(lengths):
        own = np.flatnonzero(lengths == length)
        points, indices = (
            (np.cumsum(each) - each)[own, None] + np.arange(each[own[0]])
            for each in (counts, used))
        parts.append((points, indices, float(np.sqrt(length / counts[own[0]]))))
    return np.concatenate([np.zeros(0), *places]), parts, int(used.sum())
