# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether the slow part of a signal was taken out, as by a filter that subtracts a bias it estimates.

The density of a sensor never falls towards low frequencies: every term that a sensor has is level
there or rises, but for quantization noise, which has no level part above it. Behind a filter that
subtracts a moving estimate of the bias (``imu_complementary_filter``, and sensors that calibrate
their zero while they rest), the level of the white noise falls by the square of the frequency.
Flicker falls as well, and hides the level: there the terms behind such a filter are held against
the terms as they are, by their likelihood. Where that leaves open whether there is one, the slow
coefficients hold with it and without.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from imu_allan.noise import chi_square
from imu_allan.noise.correlated import falls_short, likeliest_process
from imu_allan.noise.fit import Fit
from imu_allan.noise.groups import FLICKER, Groups, QUANTIZATION, WALK
from imu_allan.noise.intervals import CI95, crossing, Estimate, estimate
from imu_allan.noise.likelihood import maximise, Solution
from imu_allan.noise.minimum import lowest_near
from imu_allan.noise.power_law import likeliest_exponent
from imu_allan.noise.trial import fit_columns, OBSERVABLE, start_in_band, Trial
from imu_allan.noise.walk_in_parts import either
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_LEVEL_OCTAVES = 3
"""Above the corner, where the density has to be level; quantization noise alone has none."""
_LEVEL = 1.4
"""Ratio of the density in these octaves to their mean, either way, that is level."""
_BELOW = 4.0
"""Part of the corner from which on downwards the density is looked at: it is a 17th there."""
_FALLS = 2.0
"""Ratio of the density in the octave below that to what is slower yet: 7 behind such a filter, 1
where a vibration stands above the floor."""
_CERTAIN = 1e-6
"""Chance at which white noise holds as little, at one corner: of a million axes one."""
_FALLEN = 0.25
"""Of the highest octave, in the lowest one, before anything is looked at: it is a 17th or less."""
_ENOUGH = 12.0
"""Degrees of freedom of an octave that is looked at: by chance 1 in 200 is as low."""
_CLEAR = 3.0
"""Standard errors of the logarithm of a ratio."""
_HIGHEST_HZ = 1.0
"""Corner: what follows a bias is slower, 0.16 Hz by default; vibrations above a quiet floor, which
look alike, stand higher."""
_CORNERS_PER_OCTAVE = 4
"""Corners that are tried; half a step of it is a ratio of 1.09."""
_OBSERVABLE_CORNER = 12.0
"""
Likelihood ratio of a corner beside flicker, one parameter that is chosen from several decades.
docs/statistics.md has the shares of filters that are told at it, and of sensors without one.
"""
_OVER_EXPONENT = 5.0
"""
Likelihood ratio to another exponent without a filter, which has as many parameters: what falls
short of such noise by chance fits flicker behind a filter, too.
"""
_FALLING_SHORT = 0.25
"""Chance at which the slowest coefficients are as small, from which on a corner is looked for."""
_CORNERS = 16
"""From the slowest coefficient to `_HIGHEST_HZ`; the best is refined."""
_ERROR = 0.2
"""Of the logarithm of a corner, where the search for the end of its interval begins."""
_LEAST = 1e-4
"""Of what is passed: a filter that starts leaves something."""


def high_pass_corner_hz(frequency: Array, density: Array, dof: Array) -> float | None:
    """
    Find the corner of a first-order high-pass in white noise.

    Parameters
    ----------
    frequency : ndarray, shape (bands,)
        Of narrow bands, in Hz, in any order.
    density : ndarray, shape (bands,)
        Of the signal in them.
    dof : ndarray, shape (bands,)
        Degrees of freedom of each.

    Returns
    -------
    float or None
        In Hz; None where the density does not fall as behind such a filter.

    Examples
    --------
    >>> f = np.geomspace(1e-3, 50, 200)
    >>> corner_hz = high_pass_corner_hz(f, f**2 / (f**2 + 0.16**2), np.full(200, 8.0))
    >>> 0.16 / 1.5 < corner_hz < 0.16 * 1.5
    True
    >>> high_pass_corner_hz(f, 1 + 0.01 / f, np.full(200, 8.0)) is None
    True

    """
    positive = frequency > 0
    frequency, density, dof = frequency[positive], density[positive], dof[positive]
    if len(frequency) < 2:
        return None

    def mean(of: Array, low: float, high: float) -> tuple[float, float]:
        chosen = (frequency > low) & (frequency <= high)
        weight = float(dof[chosen].sum())
        return (float((of[chosen] * dof[chosen]).sum()) / weight if weight else np.nan), weight

    if not _falls_somewhere(frequency, density, dof):
        return None
    octaves = np.log2(frequency.max() / frequency.min()) - _LEVEL_OCTAVES - 1
    corners, clear = [], []
    for step in range(int(max(octaves, 0) * _CORNERS_PER_OCTAVE)):
        corner = float(frequency.max()) / 2**(_LEVEL_OCTAVES + 1 + step / _CORNERS_PER_OCTAVE)
        if corner > _HIGHEST_HZ:
            continue
        top = corner * 2**(_LEVEL_OCTAVES + 1)
        level, _ = mean(density, 2 * corner, top)
        above = [mean(density, corner * 2**octave, corner * 2**(octave + 1))[0]
                 for octave in range(1, _LEVEL_OCTAVES + 1)]
        if not (level > 0 and all(1 / _LEVEL < each / level < _LEVEL for each in above)):
            continue
        low, low_dof = mean(density, 0.0, corner / _BELOW)
        upper, upper_dof = mean(density, corner / (2 * _BELOW), corner / _BELOW)
        lower, lower_dof = mean(density, 0.0, corner / (2 * _BELOW))
        if not (lower_dof and upper_dof):
            continue
        if (chi_square.survival(low_dof * low / level, low_dof) > 1 - _CERTAIN
                and np.log(upper / max(lower, 1e-300) / _FALLS)
                > _CLEAR * np.sqrt(2 / upper_dof + 2 / lower_dof)):
            clear.append(corner)
        # How likely it is, where all above it is as it is.
        chosen = frequency <= top
        expected = level * (frequency**2 / (frequency**2 + corner**2))[chosen] + lower
        corners.append((float(
            (dof[chosen] * (density[chosen] / expected + np.log(expected))).sum()
            + (dof[~chosen] * (1 + np.log(density[~chosen].clip(1e-300)))).sum()), corner))
    # What is clear is so at a corner that is too high, too, below which more is seen.
    return min((each for each in corners if clear
                and min(clear) / 2**_LEVEL_OCTAVES <= each[1] <= max(clear)),
               default=(0.0, None))[1]


def _falls_somewhere(frequency: Array, density: Array, dof: Array) -> bool:
    """Whether an octave holds clearly less than one above it, which costs little to know."""
    octave = np.floor(np.log2(frequency)).astype(np.int64)
    octave -= octave.min()
    weight = np.bincount(octave, dof)
    known = weight >= _ENOUGH
    means = np.bincount(octave, dof * density)[known] / weight[known]
    if len(means) < 2:
        return False
    # The highest of those above each of them.
    above = np.maximum.accumulate(means[::-1])[::-1][1:]
    return bool((means[:-1] < _FALLEN * above).any())


@dataclass(frozen=True)
class HighPass:
    """
    A first-order high-pass that white noise and flicker may have come through.

    Attributes
    ----------
    corner_hz : float
    certain : bool
        Whether they have. Otherwise they may have.
    behind : Trial
        The terms behind it; where it is not certain, behind one at the upper end of the 95 %
        interval of its corner.

    """

    corner_hz: float
    certain: bool
    behind: Trial

    def with_and_without(self, estimates: Mapping[str, Estimate]) -> dict[str, Estimate]:
        """Make the slow terms hold behind the filter, too."""
        return {**estimates, **{
            key: either(estimates[key], estimate(self.behind, column))
            for key, column in (('bias_instability', FLICKER), ('rate_random_walk', WALK))}}


def high_pass_beside_flicker(groups: Groups, dt: float, found: Fit) -> HighPass | None:
    """
    Find a first-order high-pass in white noise and flicker.

    Parameters
    ----------
    groups : Groups
        The spectrum of an axis without lines.
    dt : float
        Sample interval in seconds.
    found : Fit
        What it says without such a filter.

    Returns
    -------
    HighPass or None
        None where a filter makes the data hardly likelier, a Gauss-Markov process or another
        exponent makes it likelier yet by far, or the terms behind the filter do not describe it.

    """
    assert found.trial is not None
    if (found.gauss_markov is None and found.power_law is None
            and not falls_short(found.trial, _FALLING_SHORT)):
        return None
    plain = maximise(groups, start_in_band(found.trial, rolling=False), fixed={QUANTIZATION: 0.0},
                     trend='restricted')
    promising = plain.loss - OBSERVABLE / 4
    near: Solution = plain

    def loss(log_corner: float, limit: float = np.inf) -> float:
        nonlocal near
        # A walk behind such a filter is a Gauss-Markov process, of which a sensor may have one.
        near = maximise(_passed(groups, float(np.exp(log_corner))), near,
                        fixed={QUANTIZATION: 0.0, WALK: 0.0}, trend='restricted', tolerance=1e-3,
                        limit=limit)
        return near.loss

    lowest = float(groups.frequency[0])
    if lowest >= _HIGHEST_HZ:
        return None
    corners = np.linspace(np.log(lowest), np.log(_HIGHEST_HZ), _CORNERS)
    losses = [loss(corner, promising) for corner in corners]
    best = int(np.argmin(losses))
    if losses[best] > promising:
        return None
    log_corner, least = lowest_near(loss, corners, best, 1e-2)
    gain = 2 * (plain.loss - least)
    if gain < OBSERVABLE:
        return None
    corner = float(np.exp(log_corner))
    behind = fit_columns(_passed(groups, corner), None, False, near)
    if not behind.described:
        return None
    # These two take the longest.
    over_process = 2 * (likeliest_process(groups, dt, plain) - least)
    if over_process < -OBSERVABLE:
        return None
    over_exponent = 2 * (likeliest_exponent(groups, dt, plain) - least)
    if over_exponent < -OBSERVABLE:
        return None
    if gain >= _OBSERVABLE_CORNER and over_process >= 0 and over_exponent >= _OVER_EXPONENT:
        return HighPass(corner, True, behind)

    def rise(distance: float) -> float:
        return 2 * max(loss(log_corner + distance) - least, 0.0)

    # A filter has taken out the more the higher it stands.
    highest = np.exp(log_corner + crossing(rise, 0.0, _ERROR, CI95))
    behind = fit_columns(_passed(groups, min(float(highest), _HIGHEST_HZ)), None, False, near)
    return HighPass(corner, False, behind)


def _passed(groups: Groups, corner_hz: float) -> Groups:
    """Return the groups with all terms behind a first-order high-pass."""
    square = groups.frequency**2
    passed = np.maximum(square / (square + corner_hz**2), _LEAST)
    return groups.with_design(groups.design * passed[:, None])
