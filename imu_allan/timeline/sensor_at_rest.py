# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What windows of a sensor at rest look like.

A window is told by three statistics of each axis: the power within parts of 20 ms, that of the
differences of their means, and the second difference of window means. These keep noise of every
term stationary and nearly Gaussian however far it drifts, so thresholds follow from the median and
the spread of the past and need no tuning to rate, noise level, quantization or steady vibration.
"""

from dataclasses import dataclass
from functools import cached_property
from math import sqrt

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

_QUIET_PERCENT = 12.5
"""The quietest eighth is taken for rest: with less rest than that, motion enters the baseline."""
_SIGMAS = 8.0
"""Far beyond chance: fewer would cut noise out that is not quite normal. A judgment."""
_LEAST_EXCESS = 0.35
"""Of the loudness, the cube root of a variance: noise that is 1.6 times as large is no motion."""
QUIETER = 3.0 ** (2 / 3)
"""Ratio of loudness, for a third of the noise: rest beside any driving, and no drift of noise."""
_FINE = 0.7
"""Noise over a step from which on the step hides nothing: below, an output may rest for long."""
_ROUNDING = 1e-13
"""Of the mean: a sum of some hundred equal values is off by less, any noise is larger."""
_DITHER = 0.75
"""Of a squared step: an output of whole steps that flips between two has about a quarter."""


@dataclass(frozen=True)
class Baseline:
    """
    What the windows of a sensor at rest look like.

    Attributes
    ----------
    loudness, spread : ndarray, shape (12,)
        Median and robust standard deviation of the loudness of a window, as `describe` gives it.
    wander : ndarray, shape (6,)
        Robust standard deviation of the second difference of window means.
    resolution : ndarray, shape (6,)
        Smallest change between two samples that was seen; infinite while constant.

    """

    loudness: Floats
    spread: Floats
    wander: Floats
    resolution: Floats

    def loudest(self, shorter: float = 1.0) -> Floats:
        """Give the largest loudness at rest; `shorter` is the window over the rows at hand."""
        excess = np.maximum(_SIGMAS * sqrt(shorter) * self.spread,
                            _LEAST_EXCESS * self.loudness)
        stepping = np.cbrt(_DITHER * self._steps() ** 2)
        loudest: Floats = np.maximum(self.loudness + excess, np.tile(stepping, 2))
        return loudest

    @cached_property
    def limits(self) -> tuple[Floats, Floats]:
        """Largest loudness of a whole window, and largest second difference of means, at rest."""
        return self.loudest(), np.maximum(_SIGMAS * self.wander, 3 * self._steps())

    @cached_property
    def far_quieter(self) -> Floats:
        """Loudness below which a window is no rest of this kind, but a deeper one."""
        return self.loudness / QUIETER

    @cached_property
    def any_constant(self) -> bool:
        """Whether an axis has not changed yet."""
        return bool(np.isinf(self.resolution).any())

    def kept_alive(self, before: 'Baseline') -> 'Baseline':
        """Give the baseline with what was known before of axes that stood still all the while."""
        died = (self.loudness == 0) & (before.loudness > 0) & np.tile(
            before.loudness[:6] ** 1.5 >= _FINE * before.resolution, 2)
        if not died.any() or not (self.loudness > 0).any():
            return self
        return Baseline(np.where(died, before.loudness, self.loudness),
                        np.where(died, before.spread, self.spread),
                        np.where(died[:6], before.wander, self.wander), self.resolution)

    def _steps(self) -> Floats:
        """Resolution where the noise does not dither it: there whole steps are no motion."""
        coarse = self.loudness[:6] ** 1.5 < _FINE * self.resolution
        return np.where(coarse, self.resolution, 0.0)


def settle(loudness: Floats, wander: Floats, resolution: Floats) -> tuple[Baseline, Bools]:
    """
    Find the windows at rest, starting from the quietest.

    Parameters
    ----------
    loudness : ndarray, shape (n, 12)
        As `describe` gives it.
    wander : ndarray, shape (n, 6)
        Second difference of window means, NaN at the ends of a stretch.
    resolution : ndarray, shape (6,)
        Smallest change between two samples.

    Returns
    -------
    Baseline
        From the windows at rest.
    ndarray of bool, shape (n,)
        Which they are: the set grows from the quietest eighth as far as the distribution of
        loudness has no hole of many standard deviations.

    """
    dead = _dead(loudness, resolution)
    quiet = np.percentile(loudness, _QUIET_PERCENT, axis=0)
    for axis in [] if dead is None else np.flatnonzero(dead.any(axis=0)).tolist():
        assert dead is not None
        alive = loudness[~dead[:, axis]]
        quiet[axis::6] = np.percentile(alive[:, axis::6], _QUIET_PERCENT, axis=0)
    noisy = quiet > 0
    if noisy.any():
        louder = np.max(loudness[:, noisy] / quiet[noisy], axis=1)
        if dead is not None and not dead.any(axis=1).all():
            # Fewer axes are quieter by chance, and say nothing of those that are dead.
            louder[dead.any(axis=1)] = np.inf
        rest = louder <= np.percentile(louder[np.isfinite(louder)], _QUIET_PERCENT)
    else:
        rest = np.ones(len(loudness), dtype=bool)
    for _ in range(50):
        baseline = baseline_of(loudness[rest], wander[rest], resolution)
        grown = np.all(loudness <= baseline.loudest(), axis=1)
        if np.array_equal(grown, rest):
            break
        rest = grown
    return baseline, rest


def baseline_of(loudness: Floats, wander: Floats, resolution: Floats) -> Baseline:
    """Describe windows at rest; the arguments are those of `settle`."""
    centre, spread, wide = _typical(loudness, wander)
    dead = _dead(loudness, resolution)
    for axis in [] if dead is None else np.flatnonzero(dead.any(axis=0)).tolist():
        assert dead is not None
        alive, own = ~dead[:, axis], slice(axis, None, 6)
        centre[own], spread[own], wide[axis:axis + 1] = _typical(
            loudness[alive, own], wander[alive, axis:axis + 1])
    return Baseline(centre, spread, wide, resolution)


def _typical(loudness: Floats, wander: Floats) -> tuple[Floats, Floats, Floats]:
    """Medians of loudness, of its spread and of the wander, which NaN is unknown of."""
    centre: Floats = np.median(loudness, axis=0)
    spread = 1.4826 * np.median(np.abs(loudness - centre), axis=0)
    known = wander[~np.isnan(wander[:, 0])]
    wide = (1.4826 * np.median(np.abs(known), axis=0) if len(known) >= 4
            else np.full(wander.shape[1], np.inf))
    return centre, spread, wide


def _dead(loudness: Floats, resolution: Floats) -> Bools | None:
    """
    Tell windows in which an axis stood still, shape (n, 6); None if there are none.

    A fine one never does while others live. One that never lived, and coarse steps, are left.
    """
    still = loudness[:, :6] == 0
    if not still.any():
        return None
    dead: Bools = still & ~still.all(axis=1)[:, None] & ~still.all(axis=0)
    for axis in np.flatnonzero(dead.any(axis=0)).tolist():
        noise = float(np.median(loudness[~still[:, axis], axis])) ** 1.5
        dead[:, axis] &= noise >= _FINE * resolution[axis]
    return dead if dead.any() else None


def describe(rows: Floats, part: int) -> tuple[Floats, Floats]:
    """
    Mean and loudness of windows.

    Parameters
    ----------
    rows : ndarray, shape (windows, size, 6)
        Even samples, best axis by axis in memory; NaN columns of absent axes are taken for zero.
    part : int
        Samples in a part of a window.

    Returns
    -------
    means : ndarray, shape (windows, 6)
        Mean of each axis.
    loudness : ndarray, shape (windows, 12)
        Cube root of the variance within parts (six axes), and of that of their means as the
        differences of neighbouring ones tell it. A cube root makes a chi-square nearly normal
        whatever its degrees of freedom.

    """
    windows, size, _ = rows.shape
    axes, parts = rows.transpose(2, 0, 1), size // part
    if part == 1 or parts < 2:
        steps, means = axes[:, :, 1:] - axes[:, :, :-1], axes.mean(axis=2)
        within = slow = _square_sums(steps) * (0.5 / max(size - 1, 1))
    else:
        split = axes[:, :, :parts * part].reshape(6, windows, parts, part)
        coarse = np.matmul(split, np.ones(part)) / part
        own = (split - coarse[..., None]).reshape(6, windows, parts * part)
        within = _square_sums(own) / (parts * (part - 1))
        slow = _square_sums(coarse[:, :, 1:] - coarse[:, :, :-1]) * (0.5 / (parts - 1))
        means = coarse.mean(axis=2)
    means, power = means.T.copy(), np.concatenate([within, slow]).T.copy()
    # The mean of equal values is that value but for rounding, which is no noise.
    power[power < (_ROUNDING * np.tile(means, 2)) ** 2] = 0.0
    if np.isnan(means[-1]).any():
        np.nan_to_num(means, copy=False)
        np.nan_to_num(power, copy=False)
    return means, np.cbrt(power)


def _square_sums(values: Floats) -> Floats:
    """Sum the squares of the values of every axis and window, shape (6, windows)."""
    return np.asarray(np.einsum('awi,awi->aw', values, values))


def resolution_of(samples: Floats) -> Floats:
    """
    Smallest change between neighbouring samples, per axis.

    Parameters
    ----------
    samples : ndarray, shape (n, 6)
        Even samples.

    Returns
    -------
    ndarray, shape (6,)
        Infinite for an axis that does not change.

    """
    change = np.abs(np.diff(samples, axis=0))
    change[change == 0] = np.inf
    smallest: Floats = np.min(change, axis=0, initial=np.inf)
    return smallest
