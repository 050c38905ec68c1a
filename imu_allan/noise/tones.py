# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Narrow lines in the spectrum: vibration, mains, idle tones of a quantizer.

A line would pass for flicker or white noise in a fit, so its bins, and those its side lobes reach,
are left out and the line is named. A line is what rises above the median of its neighbourhood by
more than chance allows, seen at three resolutions: a quantizer's idle tone is a few hertz wide.
"""

from collections.abc import Sequence
from itertools import groupby, pairwise
from math import log2, sqrt

from imu_allan.noise import chi_square
from imu_allan.noise.posterior.maximum import maximise
from imu_allan.noise.posterior.regression import about_mean
from imu_allan.noise.record.bins import Bins
from imu_allan.noise.record.groups import about_ramp, Groups
from imu_allan.noise.record.periodogram import longest_blocks, SpectrumSection
from imu_allan.result import Tone
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, median_filter

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_NEIGHBOURHOOD = 65
"""Bins of the median: wide enough for a line to be few of them. A judgment: more blurs a knee."""
_LEAKS = (0.02, 0.3, 4.0)
"""
Share of the floor above which a side lobe still spoils a bin, which is then left out. The next one
is taken where the one before leaves too little: of 80 lines of three times N half a spectrum.
"""
_SCALES = (1, 32, 8)
"""Bins averaged: sharp lines first, then humps as broad as the idle tones of a quantizer."""
_LOWEST_INDEX = 32
"""Coefficients below belong to the slow terms, whose steep rise would pass for a line."""
NAMED = 32
"""So many lines, the strongest, have their own frequency and amplitude in a result."""
_MANY = 8
"""Blocks from which on an average is smooth enough for broad lines and few neighbours."""


def find_lines(sections: list[SpectrumSection], bins: Bins, axis: int, dt: float,
               groups: Groups) -> tuple[list[Tone], Mask]:
    """
    Find the lines of one axis.

    `sections`: from the slowest to the fastest part. `bins`: of the same sections. `groups`: of
    all bins of the axis, to which noise is fitted that flattens the spectrum. Returns the lines,
    the strongest first, and a mask of the bins, False where a line or its side lobes are.
    """
    theta = maximise(groups, moving_mean=True).theta
    ramp = about_mean(groups)(groups.design @ theta).ramp
    expected = np.maximum(bins.design @ theta, 1e-300)
    power = about_ramp(bins.power[axis], bins.cross[axis], bins.ramp, float(ramp))
    for leak in _LEAKS:
        lines, keep = _find_lines(sections, bins, dt, power, expected, leak)
        # With less than half of the spectrum left, no line is left out and the fit is poor.
        if keep.mean() >= 0.5:
            return lines, keep
    # What is left is no spectrum to fit: the fit shall see all of it and say so.
    return lines, np.ones(len(bins.frequency), dtype=bool)


def strongest(lines: Sequence[Tone]) -> tuple[tuple[Tone, ...], tuple[Tone, ...]]:
    """
    Choose the lines that a result names, and sum the others by octave.

    `lines`: the strongest first. Returns: their power and, where they are averaged for long, what
    they leave are those of `lines`.
    """
    weaker = []
    for _, octave in groupby(sorted(lines[NAMED:], key=lambda line: line.frequency_hz),
                             lambda line: log2(line.frequency_hz) // 1):
        some = list(octave)
        power = sum(line.amplitude**2 for line in some)
        late = sum((line.amplitude / line.frequency_hz)**2 for line in some)
        weaker.append(Tone(sqrt(power / late), sqrt(power), len(some)))
    return tuple(lines[:NAMED]), tuple(weaker)


def vibrations(lines: Sequence[Tone], cycle_s: float | None, sections: Sequence[SpectrumSection],
               dt: float) -> list[Tone]:
    """
    Leave out the lines of a slow cycle, whose harmonics come one after the other from the first.

    `lines`: of one record. `cycle_s`: period of its cycle. `sections`: in which the lines were
    found. In the same order.
    """
    if cycle_s is None:
        return list(lines)
    # The second harmonic of a symmetric cycle is no line.
    last, harmonics = 2, set()
    for line in sorted(lines, key=lambda line: line.frequency_hz):
        order = round(line.frequency_hz * cycle_s)
        spacing = min((section.spacing_hz(dt) for section in sections
                       if line.frequency_hz < section.last * section.spacing_hz(dt)), default=0.0)
        off = abs(line.frequency_hz - order / cycle_s)
        # A weak line is known to 1.5 coefficients, a period to 2 %. A vibration lies beyond twice
        # the last harmonic.
        if 1 <= order <= 2 * last and off < 1.5 * spacing + 0.02 / cycle_s:
            last = max(last, order)
            harmonics.add(line)
    return [line for line in lines if line not in harmonics]


def _find_lines(sections: list[SpectrumSection], bins: Bins, dt: float, power: Array,
                expected: Array, leak: float) -> tuple[list[Tone], Mask]:
    """Find lines, with the bins that they and their side lobes above a leak take."""
    keep = np.ones(len(bins.frequency), dtype=bool)
    lines: list[Tone] = []
    spans: list[tuple[float, float]] = []
    longest = longest_blocks(sections)
    # The fastest part first: what it finds may stand again in a slower one, folded.
    for number in reversed(range(len(sections))):
        section = sections[number]
        # Eight neighbourhoods: in shorter blocks no lines are sought, a judgment.
        if section.length != longest[section.step] or section.length < 512:
            continue
        here = np.flatnonzero(bins.section == number)[max(0, _LOWEST_INDEX - section.first):]
        if len(here) < _NEIGHBOURHOOD:
            continue
        frequency, level = bins.frequency[here], expected[here]
        found, taken = _lines_of(power[here], level, section.blocks, leak)
        keep[here[taken]] = False
        width = section.spacing_hz(dt)
        edges = np.flatnonzero(np.diff(np.concatenate(([False], taken, [False]))))
        spans += [(frequency[a] - width, frequency[b - 1] + width)
                  for a, b in zip(edges[::2], edges[1::2], strict=True)]
        for part, excess in found:
            # The side lobes are lopsided, near half the sample rate most of all.
            top = int(np.argmax(excess))
            # From so many bins on a rise is a hump with its centre of mass, not a line with a
            # highest bin.
            middle = slice(max(top - 2, 0), top + 3) if len(excess) < 64 else slice(None)
            centre = float(np.average(frequency[part][middle], weights=excess[middle]))
            line = Tone(centre, float(np.sqrt(2 * excess.sum() / section.length)))
            if section.step == 1 or not folded(line, lines, section.step, dt, 3 * width):
                lines.append(line)
    # Shorter blocks of the same stage see the same lines, only less sharply.
    for number, section in enumerate(sections):
        if section.length == longest[section.step]:
            continue
        width = 2 * section.spacing_hz(dt)
        here = np.flatnonzero(bins.section == number)
        for low, high in spans:
            inside = (bins.frequency[here] > low - width) & (bins.frequency[here] < high + width)
            keep[here[inside]] = False
    lines.sort(key=lambda line: -line.amplitude)
    return lines, keep


def _lines_of(power: Array, expected: Array, blocks: int, leak: float
              ) -> tuple[list[tuple[slice, Array]], Mask]:
    """Find the lines: where each is, the power it adds there, and the bins that all spoil."""
    taken = np.zeros(len(power), dtype=bool)
    found: list[tuple[slice, Array]] = []
    for scale in _SCALES if blocks >= _MANY else _SCALES[:1]:
        # A first fit flattens the spectrum for sharp lines. It may miss the shape of a low-pass
        # and make a hump of the knee, so broad ones are sought in the spectrum as it is.
        level = expected if scale == 1 else np.ones(len(power))
        candidates = []
        places = rises(np.where(taken, np.nan, power / level), blocks, scale)
        counted = taken.copy()
        for begin, end, _ in places:
            counted[begin:end] = True
        for begin, end, floor in places:
            excess = np.maximum(power[begin:end] - floor * level[begin:end], 0)
            peak = float(np.max(excess / level[begin:end])) / floor
            # A sharp line leaks into side lobes; a broad one has skirts of its own width.
            reach = 1 + (int(np.ceil(np.sqrt(peak / leak) / np.pi))
                         if scale == 1 else end - begin)
            around = slice(max(0, begin - reach), end + reach)
            # What leaks is of the line, too; where two lines leak into a bin it counts once.
            leaked = (power[around] - floor * level[around])[~counted[around]].sum()
            excess *= 1 + max(float(leaked), 0.0) / float(excess.sum())
            counted[around] = taken[around] = True
            for part in _peaks(excess) if scale == 1 else [slice(0, end - begin)]:
                candidates.append((slice(begin + part.start, begin + part.stop), excess[part]))
        candidates.sort(key=lambda c: -float(c[1].max()))
        main: list[tuple[int, float]] = []
        for part, excess in candidates:
            place, height = part.start + int(np.argmax(excess)), float(excess.max())
            # Beyond half the sample rate the side lobes come back.
            lobes = sum(top / (1 + (np.pi * (place - at) / 2) ** 2)
                        for other, top in main for at in (other, 2 * len(power) - other))
            # The side lobes of a single block scatter; those of an average do not.
            # Beside a stronger line it has to be twice its side lobe, in a few blocks, where side
            # lobes scatter, four times: judgments.
            if scale == 1 and height < lobes * (
                    2.0 if blocks >= _MANY else 4.0):
                continue
            main.append((place, height))
            found.append((part, excess))
    return found, taken


def rises(ratio: Array, blocks: int, scale: int) -> list[tuple[int, int, float]]:
    """
    Where a flattened spectrum rises above its neighbourhood: begin, end and level around.

    The spectrum is averaged over `scale` bins first, which decides how broad a line is seen. Bins
    that are NaN have been taken by a sharper line.
    """
    count = len(ratio) // scale
    dof = blocks * scale
    # The median of a few wild values is wild itself, so they need more neighbours.
    neighbourhood = _NEIGHBOURHOOD if dof >= _MANY else 4 * _NEIGHBOURHOOD - 3
    if count < neighbourhood:
        return []
    cells = ratio[:count * scale].reshape(count, scale)
    known = np.isfinite(cells).sum(axis=1)
    mean = np.nansum(cells, axis=1) / np.maximum(known, 1)
    empty = known < (scale + 1) // 2
    middle = float(chi_square.lower(0.5, dof)) / dof
    # A part of the spectrum shows a line by chance in one of 10,000 records.
    chance = float(chi_square.upper(1e-4 / count, dof)) / dof
    # A long record shows the smallest rise by more than chance: less is no line. A bend of the
    # spectrum resembles a broad one. Judgments.
    least = 1.3 if scale == 1 else 1.5
    hit = np.zeros(count, dtype=bool)
    floor = mean
    for _ in range(4):
        # Cells already found are levelled, lest several lines lift the median together.
        good = np.flatnonzero(~(hit | empty))
        if len(good) < neighbourhood:
            return []
        level = np.interp(np.arange(count), good, mean[good])
        floor = (median_filter(level, neighbourhood, mode='reflect') if scale == 1
                 else higher_side(level, neighbourhood)) / middle
        # A strictly periodic signal has nothing between its lines: 90 dB below the mean level is
        # no noise, and a ratio to it is still a number.
        floor = np.maximum(floor, 1e-9 * float(mean.mean()))
        found = (mean > floor * max(chance, least)) & ~empty
        if scale > 1:
            # Below a tenth of the largest floor a hump is a side lobe of a filter's response.
            found &= mean > 0.1 * floor.max()
        if (found == hit).all():
            break
        hit = found
    # Where more bins rise, it is the shape of the spectrum and no line: a judgment.
    if not hit.any() or hit.mean() > 0.3:
        return []
    places = np.flatnonzero(hit)
    groups = np.split(places, np.flatnonzero(np.diff(places) > 4) + 1)
    return [(int(g[0]) * scale, (int(g[-1]) + 1) * scale, float(floor[g].min())) for g in groups]


def higher_side(level: Array, neighbourhood: int) -> Array:
    """
    Return the larger of the medians to the left and to the right.

    What is broad has to rise above both sides, or the knee of a low-pass would pass for a line.
    """
    size = neighbourhood // 2 + 1 - neighbourhood // 2 % 2
    left, right = (median_filter(level, size, mode='nearest', origin=side * (size // 2))
                   for side in (1, -1))
    return np.asarray(np.maximum(left, right))


def _peaks(level: Array) -> list[slice]:
    """Cut a cluster into parts, one for every local maximum, at the lowest points between."""
    tops = np.flatnonzero((level == maximum_filter1d(level, 7, mode='constant')) & (level > 0))
    cuts = [int(a + np.argmin(level[a:b])) for a, b in pairwise(tops)]
    return [slice(a, b) for a, b in pairwise([0, *cuts, len(level)])]


def folded(line: Tone, lines: list[Tone], step: int, dt: float, width: float) -> bool:
    """Whether a line of means over `step` samples is what known ones of samples leave there."""
    rate = 1 / (step * dt)
    images = [known.amplitude * np.sinc(known.frequency_hz / rate)
              / np.sinc(known.frequency_hz * dt) for known in lines
              if abs(abs(known.frequency_hz - rate * round(known.frequency_hz / rate))
                     - line.frequency_hz) < width]
    # Twice what known lines leave there a line is its own: among hundreds one is always near.
    return line.amplitude < 2.0 * float(np.sqrt(np.sum(np.square(images))))
