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
from itertools import pairwise

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
    # (groups, records, regressors, regressors): mean products of the regressors with each other
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
        _, octave = np.unique(half_octaves(self.frequency), return_inverse=True)
        return octave.astype(np.int64), np.bincount(octave, self.dof).astype(np.float64)

    def capped(self, spread: Array | float) -> 'Groups':
        """Limit the degrees of freedom of each half-octave to what a relative spread allows."""
        octave, dof = self.half_octaves()
        return replace(self, dof=self.dof / (1 + dof[octave] * spread**2 / 2))


def half_octaves(frequency: Array) -> Ints:
    """Return the half-octave of each group: 0 for the highest, negative below."""
    # Four eighths of an octave each, below the highest: the ends lie halfway between two eighths.
    return np.asarray(np.floor(2 * np.log2(frequency / frequency[-1:]) + 1 / 8), np.int64)


def grouped(bins: Bins, axis: int, keep: Bools | Array | None = None,
            regressors: Array | None = None, *, known: Groups | None = None) -> Groups:
    """
    Average the bins of one axis over bands of an eighth of an octave.

    `bins`: the spectrum of all axes. `keep`, shape (bins,): 0 or False excludes a bin, a share
    reduces its weight. `regressors`, shape (bins, n): coefficients of trends of the mean, zero
    outside the whole-record part. The ramp is always the first regressor and not part of them.
    `known`: groups of the same bins with other regressors, if they exist already. Returns: groups
    in which the 48 slowest coefficients of the whole-record parts stay single.
    """
    band, weight = bins.band, bins.dof if keep is None else bins.dof * keep
    dof: Array = np.bincount(band, weight).astype(np.float64)
    used = np.flatnonzero(dof > 0)
    used = used[np.argsort(np.bincount(band, weight * bins.frequency)[used] / dof[used])]
    whole = np.flatnonzero(bins.whole)

    def mean(values: Array, where: Ints | slice = slice(None)) -> Array:
        """Average over bands, in order of frequency; `where`: bins of the values, else zero."""
        sums = np.bincount(band[where], weight[where] * values, len(dof))
        return np.asarray(sums[used] / dof[used])

    columns = [bins.of_ramp[whole], *([] if regressors is None else regressors[whole].T)]
    along = np.stack([mean(bins.coefficient[axis, whole] * column, whole) for column in columns],
                     axis=1)[:, None]
    among = np.empty((len(used), 1, len(columns), len(columns)))
    for i, column in enumerate(columns):
        for j, other in enumerate(columns[:i + 1]):
            among[:, 0, i, j] = among[:, 0, j, i] = mean(column * other, whole)
    if known is not None:
        return replace(known, along=along, among=among)
    return Groups(mean(bins.frequency), dof[used], mean(bins.power[axis]),
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
    parts = padded(parts)
    frequency, part_dof, step, ramp = (np.concatenate(values) for values in zip(*(
        (part.frequency, part.dof, part.step, part.ramp.min(axis=1)) for part in parts),
        strict=True))
    band = np.arange(len(part_dof)) if apart else narrow_bands(frequency, step, ramp >= 0)
    dof: Array = np.bincount(band, part_dof).astype(np.float64)
    bands = np.split(band, np.cumsum([len(part.dof) for part in parts])[:-1])
    first = np.cumsum([0, *(part.records for part in parts)]).tolist()

    def mean(name: str) -> Array:
        """Average over bands; what belongs to a record is zero for the others."""
        by_record, shape = name in ('ramp', 'along', 'among'), getattr(parts[0], name).shape[1:]
        sums = np.zeros((len(dof), *((first[-1], *shape[1:]) if by_record else shape)))
        for part, groups, records in zip(parts, bands, pairwise(first), strict=True):
            weighted = (part.dof * getattr(part, name).T).T
            np.add.at(sums[:, slice(*records)] if by_record else sums, groups, weighted)
        return np.asarray((sums.T / dof).T)

    joined = replace(Groups(*(mean(field.name) for field in fields(Groups))), dof=dof)
    return joined.select(np.argsort(joined.frequency, kind='stable'))
