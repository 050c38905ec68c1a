# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The spectrum of a record by frequency, and the expected power of each term."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache

from imu_allan.arrays import Array, Bools, Ints
from imu_allan.block import NEIGHBOURS
from imu_allan.noise import spectrum
from imu_allan.noise.record.periodogram import SpectrumSection
import numpy as np


@dataclass(frozen=True)
class Bins:
    """All frequencies of a record, for all axes."""

    frequency: Array    # (bins,): in Hz
    dof: Array    # (bins,): number of squared coefficients averaged
    power: Array    # (axes, bins): their mean, in squared sample units
    design: Array    # (bins, 4): expected power of each term with coefficient 1
    # (axes, bins): signed coefficient in the whole-record part, zero elsewhere
    coefficient: Array
    # (bins,): squared coefficient of a unit ramp, negated where only power is known
    ramp: Array
    # (bins,): whether a bin is a single coefficient of a whole-record part
    whole: Bools
    step: Array    # (bins,): samples averaged into one point
    length: Array    # (bins,): points of the block
    # (bins,): section of a bin, and its DCT index there
    section: Ints
    index: Ints

    @property
    def of_ramp(self) -> Array:
        """Coefficients of a unit ramp in the whole-record part, shape (bins,); zero in blocks."""
        return np.asarray(-np.sqrt(np.maximum(self.ramp, 0.0)))

    @cached_property
    def band(self) -> Ints:
        """Return the number of the narrow band of each bin, which is the same for all axes."""
        return narrow_bands(self.index / (self.length * self.step), self.step, self.whole)


def narrow_bands(frequency: Array, step: Array, whole: Bools) -> Ints:
    """Return the number of the narrow band of each frequency; fields as in `Bins`."""
    # Keep the 48 slowest coefficients single, because they distinguish the slow terms.
    slowest = np.flatnonzero(whole)
    slowest = slowest[np.argsort(frequency[slowest], kind='stable')][:48]
    # Within an eighth of an octave, the spectra of the terms change by a few percent. Relative to
    # the highest frequency, bands do not depend on the unit of time.
    band = np.ceil(8 * np.log2(frequency / frequency.max())).astype(np.int64)
    # The key separates what must not be averaged: the signed coefficients of the whole-record
    # part, and blocks with different steps.
    key = (64 * band + np.log2(step).astype(np.int64)) * 2 + whole
    key[slowest] = key.max(initial=0) + 1 + np.arange(len(slowest))
    return np.unique(key, return_inverse=True)[1].astype(np.int64)


def _shapes(length: int, first: int, last: int) -> tuple[Array, Array, Array]:
    """Return flicker (with its DCT factor), unit random walk, and the squared sine, by index."""
    j = np.arange(first, last)
    nu = j / (2.0 * length)
    return (spectrum.flicker(nu, 1.0) * spectrum.flicker_dct_factor(j),
            spectrum.random_walk(nu, 1.0), np.sin(np.pi * nu) ** 2)


_block_shapes = lru_cache(maxsize=64)(_shapes)
"""The same with a cache for blocks, which have few lengths, unlike whole records."""


def quantization_leak(index: Ints, length: Array | int, step_s: Array | float) -> Array:
    """Return the power of quantization noise 1 that leaks from both ends of a block."""
    return np.asarray(4 * np.cos(np.pi * index / (2 * length))**2 / (length * step_s**2))


def white_through_interpolation(nu: Array, share: float) -> Array:
    """
    Return the power of white noise with interpolated samples, relative to a full record.

    `nu`, shape (n,): in cycles per sample. `share`: of interpolated samples. The received ones are
    white; lost ones repeat the noise of neighbours that are farther apart where many are lost.
    As they lie at random places, a white error is added.
    """
    kept, turn = 1 - share, np.exp(2j * np.pi * nu)
    # Distances to the next received sample are geometric; those to the following ones are sums.
    shared = np.mean([np.real((kept * turn / (1 - share * turn))**number)
                      for number in range(1, NEIGHBOURS + 1)], axis=0)
    error = share * kept / (2 * NEIGHBOURS)
    return np.asarray((kept + share * shared)**2 / kept + error)


def bins_of(sections: Sequence[SpectrumSection], dt: float, interpolated: float = 0.0) -> Bins:
    """
    Join the sections of a spectrum.

    `sections`: at least one. `interpolated`: share of the samples that are interpolated.
    """
    # Rounding hides less; samples that repeat exactly would have no noise beside their lines.
    rounding = 1e-26 * np.max([section.power.max(axis=1) for section in sections], axis=0)
    parts = []
    for number, section in enumerate(sections):
        step_s, index = section.step * dt, np.arange(section.first, section.last)
        used = slice(section.first, section.last)
        is_block = section.coefficients is None
        shapes = _block_shapes if is_block else _shapes
        flicker, random_walk, sin2 = shapes(section.length, section.first, section.last)
        white = white_through_interpolation(
            index / (2 * section.length * section.step), interpolated) / step_s
        if section.gaps.white is not None:
            white *= section.gaps.white[used]
        # Flicker changes over each gap as it does not over the line that fills it.
        flicker = flicker * (1 - section.gaps.filled)
        quantization = 4 * sin2 / step_s**2 + quantization_leak(index, section.length, step_s)
        ramp = spectrum.ramp_dct(section.length, step_s)[section.first - 1:section.last - 1]
        # Interpolated samples contain no information; means over many samples hardly have any.
        measured = 1 - max(section.gaps.filled, interpolated if section.step == 1 else 0.0)
        coefficient = (np.zeros((len(section.power), len(index)))
                       if section.coefficients is None else section.coefficients[:, used])
        ones = np.ones(len(index))
        parts.append(Bins(
            frequency=index / (2 * section.length * step_s),
            dof=measured * section.blocks * ones,
            power=np.maximum(section.power[:, used], rounding[:, None]),
            design=np.stack((quantization, white, flicker, step_s * random_walk), axis=1),
            coefficient=coefficient, ramp=-ramp**2 if is_block else ramp**2,
            whole=np.full(len(index), not is_block), step=section.step * ones,
            length=section.length * ones, section=np.full(len(index), number), index=index))
    return Bins(*(np.concatenate([getattr(part, field.name) for part in parts],
                                 axis=int(field.name in ('power', 'coefficient')))
                  for field in fields(Bins)))
