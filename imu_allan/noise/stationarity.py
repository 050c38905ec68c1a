# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Test whether noise changes over a record, and estimate by how much.

The spectrum of each segment is compared with the mean over segments, band by band. So the shape of
the spectrum, a low-pass and errors of the fit cancel. A long record rejects any hypothesis of
equal noise; what matters is the size of the difference beyond sampling error.

References
----------
R. T. Birge, Phys. Rev. 40 (1932): intervals of inconsistent measurements.

"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from imu_allan.arrays import Array, Bools, Ints
from imu_allan.noise.chi_square import equal_variances
from imu_allan.noise.record.cells import Cells, end_to_end
from imu_allan.noise.record.groups import Groups
from imu_allan.noise.record.part_of_record import part_cells
from imu_allan.noise.record.periodogram import (
    HIGHEST_OF_MEANS,
    Periodogram,
    SpectrumSection,
    whole_section,
    whole_sections,
)
from imu_allan.noise.record.segments import (
    BLOCK,
    MEANS,
    OCTAVES,
    PER_OCTAVE,
    Segments,
    SHORTEST_SEGMENT,
)
import numpy as np

_DEPTH = 40
"""Bands are numbered from this many octaves below the sample rate: 30 years at 1 kHz."""
_LEAK = 10.0
"""Least density of a band, relative to what leaks into it of quantization noise above."""
_SEGMENT_PARTS = 16
"""Drift of a segment: standard deviation of the means of this many parts. Chosen by judgment."""


@dataclass(frozen=True)
class SegmentPowers:
    """Power of all axes by segment and band of an eighth of an octave."""

    frequency: Array    # (bands,): middle of each band, in cycles per sample
    power: Array    # (axes, segments, bands): mean power
    dof: Array    # (segments, bands)
    # (bands,): samples averaged into one point of the transform of a band, and samples in a block
    step: Array
    block: Array
    duration: Array    # (segments,): samples in each segment
    start: Array    # (segments,): index of the first sample, with runs joined end to end
    # (axes, segments): mean relative to the reference, and standard deviation of the means of
    # 16 parts
    mean: Array
    drift: Array
    drift_samples: Array    # (segments,): samples in each of these parts

    def level(self, axis: int) -> Array:
        """Return the power of an axis by band, averaged over segments."""
        return np.average(self.power[axis], axis=0, weights=np.maximum(self.dof, 1e-9))


@dataclass(frozen=True)
class Change:
    """Change of the noise in a broad band."""

    # The band, which may begin at 0 or end at infinity
    low_hz: float
    high_hz: float
    # Relative standard deviation of the amplitude between segments, beyond sampling error
    spread: float


@dataclass(frozen=True)
class Steadiness:
    """Comparison of the noise in the segments of one axis."""

    p_value: float    # of equal noise in all segments
    change: Change | None    # in the band with the largest spread; None if that is too small
    # (half_octaves,): relative spread of the power beyond sampling error; 0 if that may be chance
    frequency_hz: Array
    spread: Array

    @property
    def steady(self) -> bool:
        """Whether the noise is equal up to chance, or up to differences too small to matter."""
        return self.change is None

    def capped(self, groups: Groups) -> Groups:
        """Limit the degrees of freedom, as a spread between segments does not average out."""
        return groups.capped(np.interp(np.log(groups.frequency), np.log(self.frequency_hz),
                                       self.spread))


def segment_powers(periodogram: Periodogram) -> SegmentPowers | None:
    """Return the power of all segments, or None if there are fewer than three."""
    segments = periodogram.segments
    used = segments.used
    if used and segments.samples - (used - 1) * segments.width < segments.width / 2:
        used -= 1  # less than half a segment is too short
    if used < 3:
        return None
    parts = [part_cells(periodogram, number, number + 1) for number in range(used)]
    # Add the frequencies below those of the blocks.
    top = min(HIGHEST_OF_MEANS, periodogram.cell / 2**OCTAVES)
    return _powers(periodogram, [
        (cells, whole_sections(cells, periodogram.cell, top)) for cells in parts], segments)


def short_powers(periodogram: Periodogram) -> SegmentPowers | None:
    """Return the power of up to eight parts of a record that is too short for segments."""
    series, cell = periodogram.series, periodogram.cell
    # The power in 64 cells is known to 20 %, so that a doubling is four standard errors.
    count = min(8, len(series) // 64)
    if count < 3:
        return None
    ends = np.linspace(0, len(series), count + 1).astype(np.int64)
    parts = [series.take(slice(first, last)) for first, last in pairwise(ends.tolist())]
    # For white noise, all coefficients are equally good, however short the part.
    top = 0.5 if cell == 1 else HIGHEST_OF_MEANS
    # Split at gaps: interpolated samples are no noise, and their number differs by part.
    found = _powers(periodogram, [
        (cells, [whole_section(run.means, cell, top)
                 for run in cells.take(cells.counts == cell).split()]) for cells in parts])
    return found if found.dof.any() else None


def _powers(periodogram: Periodogram, parts: Sequence[tuple[Cells, Sequence[SpectrumSection]]],
            blocks: Segments | None = None) -> SegmentPowers:
    """Return mean powers by band of the sections of parts and of blocks, and means and drift."""
    bands = _DEPTH * PER_OCTAVE
    power, dof = np.zeros((periodogram.axes, len(parts), bands)), np.zeros((len(parts), bands))
    if blocks is not None:
        fast = np.arange(blocks.dof.shape[1]) + (_DEPTH - OCTAVES) * PER_OCTAVE
        power[:, :, fast], dof[:, fast] = blocks.power[:, :len(parts)], blocks.dof[:len(parts)]
    middle = 2.0 ** ((np.arange(bands) + 0.5) / PER_OCTAVE - _DEPTH)
    of_means = middle < HIGHEST_OF_MEANS / MEANS
    step = np.where(of_means, float(MEANS), 1.0)
    block = np.where(of_means, float(SHORTEST_SEGMENT), float(BLOCK))
    for part, (_, sections) in enumerate(parts):
        for section in sections:
            # Coefficients 1 and 2 hold the trend of a segment, not its noise.
            index = np.arange(3, section.last)
            band = np.floor(PER_OCTAVE * (
                np.log2(index / (2 * section.length * section.step)) + _DEPTH)).astype(np.int64)
            for axis, row in enumerate(section.power[:, index]):
                power[axis, part] += np.bincount(band, row, bands)
            dof[part] += np.bincount(band, minlength=bands)
            step[band], block[band] = section.step, section.length * section.step
    seen = np.flatnonzero(dof.sum(axis=0))
    dof = dof[:, seen]
    keys = periodogram.series.keys
    places = end_to_end(keys) * float(periodogram.cell)
    start = [places[np.searchsorted(keys, cells.keys[0])] if len(cells) else 0.0
             for cells, _ in parts]
    duration, mean, drift, drift_samples = zip(
        *(_part_means(cells) for cells, _ in parts), strict=True)
    return SegmentPowers(
        middle[seen], power[:, :, seen] / np.maximum(dof, 1), dof, step[seen], block[seen],
        np.array(duration), np.array(start), np.stack(mean, axis=1), np.stack(drift, axis=1),
        np.array(drift_samples))


def _part_means(cells: Cells) -> tuple[float, Array, Array, float]:
    """Return samples, mean and drift of a part, and the samples in each of its 16 means."""
    count = max(float(cells.counts.sum()), 1.0)
    parts = np.array_split(np.arange(len(cells)), min(_SEGMENT_PARTS, max(len(cells), 1)))
    sums = np.stack([cells.sums[:, part].sum(axis=1) for part in parts], axis=1)
    counts = np.array([max(cells.counts[part].sum(), 1) for part in parts])
    return (count, cells.sums.sum(axis=1) / count, np.std(sums / counts, axis=1),
            count / len(parts))


def steadiness(powers: SegmentPowers, axis: int, dt: float,
               lines_hz: Sequence[float] = (), white_alone: bool = False) -> Steadiness:
    """
    Compare the noise in the segments of one axis.

    `powers`: of all axes. `lines_hz`: lines, whose bands are left out. `white_alone`: leave out
    noise that is slower than white noise, as for the parts of a short record.
    """
    frequency = powers.frequency
    keep = np.asarray((powers.dof > 0).all(axis=0))
    for line in lines_hz:
        keep &= np.abs(np.log2(frequency / (line * dt))) > 1.5 / PER_OCTAVE
    level = powers.level(axis)
    # Quantization noise leaks from both ends of a block into all of its bands.
    density = np.where(keep, level * powers.step, 0.0)
    peak = np.maximum.accumulate(density[::-1])[::-1]
    keep &= density > _LEAK * peak / powers.block
    if keep.any():
        if white_alone:
            fastest = keep & (frequency > frequency[keep][-1] / 2)
            # Bands above twice the level of the fastest octave hold drift, not white noise.
            keep &= level < 2.0 * np.average(
                level[fastest], weights=powers.dof.sum(axis=0)[fastest])
        # A band of lower level lies behind a low-pass and holds only leakage.
        keep &= level > 0.1 * np.median(level[keep])
    frequency, dof = frequency[keep], powers.dof[:, keep]
    ratio = powers.power[axis][:, keep] / np.maximum(level[keep], 1e-300)
    half = _by_band(np.floor(2 * np.log2(frequency)), ratio, dof, frequency)
    if half is None:
        return Steadiness(1.0, None, np.ones(1), np.zeros(1))
    at, middle, count = half
    p_value = equal_variances(at, count)
    # In short records, 1e-3 would give 2 % false alarms with a deep low-pass, because of leakage.
    least = 1e-4 if white_alone else 1e-3
    # Neighbouring half-octaves change together, so smooth the spread over 0.7 octaves.
    weight = np.exp(-0.5 * (np.log2(middle[:, None] / middle) / (0.7 / 2))**2) \
        * count.mean(axis=0)
    smooth = np.sqrt(weight @ _spread(at, count)**2 / weight.sum(axis=1))
    middle = middle / dt    # in Hz
    # Broad bands, for which findings report a change, in cycles per sample.
    edges = (0.0, 3e-4, 3e-3, 3e-2, np.inf)
    broad = _by_band(np.digitize(frequency, edges[1:-1]), ratio, dof, frequency)
    assert broad is not None
    at, centre, count = broad
    wide = _spread(at, count)
    if white_alone:
        # White noise changes in all bands at once; few samples show it only in all together.
        p_value = min(2 * min(p_value, equal_variances(at, count)), 1.0)
    if p_value >= least:
        return Steadiness(p_value, None, middle, np.zeros(len(middle)))
    for place in np.argsort(-wide):
        # A relative spread of 5 % of the power does not matter.
        if wide[place] > 0.05 and equal_variances(at[:, [place]], count[:, [place]]) < least:
            band = int(np.digitize(centre[place], edges[1:-1]))
            change = Change(edges[band] / dt, edges[band + 1] / dt, float(wide[place]) / 2)
            return Steadiness(p_value, change, middle, smooth)
    return Steadiness(p_value, None, middle, smooth)


def white_ratio(powers: SegmentPowers, axis: int, white: float, density: Array,
                below: Bools) -> tuple[Array, Array] | None:
    """
    Amplitude of the white noise of every segment relative to that of the whole record.

    `powers`: of all axes. `white`: fitted density, squared. `density`, shape (bands,): that of all
    terms, squared. `below`, shape (bands,): bands that no filter attenuates. Returns: ratio and
    its relative standard error, shape (segments,); None if no band can be used.
    """
    # Use only bands that consist mostly of white noise.
    keep = below & (white > 0.8 * density) & (powers.dof > 0).all(axis=0)
    if not keep.any():
        return None
    dof, power = powers.dof[:, keep], powers.power[axis][:, keep]
    level = np.sum(power * dof, axis=0) / dof.sum(axis=0)
    ratio = np.sum(dof * power / np.maximum(level, 1e-300), axis=1) / dof.sum(axis=1)
    return np.sqrt(ratio), np.sqrt(1 / (2 * dof.sum(axis=1)))


def _by_band(number: Array | Ints, ratio: Array, dof: Array, frequency: Array
             ) -> tuple[Array, Array, Array] | None:
    """Average ratios over bands: ratio by segment and band, frequency, degrees of freedom."""
    found = []
    for band in np.unique(number):
        here = number == band
        count = dof[:, here].sum(axis=1)
        # Fewer degrees of freedom are not enough for the logarithm of the power of a band.
        if count.min() < 2 or count.mean() < 4:
            continue
        mean = (dof[:, here] * ratio[:, here]).sum(axis=1) / count
        found.append((mean, np.exp(np.mean(np.log(frequency[here]))), count))
    if not found:
        return None
    at, middle, counts = zip(*found, strict=True)
    return np.stack(at, axis=1), np.array(middle), np.stack(counts, axis=1)


def _spread(ratio: Array, dof: Array) -> Array:
    """Return the relative spread of power between segments beyond sampling error, by band."""
    noise = np.mean(2 / dof + 2 / dof**2, axis=0)
    # Limit ratios to -30 dB, so that the logarithm of zero power is finite.
    seen = np.var(np.log(np.maximum(ratio, 1e-3)), axis=0, ddof=1)
    return np.asarray(np.sqrt(np.maximum(seen - noise, 0.0)))
