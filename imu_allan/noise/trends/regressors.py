# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Trends of the mean that are no noise, as regressors on the whole-record coefficients.

Whatever moves the mean slowly stands in the slowest coefficients, where the random walk is read
too. A trend is given as a function of time; its cosine transform over the cells of the series is
what the coefficients would be if it were all there is.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from imu_allan.noise.record.bins import Bins
from imu_allan.noise.record.groups import grouped, Groups, joined_groups, regressed
from imu_allan.noise.record.periodogram import SpectrumSection
from imu_allan.noise.trends.mean_in_blocks import is_little, leaks, Waveform
import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SlowCoefficients:
    """The slowest whole-record coefficients of one axis."""

    sections: Sequence[SpectrumSection]    # of the record
    count: int    # index of the last of them
    which: NDArray[np.bool_]    # which coefficients up to that index are no line
    dt: float    # sample interval in seconds
    design: Array    # (n, columns)
    # (n,): values, and what a unit ramp would give
    coefficient: Array
    ramp: Array

    def regressors(self, trends: Sequence[Waveform]) -> Array:
        """Transform trends of the mean, shape (n, trends), which are slow themselves."""
        return regressors(self.sections, self.dt, trends, self.count)[self.which]


@dataclass(frozen=True)
class RecordSpectrum:
    """The spectrum of one axis, to which trends of the mean can be fitted."""

    sections: Sequence[SpectrumSection]
    bins: Bins    # of these sections
    axis: int
    dt: float    # sample interval in seconds
    keep: NDArray[np.bool_] | None = None    # (bins,): False where a line is
    # Regressors that stand in every fit, directly behind the ramp
    trends: tuple[Waveform, ...] = ()
    # Whether bands without a bin stay, worth nothing, so that all axes have the same bands
    aligned: bool = False

    @property
    def duration_s(self) -> float:
        """Seconds from the beginning of the record to its end."""
        return duration(self.sections, self.dt)

    def slowest(self, count: int) -> SlowCoefficients:
        """Return the slowest whole-record coefficients, up to index `count`."""
        which = slow = self.bins.whole & (self.bins.index <= count)
        if self.keep is not None:
            which = slow & self.keep
        return SlowCoefficients(self.sections, count, which[slow], self.dt,
                                self.bins.design[which], self.bins.coefficient[self.axis, which],
                                self.bins.of_ramp[which])

    def groups(self, *trends: Waveform) -> Groups:
        """Return the spectrum in narrow bands with the ramp and some trends as regressors."""
        if not trends:
            return self._still
        columns = regressors(self.sections, self.dt, trends)
        return regressed(self._still, *self._kept,
                         np.column_stack((*self._columns, columns)))

    @cached_property
    def _columns(self) -> tuple[Array, ...]:
        """Regressors of the trends that stand in every fit."""
        return (regressors(self.sections, self.dt, self.trends),) if self.trends else ()

    @cached_property
    def _still(self) -> Groups:
        """Gather the groups without further trends once: they are asked for again and again."""
        return grouped(*self._kept, *self._columns)

    @cached_property
    def _kept(self) -> tuple[Bins, int, NDArray[np.bool_] | None]:
        """Return the bins, the axis and what is kept of them."""
        if not self.aligned or self.keep is None:
            return self.bins, self.axis, self.keep
        # A bin that is left out weighs nearly nothing where its band has to stay.
        dof = self.bins.dof * np.maximum(self.keep, 1e-15)
        return replace(self.bins, dof=dof), self.axis, None

    def beside(self, trends: Sequence[Waveform]) -> 'RecordSpectrum':
        """Return the same spectrum with further trends that stand in every fit."""
        return replace(self, trends=(*self.trends, *trends))

    def mean(self, sizes: Array) -> Waveform:
        """Return the mean of which a fit beside the trends found the sizes, the ramp's first."""
        def ramp(time: Array) -> Array:
            return time

        return lambda time: np.asarray(sum(size * trend(time) for size, trend in zip(
            sizes.ravel(), (ramp, *self.trends), strict=True)))

    def without_leak(self, mean: Waveform, noise: Array) -> 'RecordSpectrum':
        """
        Take out of the blocks what a mean that moves leaks into them.

        Regressors act on the coefficients of the whole record; a block is shorter, and knows no
        sign. What it holds of the mean is a matter of its slope at both ends. Where that is not
        known well enough beside the noise, shape (bins,), bins are left out. The result is of one
        axis.
        """
        bins, own = self.bins, slice(self.axis, self.axis + 1)
        leak, bound = leaks(self.sections, self.dt, self.duration_s, mean)
        keep = is_little(leak, bound, noise)
        keep = keep if self.keep is None else keep & self.keep
        power = np.maximum(bins.power[own] - leak, 0.0)
        one = replace(bins, power=power, coefficient=bins.coefficient[own],
                      ramp=np.maximum(bins.ramp, 0.0))
        return replace(self, bins=one, axis=0, keep=keep)


def side_by_side(records: Sequence[RecordSpectrum]) -> Groups:
    """Give the spectra of several records of one axis, each with its own mean, as one."""
    return joined_groups([record.groups() for record in records])


def regressors(sections: Sequence[SpectrumSection], dt: float, trends: Sequence[Waveform],
               slowest: int | None = None) -> Array:
    """
    Transform trends of the mean as the record was transformed: X of (7) in docs/statistics.md.

    `sections`: of the record. `dt`: sample interval in seconds. `trends`: each gives a column.
    `slowest`: last index that is wanted; the trends shall be slow themselves. Returns shape
    (bins, trends): for the bins of the same sections, zero outside the whole-record part; or for
    the slowest coefficients of the whole-record parts alone.
    """
    parts = []
    for section in sections:
        if section.coefficients is None:
            if slowest is None:
                parts.append(np.zeros((section.last - section.first, len(trends))))
            continue
        # Enough points for a trend of a few dozen cycles in the record.
        length = section.length if slowest is None else min(section.length, max(1024, slowest + 1))
        last = section.last if slowest is None else min(section.last, slowest + 1)
        middle = (np.arange(length) + 0.5) * (section.length / length)
        time: Array = np.asarray((section.start + middle * section.step) * dt, dtype=np.float64)
        rows = dct(np.stack([trend(time) for trend in trends]), norm='ortho')
        parts.append(rows[:, section.first:last].T * np.sqrt(section.length / length))
    return np.concatenate(parts)


def duration(sections: Sequence[SpectrumSection], dt: float) -> float:
    """Seconds from the beginning of the record to its end; runs are joined end to end."""
    return max(((section.start + section.length * section.step) * dt for section in sections
                if section.coefficients is not None), default=0.0)
