# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
A spectrum as the likelihood takes it: bins of all axes, gathered into groups of one.

A group is a narrow band over which the spectra of the terms hardly change, so that the mean power
and the degrees of freedom are all that has to be kept of its bins; the slowest coefficients of a
record stay single. What may move the mean beside noise, a ramp and other regressors, comes along
as products with the coefficients, and only of the whole record: the blocks know no sign.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache

from imu_allan.noise import spectrum
from imu_allan.noise.bridges import Bridges, NO_BRIDGES
from imu_allan.noise.periodogram import SpectrumPiece
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

QUANTIZATION, WHITE, FLICKER, WALK = range(4)
"""Columns of a design: the four terms that have a spectrum."""
LEAST_OF_BLOCKS = 1e-3
"""Share of the power of blocks that a ramp leaves: by chance they hold less than it gives."""

_SINGLE = 48
"""Coefficients of a whole record that stay single: where the slow terms are told apart."""
_PER_OCTAVE = 8
"""Bands to an octave: over one of them the spectrum of the terms changes by a few percent."""


@dataclass(frozen=True)
class Bins:
    """
    Every frequency of a record, for all axes.

    Attributes
    ----------
    frequency : ndarray, shape (bins,)
        In Hz.
    dof : ndarray, shape (bins,)
        How many squared coefficients were averaged.
    power : ndarray, shape (axes, bins)
        Their mean, in squared sample units.
    design : ndarray, shape (bins, 4)
        Expected power for a coefficient 1 of each term.
    cross : ndarray, shape (axes, bins)
        Coefficient times that of a unit ramp; zero but in the whole-record part.
    coefficient : ndarray, shape (axes, bins)
        The coefficient itself, with its sign; zero but in the whole-record part.
    ramp : ndarray, shape (bins,)
        Squared coefficient of a unit ramp, negative where the sign of the ramp is lost.
    whole : ndarray of bool, shape (bins,)
        Whether a bin is a single coefficient of a whole-record part.
    piece, index : ndarray of int, shape (bins,)
        Which piece a bin is from, and its DCT index there.

    """

    frequency: Array
    dof: Array
    power: Array
    design: Array
    cross: Array
    coefficient: Array
    ramp: Array
    whole: NDArray[np.bool_]
    piece: NDArray[np.int64]
    index: NDArray[np.int64]

    @cached_property
    def band(self) -> NDArray[np.int64]:
        """Return the number of the narrow band of each bin: the same for every axis."""
        single = self.whole & (self.index <= _SINGLE)
        band = np.floor(_PER_OCTAVE * np.log2(self.frequency)).astype(np.int64)
        # The key keeps apart what must not be averaged: single coefficients, and the whole-record
        # part, whose ramp has a sign, from the blocks.
        key = np.where(single, (self.piece + 2) * 10_000_000 + self.index, band * 2 + self.whole)
        return np.unique(key, return_inverse=True)[1].astype(np.int64)


@dataclass(frozen=True)
class Groups:
    """
    Bins of one axis gathered into narrow bands; fields as in `Bins`, for one axis.

    Attributes
    ----------
    frequency, dof, power, cross, ramp : ndarray, shape (groups,)
    design : ndarray, shape (groups, columns)
    along : ndarray, shape (groups, regressors), optional
        Mean of coefficient times regressor; zero where the sign is lost.
    among : ndarray, shape (groups, regressors, regressors), optional
        Mean products of the regressors.
    record : ndarray of int, shape (groups,), optional
        Which of several records a group is of, each having regressors of its own; None for one.

    """

    frequency: Array
    dof: Array
    power: Array
    design: Array
    cross: Array
    ramp: Array
    along: Array | None = None
    among: Array | None = None
    record: NDArray[np.int64] | None = None

    @property
    def records(self) -> int:
        """How many records the groups are of."""
        return 1 if self.record is None else int(self.record.max()) + 1

    def at_ramp(self, slope: float) -> Array:
        """Power about the mean that a ramp of `slope` per second gives, shape (groups,)."""
        return about_ramp(self.power, self.cross, self.ramp, slope)

    def below(self, frequency_hz: float) -> 'Groups':
        """Return the groups up to a frequency."""
        return self.taken(self.frequency <= frequency_hz)

    def taken(self, which: NDArray[np.bool_] | NDArray[np.int64]) -> 'Groups':
        """Return some of the groups, by mask or in an order."""
        return Groups(self.frequency[which], self.dof[which], self.power[which],
                      self.design[which], self.cross[which], self.ramp[which],
                      None if self.along is None else self.along[which],
                      None if self.among is None else self.among[which],
                      None if self.record is None else self.record[which])

    def with_design(self, design: Array) -> 'Groups':
        """Return the same power under another set of columns."""
        return replace(self, design=design)


Spectra = Callable[[], Sequence[Groups]]
"""Gives the spectra of parts of a record, where they are asked for."""


def about_ramp(power: Array, cross: Array, ramp: Array, slope: float) -> Array:
    """
    Take the mean that a ramp gives the coefficients out of their power.

    Parameters
    ----------
    power, cross, ramp : ndarray, shape (n,)
        As in `Groups`.
    slope : float
        Of the ramp, per second.

    Returns
    -------
    ndarray, shape (n,)

    """
    if slope == 0:
        return power
    # What is left of coefficients whose sign is known is exact. Of blocks only the mean power of
    # the ramp is known, and by chance they can hold less.
    floor = np.where(ramp > 0, 1e-12, LEAST_OF_BLOCKS)
    return np.maximum(power - 2 * slope * cross + slope**2 * ramp, floor * power)


def _shapes(length: int, first: int, last: int) -> tuple[Array, Array, Array]:
    """Flicker (with its DCT factor), random walk of unit step, and the squared sine, by index."""
    j = np.arange(first, last)
    nu = j / (2.0 * length)
    return (spectrum.flicker(nu, 1.0) * spectrum.flicker_dct_factor(j),
            spectrum.random_walk(nu, 1.0), np.sin(np.pi * nu) ** 2)


_block_shapes = lru_cache(maxsize=64)(_shapes)
"""The same for blocks, whose lengths are few. That of a whole record is another in every fit."""


def bins_of(pieces: Sequence[SpectrumPiece], dt: float, bridges: Bridges = NO_BRIDGES) -> Bins:
    """
    Join the pieces of a spectrum.

    Parameters
    ----------
    pieces : sequence of SpectrumPiece
        At least one.
    dt : float
        Sample interval in seconds.
    bridges : Bridges, optional
        Samples that stand in for missing ones.

    Returns
    -------
    Bins

    """
    parts = []
    for number, piece in enumerate(pieces):
        step = piece.step * dt
        shapes = _block_shapes if piece.coefficients is None else _shapes
        flicker, walk, s2 = shapes(piece.length, piece.first, piece.last)
        index = np.arange(piece.first, piece.last)
        white = np.full(len(s2), 1 / step)
        if piece.gaps.white is not None:
            white *= piece.gaps.white[piece.first:piece.last]
        if piece.gaps.flicker is not None and piece.gaps.walk is not None:
            flicker = flicker * piece.gaps.flicker[piece.first:piece.last]
            walk = walk * piece.gaps.walk[piece.first:piece.last]
        bridged = bridges.white_power(piece.length, piece.step)
        if bridged is not None:
            white *= bridged[piece.first:piece.last]
        # The second part of the first column is what both ends of a block leak.
        quantized = 4 * (s2 + (1 - s2) / piece.length) / step**2
        design = np.stack((quantized, white, flicker, step * walk), axis=1)
        part = slice(piece.first, piece.last)
        ramp = spectrum.ramp_dct(piece.length, step)[piece.first - 1:piece.last - 1]
        if piece.coefficients is None:
            signed, squared = np.zeros((len(piece.power), len(index))), -ramp**2
        else:
            signed, squared = piece.coefficients[:, part], ramp**2
        # What stands in for missing samples adds nothing new; means of many hardly hold any.
        known = 1 - max(piece.gaps.filled, bridges.share if piece.step == 1 else 0.0)
        parts.append((index / (2 * piece.length * step), np.full(len(index), known * piece.blocks),
                      piece.power[:, part], design, signed * ramp, signed, squared,
                      np.full(len(index), piece.coefficients is not None),
                      np.full(len(index), number), index))
    frequency, dof, power, design, cross, signed_, squared_, whole, number_, index_ = zip(
        *parts, strict=True)
    return Bins(np.concatenate(frequency), np.concatenate(dof).astype(np.float64),
                np.concatenate(power, axis=1), np.concatenate(design),
                np.concatenate(cross, axis=1), np.concatenate(signed_, axis=1),
                np.concatenate(squared_), np.concatenate(whole),
                np.concatenate(number_), np.concatenate(index_))


def grouped(bins: Bins, axis: int, keep: NDArray[np.bool_] | None = None,
            regressors: Array | None = None) -> Groups:
    """
    Gather the bins of one axis into bands of an eighth of an octave.

    Parameters
    ----------
    bins : Bins
        The spectrum of all axes.
    axis : int
        Column of the axis.
    keep : ndarray of bool, shape (bins,), optional
        False leaves a bin out.
    regressors : ndarray, shape (bins, n), optional
        Coefficients of what may move the mean beside the ramp, which comes first in any case;
        zero outside the whole-record part.

    Returns
    -------
    Groups
        The lowest 48 coefficients of every whole-record part stay single.

    """
    bands = _Bands(bins, keep)
    still = Groups(bands.frequency, bands.dof, bands.mean(bins.power[axis]),
                   np.stack([bands.mean(column) for column in bins.design.T], axis=1),
                   bands.mean(bins.cross[axis]), bands.mean(bins.ramp))
    return _regressed(still, bands, bins, axis, regressors)


def regressed(still: Groups, bins: Bins, axis: int, keep: NDArray[np.bool_] | None,
              regressors: Array) -> Groups:
    """
    Exchange the regressors of the groups that `grouped` makes of the same bins.

    Parameters
    ----------
    still : Groups
        With any regressors.
    bins, axis, keep, regressors
        As for `grouped`.

    Returns
    -------
    Groups

    """
    return _regressed(still, _Bands(bins, keep), bins, axis, regressors)


class _Bands:
    """Means over the bands of some bins, in order of frequency."""

    def __init__(self, bins: Bins, keep: NDArray[np.bool_] | None) -> None:
        self._weight = bins.dof if keep is None else bins.dof * keep
        self._band = bins.band
        dof: Array = np.bincount(self._band, self._weight).astype(np.float64)
        self._some = np.flatnonzero(dof > 0)
        self.dof = dof[self._some]
        self.frequency = self.mean(bins.frequency)
        order = np.argsort(self.frequency)
        self._some, self.dof, self.frequency = (
            self._some[order], self.dof[order], self.frequency[order])

    def mean(self, values: Array) -> Array:
        """Weigh by degrees of freedom, shape (bands,)."""
        return np.asarray(np.bincount(self._band, self._weight * values)[self._some] / self.dof)


def _regressed(still: Groups, bands: _Bands, bins: Bins, axis: int, regressors: Array | None
               ) -> Groups:
    """Lay the ramp and other regressors to groups."""
    columns = [-np.sqrt(np.maximum(bins.ramp, 0)), *([] if regressors is None else regressors.T)]
    along = [bands.mean(bins.coefficient[axis] * column) for column in columns]
    among = np.empty((len(bands.dof), len(columns), len(columns)))
    for i, one in enumerate(columns):
        for j, other in enumerate(columns[:i + 1]):
            among[:, i, j] = among[:, j, i] = bands.mean(one * other)
    return replace(still, along=np.stack(along, axis=1), among=among)


def joined_groups(parts: Sequence[Groups]) -> Groups:
    """
    Put the spectra of several records side by side.

    Parameters
    ----------
    parts : sequence of Groups
        Of each record, with the same number of regressors.

    Returns
    -------
    Groups
        In order of frequency; the coefficients are one, those of the regressors each record's own.

    """
    record = np.repeat(np.arange(len(parts)), [len(part.dof) for part in parts])
    every = Groups(*(np.concatenate([getattr(part, field.name) for part in parts])
                     for field in fields(Groups) if field.name != 'record'))
    return replace(every, record=record).taken(np.argsort(every.frequency, kind='stable'))
