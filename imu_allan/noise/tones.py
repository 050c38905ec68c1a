# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Narrow lines in the spectrum, from vibration, mains or idle tones of a quantizer.

A line would pass for flicker or white noise in a fit. So its bins, and those of its side lobes,
are left out and the line is reported. A line rises significantly above the median of its
neighbourhood, at one of three resolutions: the idle tone of a quantizer is a few hertz wide.
"""

from collections.abc import Sequence
from itertools import pairwise

from imu_allan.arrays import Array, Bools
from imu_allan.noise import chi_square
from imu_allan.noise.posterior.maximum import maximise
from imu_allan.noise.posterior.regression import about_mean
from imu_allan.noise.record.bins import Bins
from imu_allan.noise.record.groups import Groups, LEAST_OF_BLOCKS
from imu_allan.noise.record.periodogram import SpectrumSection
from imu_allan.result import Tone
import numpy as np
from scipy.ndimage import maximum_filter1d, median_filter

_NEIGHBOURHOOD = 65
"""Bins of the median, many more than a line has; more would blur a knee. Chosen by judgment."""
_MANY = 8
"""Fewest blocks whose average is smooth enough for broad lines and a small neighbourhood."""


def find_lines(sections: list[SpectrumSection], bins: Bins, axis: int, dt: float,
               groups: Groups) -> tuple[list[Tone], Bools]:
    """
    Find the lines of one axis.

    `sections`: from the slowest to the fastest part. `bins`: of the same sections. `groups`: of
    all bins of the axis; the noise fitted to them flattens the spectrum. Returns: the lines, the
    strongest first, and a mask of the bins, False for those of a line or its side lobes.
    """
    theta = maximise(groups, detrend=True).theta
    [slope] = about_mean(groups)(groups.design @ theta).ramp.tolist()
    expected = np.maximum(bins.design @ theta, 1e-300)
    # Without the ramp. For signed coefficients this is exact. For blocks only the mean power of
    # the ramp is known, and their power may be smaller by chance.
    power, cross = bins.power[axis], bins.coefficient[axis] * bins.of_ramp
    power = np.maximum(power - 2 * slope * cross + slope**2 * bins.ramp,
                       np.where(bins.ramp > 0, 1e-12, LEAST_OF_BLOCKS) * power)
    # Leave out bins where side lobes exceed this share of the noise floor. With the first, 80
    # lines of three times N would take half of a spectrum.
    for leak in (0.02, 0.3, 4.0):
        lines, keep = _find_lines(sections, bins, dt, power, expected, leak)
        # At least half of the spectrum must be left for a fit.
        if keep.mean() >= 0.5:
            return lines, keep
    # Otherwise no line is left out, and the goodness of fit will be poor.
    return lines, np.ones(len(bins.frequency), dtype=bool)


def vibrations(lines: Sequence[Tone], cycle_s: float | None, sections: Sequence[SpectrumSection],
               dt: float) -> list[Tone]:
    """
    Remove the harmonics of a slow cycle, which form a series from the first one on.

    `lines`: of one record. `cycle_s`: period of its cycle. `sections`: in which the lines were
    found. Returns: the other lines, in the same order.
    """
    if cycle_s is None:
        return list(lines)
    # A symmetric cycle has no line at its second harmonic, so start as if that were found.
    last, harmonics = 2, set()
    for line in sorted(lines, key=lambda line: line.frequency_hz):
        order = round(line.frequency_hz * cycle_s)
        spacing = min((section.spacing_hz(dt) for section in sections
                       if line.frequency_hz < section.last * section.spacing_hz(dt)), default=0.0)
        off = abs(line.frequency_hz - order / cycle_s)
        # The frequency of a weak line is uncertain by 1.5 coefficients, the period by 2 %. Beyond
        # twice the last harmonic, a line is a vibration.
        if 1 <= order <= 2 * last and off < 1.5 * spacing + 0.02 / cycle_s:
            last = max(last, order)
            harmonics.add(line)
    return [line for line in lines if line not in harmonics]


def _find_lines(sections: list[SpectrumSection], bins: Bins, dt: float, power: Array,
                expected: Array, leak: float) -> tuple[list[Tone], Bools]:
    """Find lines, and mark the bins free of them and of side lobes above `leak` of the floor."""
    keep = np.ones(len(bins.frequency), dtype=bool)
    lines: list[Tone] = []
    spans: list[tuple[float, float]] = []
    # Length of the longest blocks for each number of samples per point
    longest = {section.step: max(one.length for one in sections if one.step == section.step)
               for section in sections}
    # Search the fastest part first, because its lines may alias into slower ones.
    for number in reversed(range(len(sections))):
        section = sections[number]
        # Shorter blocks, of less than eight neighbourhoods, are not searched (by judgment).
        if section.length != longest[section.step] or section.length < 512:
            continue
        # Lower coefficients belong to the slow terms, whose steep rise would pass for a line.
        here = np.flatnonzero(bins.section == number)[max(0, 32 - section.first):]
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
            # Use the bins around the peak, as side lobes are asymmetric, above all near Nyquist.
            top = int(np.argmax(excess))
            # A rise of 64 bins or more is a broad hump; use its centre of mass.
            middle = slice(max(top - 2, 0), top + 3) if len(excess) < 64 else slice(None)
            centre = float(np.average(frequency[part][middle], weights=excess[middle]))
            line = Tone(centre, float(np.sqrt(2 * excess.sum() / section.length)))
            if section.step == 1 or not is_alias(line, lines, section.step, dt, 3 * width):
                lines.append(line)
    # Shorter blocks of the same stage contain the same lines at a lower resolution. There side
    # lobes reach over fewer bins, but these are wider.
    for number, section in enumerate(sections):
        if section.length == longest[section.step]:
            continue
        farther = float(np.sqrt(longest[section.step] / section.length)) - 1
        here = np.flatnonzero(bins.section == number)
        for low, high in spans:
            width = 2 * section.spacing_hz(dt) + farther * (high - low) / 2
            inside = (bins.frequency[here] > low - width) & (bins.frequency[here] < high + width)
            keep[here[inside]] = False
    lines.sort(key=lambda line: -line.amplitude)
    return lines, keep


def _lines_of(power: Array, expected: Array, blocks: int, leak: float
              ) -> tuple[list[tuple[slice, Array]], Bools]:
    """Find lines: the bins of each and its power there, and a mask of all affected bins."""
    taken = np.zeros(len(power), dtype=bool)
    found: list[tuple[slice, Array]] = []
    # Search for sharp lines in single bins, then for broad idle tones of a quantizer in means.
    for scale in (1, 32, 8) if blocks >= _MANY else (1,):
        # A first fit flattens the spectrum for sharp lines. It may miss a low-pass and turn its
        # knee into a hump, so broad lines are searched for in the original spectrum.
        level = expected if scale == 1 else np.ones(len(power))
        candidates = []
        ratio = power / level
        # Side lobes of a strong line raise the floor around it, but not that of the whole part.
        usual = float(np.median(ratio)) * blocks / float(chi_square.lower(0.5, blocks))
        places = rises(np.where(taken, np.nan, ratio), blocks, scale)
        counted = taken.copy()
        for begin, end, _ in places:
            counted[begin:end] = True
        for begin, end, floor in places:
            excess = np.maximum(power[begin:end] - floor * level[begin:end], 0)
            peak = float(np.max(excess / level[begin:end])) / min(floor, usual)
            # A sharp line leaks into side lobes; a broad one has skirts as wide as itself.
            reach = 1 + (int(np.ceil(np.sqrt(peak / leak) / np.pi)) if scale == 1 else end - begin)
            around = slice(max(0, begin - reach), end + reach)
            # Leaked power is part of the line; a bin in reach of two lines counts once.
            leaked = (power[around] - floor * level[around])[~counted[around]].sum()
            excess *= 1 + max(float(leaked), 0.0) / float(excess.sum())
            counted[around] = taken[around] = True
            for part in _peaks(excess) if scale == 1 else [slice(0, end - begin)]:
                candidates.append((slice(begin + part.start, begin + part.stop), excess[part]))
        candidates.sort(key=lambda c: -float(c[1].max()))
        main: list[tuple[int, float]] = []
        for part, excess in candidates:
            place, height = part.start + int(np.argmax(excess)), float(excess.max())
            # Side lobes beyond half the sample rate fold back.
            lobes = sum(top / (1 + (np.pi * (place - at) / 2) ** 2)
                        for other, top in main for at in (other, 2 * len(power) - other))
            # Next to a stronger line, a line must be twice as high as the side lobe. In averages
            # of few blocks, where side lobes scatter, four times. Chosen by judgment.
            if scale == 1 and height < lobes * (2.0 if blocks >= _MANY else 4.0):
                continue
            main.append((place, height))
            found.append((part, excess))
    return found, taken


def rises(ratio: Array, blocks: int, scale: int) -> list[tuple[int, int, float]]:
    """
    Find rises of a flattened spectrum above its neighbourhood: begin, end and level around.

    The spectrum is first averaged over `scale` bins, which sets the width of lines to be found.
    Bins that belong to a sharper line are NaN.
    """
    count = len(ratio) // scale
    dof = blocks * scale
    # The median of strongly scattering values needs a larger neighbourhood.
    neighbourhood = _NEIGHBOURHOOD if dof >= _MANY else 4 * _NEIGHBOURHOOD - 3
    if count < neighbourhood:
        return []
    cells = ratio[:count * scale].reshape(count, scale)
    known = np.isfinite(cells).sum(axis=1)
    mean = np.nansum(cells, axis=1) / np.maximum(known, 1)
    empty = known < (scale + 1) // 2
    middle = float(chi_square.lower(0.5, dof)) / dof
    # In one of 10,000 records, a part of the spectrum shows a line by chance.
    chance = float(chi_square.upper(1e-4 / count, dof)) / dof
    # In long records even the smallest rise is significant, so require a least height. It is
    # larger for broad lines, which a bend of the spectrum resembles. Chosen by judgment.
    least = 1.3 if scale == 1 else 1.5
    hit = np.zeros(count, dtype=bool)
    floor = mean
    for _ in range(4):
        # Interpolate over cells already found, so that several lines do not raise the median.
        good = np.flatnonzero(~(hit | empty))
        if len(good) < neighbourhood:
            return []
        level = np.interp(np.arange(count), good, mean[good])
        floor = (median_filter(level, neighbourhood, mode='reflect') if scale == 1
                 else higher_side(level, neighbourhood)) / middle
        # A strictly periodic signal has no power between its lines. Limit the floor to -90 dB of
        # the mean level, which is below any noise, so that ratios to it are finite.
        floor = np.maximum(floor, 1e-9 * float(mean.mean()))
        found = (mean > floor * max(chance, least)) & ~empty
        # Far below the largest floor, in a stop band, it is a side lobe of the filter's response.
        found &= mean > (1e-3 if scale == 1 else 0.1) * floor.max()
        if (found == hit).all():
            break
        hit = found
    # If more bins rise, it is the shape of the spectrum, not a line. Chosen by judgment.
    if not hit.any() or hit.mean() > 0.3:
        return []
    places = np.flatnonzero(hit)
    groups = np.split(places, np.flatnonzero(np.diff(places) > 4) + 1)
    if scale == 1 and dof >= _MANY:
        # Knee and side lobes of a filter are wider than a line, which also rises above the nearest
        # bins. Chosen by judgment.
        near = median_filter(mean, 25, mode='nearest') / middle
        groups = [g for g in groups if (mean[g] > near[g] * max(chance, least)).any()]
    return [(int(g[0]) * scale, (int(g[-1]) + 1) * scale, float(floor[g].min())) for g in groups]


def higher_side(level: Array, neighbourhood: int) -> Array:
    """
    Return the larger of the medians to the left and to the right.

    A broad line must rise above both sides; otherwise the knee of a low-pass would pass for one.
    """
    size = neighbourhood // 2 + 1 - neighbourhood // 2 % 2
    left, right = (median_filter(level, size, mode='nearest', origin=side * (size // 2))
                   for side in (1, -1))
    return np.asarray(np.maximum(left, right))


def _peaks(level: Array) -> list[slice]:
    """Split a cluster into one part per local maximum, at the lowest points between them."""
    tops = np.flatnonzero((level == maximum_filter1d(level, 7, mode='constant')) & (level > 0))
    cuts = [int(a + np.argmin(level[a:b])) for a, b in pairwise(tops)]
    return [slice(a, b) for a, b in pairwise([0, *cuts, len(level)])]


def is_alias(line: Tone, lines: list[Tone], step: int, dt: float, width: float) -> bool:
    """Return whether a line in means over `step` samples is an alias of the known `lines`."""
    rate = 1 / (step * dt)
    images = [known.amplitude * np.sinc(known.frequency_hz / rate)
              / np.sinc(known.frequency_hz * dt) for known in lines
              if abs(abs(known.frequency_hz - rate * round(known.frequency_hz / rate))
                     - line.frequency_hz) < width]
    # A line of twice that amplitude is no alias: among hundreds of lines, one is always near.
    return line.amplitude < 2.0 * float(np.sqrt(np.sum(np.square(images))))
