# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Prepare grouped spectra of several axes for the posterior, in units of detection limits."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from imu_allan.arrays import Array
from imu_allan.noise.posterior import likelihood
from imu_allan.noise.posterior.likelihood import ALPHA, AMPLITUDES, AT_OUTPUT, N, PLAIN, Spectra
from imu_allan.noise.posterior.maximum import maximise
from imu_allan.noise.posterior.regression import about_mean, regressors
from imu_allan.noise.posterior.shapes import FEWEST_GROUPS, FREE_SHAPES, Table, tables, TERM_SHAPES
from imu_allan.noise.posterior.thresholds_and_priors import LEAK_KNOWN
from imu_allan.noise.record.groups import Groups
import numpy as np

_KEYS = [shape.key for shape in TERM_SHAPES]
_COLUMNS = [_KEYS.index(shape.like or shape.key) for shape in TERM_SHAPES]
"""Column of the design for each term: its own, or that of the term in `like`."""


class Start(NamedTuple):
    """Starting point of the fits of one axis."""

    x: Array    # (SLOTS,): parameters of a row
    white: Array    # (groups,): smoothed power relative to white noise of unit density


def prepared(groups: Sequence[Groups], dt: float) -> tuple[Spectra, list[Start]]:
    """
    Prepare the spectra of several axes over the same bands.

    `groups`: spectra with the ramp as a regressor, and others where the mean follows a
    thermometer. `dt`: sample interval in seconds. Returns: also where the fits of each axis start.
    """
    power, levels, slower = [], [], []
    for one in groups:
        first = maximise(one, detrend=True, tolerance=1e-3)
        slower.append(of_slower_half(one))
        # A stop band passes for the end of a steep slope, so that all groups together give far
        # too strong a random walk.
        expected = np.maximum(np.minimum(one.design @ first.theta, one.design @ slower[-1]),
                              1e-300)
        about = about_mean(one)(expected)
        white = one.design[:, N]
        # Lower power is only rounding error, or underflows when squared.
        rounding = white * max(1e-24 * float((one.power / white).max()), 1e-100)
        power.append(np.maximum(about.blocks, rounding))
        levels.append(np.maximum(smoothed(one, about.noise, expected), rounding))
    level = np.stack(levels)
    nu = np.minimum(groups[0].frequency * dt, 0.5)
    ratio = np.stack([shape.power(nu, 0.0) / TERM_SHAPES[own].power(nu, 0.0)
                      for shape, own in zip(TERM_SHAPES, _COLUMNS, strict=True)])
    design = np.stack([one.design[:, _COLUMNS].T * ratio for one in groups])
    whole = np.stack([one.dof for one in groups])
    passed = _passed(groups[0].frequency * dt, design[:, N], whole, np.stack(power), level,
                     np.array([theta[N] for theta in slower]))
    # Groups with less than half of the power in the pass band count as filtered.
    stopped = passed < 0.5
    uncertainty = np.where(stopped, LEAK_KNOWN / passed, 0.0)
    dof = whole / (1 + whole * uncertainty**2 / 2)
    # A filter attenuates noise of the sensor together with what hides it, but not output noise.
    information = whole / 2 / (level / np.where(stopped, passed, 1.0))**2
    seen = np.where(AT_OUTPUT[:, None], (whole / 2 / level**2)[:, None], information[:, None])
    unit = 1 / np.sqrt(np.einsum('atg,atg->at', design**2, seen))
    table = tables(nu, groups[0].step, groups[0].length)
    like = np.stack([np.log(np.maximum(
        design[:, _KEYS.index(shape.like)]
        / (TERM_SHAPES[_KEYS.index(shape.like)].power(nu, 0.0) * _scale(shape.like, dt)), 1e-300))
        for shape in FREE_SHAPES], axis=1)
    sizes = tuple(_just_seen(own, like[:, k], information) for k, own in enumerate(table.terms))
    free = tuple(_in_units(own, like[:, k], sizes[k]) for k, own in enumerate(table.terms))
    spectra = Spectra(
        groups[0].frequency, dof, np.stack(power), whole, design * unit[:, :, None],
        np.sqrt(unit), like, sizes, free, _gentlest(nu, design[:, N], information, whole),
        regressors(groups), groups[0].records, table,
        likelihood.unexplained_losses(groups[0].frequency, dof, np.stack(power)))
    return spectra, [_start(*each) for each in zip(groups, unit, level, slower, strict=True)]


def _scale(key: str, dt: float) -> float:
    """Return the power of a term at sample interval `dt`, relative to an interval of 1 s."""
    return {'noise_density': 1 / dt, 'bias_instability': 1.0}[key]


def smoothed(groups: Groups, power: Array, expected: Array) -> Array:
    """
    Return the power smoothed over an octave, which determines the detection limits.

    A few coefficients may be small by chance, so the fitted terms count as four more.
    """
    white = groups.design[:, N]
    octave = np.log2(groups.frequency)
    low = np.searchsorted(octave, octave - 0.5)
    high = np.searchsorted(octave, octave + 0.5, 'right')

    def between(values: Array) -> Array:
        total = np.concatenate(([0.0], np.cumsum(values)))
        return np.asarray(total[high] - total[low])

    return np.asarray((between(groups.dof * power / white) + 4 * expected / white)
                      / (between(groups.dof) + 4) * white)


def _passed(nu: Array, white: Array, dof: Array, power: Array, level: Array, least: Array
            ) -> Array:
    """
    Return the power of groups relative to that of white noise in the pass band.

    `least`, shape (spectra,): white noise of the slower half of the groups.
    """
    passed = np.where(dof > 100, power, level) / white
    pass_band = nu < 0.1 if (nu < 0.1).any() else nu <= nu[0]
    reference = np.median((level / white)[:, pass_band][:, -FEWEST_GROUPS:], axis=1)
    # The pass band of a very slow filter may lie below all of these.
    reference = np.maximum(reference, least)
    passed = np.maximum(passed / reference[:, None], 1e-9)
    # No low-pass attenuates what lies below the peak, such as noise below a rising quantization.
    return np.where(np.arange(len(nu)) < (level / white).argmax(axis=1)[:, None], 1.0, passed)


def _just_seen(table: Table, like: Array, information: Array) -> Array:
    """Return the log detection limit of a free term, shape (spectra, grid points)."""
    squares = np.exp(2 * (table.rows[None] + like[:, None]))
    return np.asarray(-0.25 * np.log(np.einsum('akg,ag->ak', squares, information)))


def _in_units(table: Table, like: Array, size: Array) -> Table:
    """Return the power of a free term at its detection limit, one shape per spectrum."""
    of = np.zeros(len(like), np.int64)
    rows = table.rows + like[:, None] + 2 * size[:, :, None]
    return replace(table.select(of), rows=rows.reshape(-1, like.shape[1]),
                   start=np.arange(len(like)) * table.count[0])


def _gentlest(nu: Array, white: Array, information: Array, dof: Array) -> Array:
    """Return the log corner of the gentlest roll-off that can be detected, by spectrum."""
    bend = np.sin(np.pi * nu)**2
    weight = white**2 * information
    mean = (weight @ bend) / weight.sum(axis=1)
    seen = np.sqrt(np.einsum('ag,ag->a', dof / 2, (bend - mean[:, None])**2))
    return np.asarray(0.5 * np.log(np.maximum(seen, 4.0)))


def of_slower_half(groups: Groups) -> Array:
    """Fit squared coefficients to the slower half of the groups, which no low-pass attenuates."""
    count = len(groups.frequency)
    below = groups.frequency[min(max(FEWEST_GROUPS, count // 2), count - 1)]
    return maximise(groups.below(below), fixed={0: 0.0}, detrend=True, tolerance=1e-2).theta


def _start(groups: Groups, unit: Array, level: Array, slower: Array) -> Start:
    """Start from the fit of the terms to the slower half of the groups."""
    x = np.zeros(likelihood.SLOTS)
    white = level / groups.design[:, N]
    theta = slower[_COLUMNS]
    theta[N] = max(theta[N], float(np.quantile(white, 0.05)))
    # Start no term below its detection limit.
    x[AMPLITUDES[:PLAIN]] = 0.5 * np.log(np.maximum(theta / unit, 1.5))
    x[ALPHA] = 1.0
    return Start(x, white)
