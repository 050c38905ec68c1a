# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Prepare grouped spectra of several axes for the posterior, in units of detection limits."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from imu_allan.arrays import Array
from imu_allan.noise.posterior import likelihood
from imu_allan.noise.posterior.likelihood import ALPHA, AT_OUTPUT, N, PLAIN, Spectra
from imu_allan.noise.posterior.maximum import maximise
from imu_allan.noise.posterior.regression import about_mean, regressors
from imu_allan.noise.posterior.shapes import FEWEST_GROUPS, FREE_SHAPES, Table, tables, TERM_SHAPES
from imu_allan.noise.posterior.thresholds_and_priors import LEAK_KNOWN
from imu_allan.noise.record.groups import Groups
import numpy as np

_KEYS = [shape.key for shape in TERM_SHAPES]
_COLUMNS = [_KEYS.index(shape.like or shape.key) for shape in TERM_SHAPES]
"""Column of the design for each term: its own, or that of the term in `like`."""
_FREE_COLUMNS = [_KEYS.index(shape.like) for shape in FREE_SHAPES]
"""The same for each free term."""


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
    slower = np.stack([of_slower_half(one) for one in groups])
    power, level = map(np.stack, zip(*map(_power_and_level, groups, slower), strict=True))
    nu, frequency = np.minimum(groups[0].frequency * dt, 0.5), groups[0].frequency
    design = np.stack([_designed(one, nu) for one in groups])
    nominal_dof = np.stack([one.dof for one in groups])
    passed = _passed(nu, design[:, N], nominal_dof, power, level, slower[:, N])
    # Groups with less than half of the power in the pass band count as filtered.
    stopped = passed < 0.5
    uncertainty = np.where(stopped, LEAK_KNOWN / passed, 0.0)
    dof = nominal_dof / (1 + nominal_dof * uncertainty**2 / 2)
    # A filter attenuates noise of the sensor together with what hides it, but not output noise.
    information = nominal_dof / 2 / (level / np.where(stopped, passed, 1.0))**2
    of_term = np.where(AT_OUTPUT[:, None], (nominal_dof / 2 / level**2)[:, None],
                       information[:, None])
    squared_limit = 1 / np.sqrt(np.einsum('atg,atg->at', design**2, of_term))
    every = tables(nu, groups[0].step, groups[0].length)
    log_effect = _log_effect(design, nu, dt)
    free_log_limits, free_tables = zip(*(
        _free_term(table, log_effect[:, k], information)
        for k, table in enumerate(every.terms)), strict=True)
    spectra = Spectra(
        frequency, nu, dof, power, nominal_dof, design * squared_limit[:, :, None],
        np.sqrt(squared_limit), log_effect, free_log_limits, free_tables,
        _gentlest_corner(nu, design[:, N], information, nominal_dof), regressors(groups),
        groups[0].records, every, likelihood.unexplained_losses(frequency, dof, power))
    return spectra, list(map(_start, groups, squared_limit, level, slower))


def _power_and_level(groups: Groups, slower: Array) -> tuple[Array, Array]:
    """Return the power without the ramp in blocks, and the smoothed noise about the mean."""
    first = maximise(groups, detrend=True, tolerance=1e-3)
    # A stop band passes for the end of a steep slope, so that all groups together give far too
    # strong a random walk.
    expected = np.maximum(np.minimum(groups.design @ first.theta, groups.design @ slower), 1e-300)
    about = about_mean(groups)(expected)
    white = groups.design[:, N]
    # Lower power is only rounding error, or underflows when squared.
    rounding = white * max(1e-24 * float((groups.power / white).max()), 1e-100)
    return (np.maximum(about.blocks, rounding),
            np.maximum(smoothed(groups, about.noise, expected), rounding))


def _designed(groups: Groups, nu: Array) -> Array:
    """Return the power of every term with coefficient 1, shape (terms, groups)."""
    # The record affects a term without a column of its own like the term in `like`.
    ratio = np.stack([shape.power(nu, 0.0) / TERM_SHAPES[column].power(nu, 0.0)
                      for shape, column in zip(TERM_SHAPES, _COLUMNS, strict=True)])
    return groups.design[:, _COLUMNS].T * ratio


def _log_effect(design: Array, nu: Array, dt: float) -> Array:
    """Return the effect of gaps and record ends on free terms, as in `Spectra`."""
    # White noise of unit density has a power of 1/dt; flicker is the same at every rate.
    undisturbed = np.stack([TERM_SHAPES[column].power(nu, 0.0) * (1 / dt if column == N else 1.0)
                            for column in _FREE_COLUMNS])
    return np.asarray(np.log(np.maximum(design[:, _FREE_COLUMNS] / undisturbed, 1e-300)))


def smoothed(groups: Groups, power: Array, expected: Array) -> Array:
    """
    Return the power smoothed over an octave, which determines the detection limits.

    A few coefficients may be small by chance, so the fitted terms count as four more.
    """
    white = groups.design[:, N]
    octave = np.log2(groups.frequency)
    low = np.searchsorted(octave, octave - 0.5)
    high = np.searchsorted(octave, octave + 0.5, 'right')

    def over_octave(values: Array) -> Array:
        total = np.concatenate(([0.0], np.cumsum(values)))
        return np.asarray(total[high] - total[low])

    return np.asarray((over_octave(groups.dof * power / white) + 4 * expected / white)
                      / (over_octave(groups.dof) + 4) * white)


def _passed(nu: Array, white: Array, dof: Array, power: Array, level: Array, least: Array
            ) -> Array:
    """
    Return the power of groups relative to that of white noise in the pass band.

    Shapes are (spectra, groups). `least`, shape (spectra,): white noise of the slower half of the
    groups.
    """
    relative = level / white
    pass_band = nu < 0.1 if (nu < 0.1).any() else nu <= nu[0]
    reference = np.median(relative[:, pass_band][:, -FEWEST_GROUPS:], axis=1)
    # The pass band of a very slow filter may lie below all of these.
    reference = np.maximum(reference, least)
    passed = np.where(dof > 100, power, level) / white / reference[:, None]
    # No low-pass attenuates what lies below a peak, such as noise below a rising quantization. A
    # level top is no peak: what lies below it may be behind a high-pass.
    below_peak = (np.arange(len(nu)) < relative.argmax(axis=1)[:, None]) & (
        relative.max(axis=1) > 2 * reference)[:, None]
    return np.where(below_peak, 1.0, np.maximum(passed, 1e-9))


def _free_term(table: Table, log_effect: Array, information: Array) -> tuple[Array, Table]:
    """Return the log detection limits of a free term and its power there, as in `Spectra`."""
    spectra, groups = log_effect.shape
    rows = table.rows + log_effect[:, None]
    log_limit = -0.25 * np.log(np.einsum('akg,ag->ak', np.exp(2 * rows), information))
    return log_limit, replace(
        table.select(np.zeros(spectra, np.int64)), start=np.arange(spectra) * table.count[0],
        rows=(rows + 2 * log_limit[:, :, None]).reshape(-1, groups))


def _gentlest_corner(nu: Array, white: Array, information: Array, dof: Array) -> Array:
    """Return the log corner of the gentlest roll-off that can be detected, by spectrum."""
    # An exponential average attenuates by this over the square of its corner.
    bend = np.sin(np.pi * nu)**2
    weight = white**2 * information
    mean = (weight @ bend) / weight.sum(axis=1)
    contrast = np.sqrt(np.einsum('ag,ag->a', dof / 2, (bend - mean[:, None])**2))
    return np.asarray(0.5 * np.log(np.maximum(contrast, 4.0)))


def of_slower_half(groups: Groups) -> Array:
    """Fit squared coefficients to the slower half of the groups, which no low-pass attenuates."""
    count = len(groups.frequency)
    below = groups.frequency[min(max(FEWEST_GROUPS, count // 2), count - 1)]
    return maximise(groups.below(below), fixed={0: 0.0}, detrend=True, tolerance=1e-2).theta


def _start(groups: Groups, squared_limit: Array, level: Array, slower: Array) -> Start:
    """Start from the fit of the terms to the slower half of the groups."""
    x = np.zeros(likelihood.SLOTS)
    white = level / groups.design[:, N]
    theta = slower[_COLUMNS]
    theta[N] = max(theta[N], float(np.quantile(white, 0.05)))
    # Start no term below its detection limit.
    x[:PLAIN] = 0.5 * np.log(np.maximum(theta / squared_limit, 1.5))
    x[ALPHA] = 1.0
    return Start(x, white)
