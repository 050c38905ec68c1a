# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Bins of one axis, averaged over narrow bands for the likelihood.

A group is a band in which the spectra of the terms hardly change, so that mean power and degrees
of freedom represent its bins. The slowest coefficients of a record stay single. The ramp and other
regressors of the mean are included as products with the coefficients. These exist only for the
whole record, since blocks keep only power.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

from imu_allan.arrays import Array, Bools, Ints
from imu_allan.noise.record.bins import Bins, narrow_bands
import numpy as np

QUANTIZATION, WHITE, FLICKER, RANDOM_WALK = range(4)
"""Columns of a design: the four terms that have a spectrum."""
LEAST_OF_BLOCKS = 1e-3
"""Least share of the power of blocks that remains after a ramp is subtracted, which may exceed it
by chance."""


@dataclass(frozen=True)
class Groups:
    """Bins of one axis gathered into narrow bands; fields as in `Bins`, for one axis."""

    # (groups,)
    frequency: Array
    dof: Array
    power: Array
    design: Array    # (groups, columns)
    step: Array
    length: Array
    # Each record has its own regressors of the mean.
    ramp: Array    # (groups, records)
    # (groups, records, regressors): mean of coefficient times regressor; zero in blocks
    along: Array
    # (groups, records, regressors, regressors): mean products of the regressors
    among: Array

    @property
    def records(self) -> int:
        """Return the number of records."""
        return len(self.along[0])

    def below(self, frequency_hz: float) -> 'Groups':
        """Return the groups up to a frequency, inclusive."""
        return self.select(self.frequency <= frequency_hz)

    def select(self, which: Bools | Ints) -> 'Groups':
        """Return a selection of the groups, by mask or by index."""
        return Groups(*(part[which] for part in vars(self).values()))

    def half_octaves(self) -> tuple[Ints, Array]:
        """Return the half-octave of each group, and the degrees of freedom of each half-octave."""
        _, octave = np.unique(np.floor(2 * np.log2(self.frequency)), return_inverse=True)
        return octave.astype(np.int64), np.bincount(octave, self.dof).astype(np.float64)

    def capped(self, spread: Array | float) -> 'Groups':
        """Limit the degrees of freedom of each half-octave to what a relative spread allows."""
        octave, dof = self.half_octaves()
        return replace(self, dof=self.dof / (1 + dof[octave] * spread**2 / 2))


def grouped(bins: Bins, axis: int, keep: Bools | None = None,
            regressors: Array | None = None, *, known: Groups | None = None) -> Groups:
    """
    Average the bins of one axis over bands of an eighth of an octave.

    `bins`: the spectrum of all axes. `keep`, shape (bins,): False excludes a bin. `regressors`,
    shape (bins, n): coefficients of trends of the mean, zero outside the whole-record part. The
    ramp is always the first regressor and not part of them. `known`: groups of the same bins with
    other regressors, if they exist already. Returns: groups in which the lowest 48 coefficients of
    every whole-record part stay single.
    """
    band, weight = bins.band, bins.dof if keep is None else bins.dof * keep
    total: Array = np.bincount(band, weight).astype(np.float64)
    there = np.flatnonzero(total > 0)
    there = there[np.argsort(np.bincount(band, weight * bins.frequency)[there] / total[there])]
    whole = np.flatnonzero(bins.whole)

    def mean(values: Array, at: Ints | slice = slice(None)) -> Array:
        """Average over bands, in order of frequency; values are zero except in the bins `at`."""
        sums = np.bincount(band[at], weight[at] * values, len(total))
        return np.asarray(sums[there] / total[there])

    columns = [bins.of_ramp[whole], *([] if regressors is None else regressors[whole].T)]
    along = np.stack([mean(bins.coefficient[axis, whole] * column, whole) for column in columns],
                     axis=1)[:, None]
    among = np.empty((len(there), 1, len(columns), len(columns)))
    for i, one in enumerate(columns):
        for j, other in enumerate(columns[:i + 1]):
            among[:, 0, i, j] = among[:, 0, j, i] = mean(one * other, whole)
    if known is not None:
        return replace(known, along=along, among=among)
    return Groups(mean(bins.frequency), total[there], mean(bins.power[axis]),
                  np.stack([mean(column) for column in bins.design.T], axis=1),
                  mean(bins.step), mean(bins.length), mean(bins.ramp)[:, None], along, among)


def padded(parts: Sequence[Groups]) -> list[Groups]:
    """Return groups with as many regressors each: behind the ramp, some have more that are 0."""
    most = max(part.along.shape[2] for part in parts)
    found = []
    for part in parts:
        missing = np.ones(most - part.along.shape[2], dtype=np.int64)
        among = np.insert(np.insert(part.among, missing, 0.0, axis=2), missing, 0.0, axis=3)
        found.append(replace(part, along=np.insert(part.along, missing, 0.0, axis=2), among=among))
    return found


def joined_groups(parts: Sequence[Groups], *, apart: bool = False) -> Groups:
    """
    Join the spectra of several records, which share the noise but have regressors of their own.

    `parts`: groups of each record. Returns: groups in order of frequency. As in one record, all
    but the 48 slowest are averaged over narrow bands; with `apart`, none are.
    """
    if len(parts) == 1:
        return parts[0]
    every, records = padded(parts), np.cumsum([0, *(part.records for part in parts)])
    frequency, dof, step, of_ramp = (np.concatenate(values) for values in zip(*(
        (part.frequency, part.dof, part.step, part.ramp.min(axis=1)) for part in parts),
        strict=True))
    band = np.arange(len(dof)) if apart else narrow_bands(frequency, step, of_ramp >= 0)
    total: Array = np.bincount(band, dof).astype(np.float64)
    bands = np.split(band, np.cumsum([len(part.dof) for part in parts])[:-1])

    def mean(name: str) -> Array:
        """Average over bands; what belongs to a record is zero for the others."""
        values = [getattr(part, name) for part in every]
        own = name in ('ramp', 'along', 'among')
        shape = (int(records[-1]), *values[0].shape[2:]) if own else values[0].shape[1:]
        sums = np.zeros((len(total), *shape))
        for part, value, at, first, last in zip(
                every, values, bands, records[:-1], records[1:], strict=True):
            weighted = (part.dof * value.T).T
            np.add.at(sums[:, first:last] if own else sums, at, weighted)
        return np.asarray((sums.T / total).T)

    joined = replace(Groups(*(mean(field.name) for field in fields(Groups))), dof=total)
    return joined.select(np.argsort(joined.frequency, kind='stable'))
