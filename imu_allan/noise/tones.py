# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Narrow lines in the spectrum: vibration, mains, idle tones of a quantizer.

A line would pass for flicker or white noise in a fit, so its bins, and those its side lobes reach,
are left out and the line is named. A line is what rises above the median of its neighbourhood by
more than chance allows, seen at three resolutions: a quantizer's idle tone is a few hertz wide.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.signal import find_peaks
from scipy.stats import chi2

from imu_allan.noise.likelihood import Bins
from imu_allan.noise.periodogram import Piece

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_NEIGHBOURHOOD = 65
_SHORTEST_PIECE = 512
_FALSE_ALARM = 1e-4
_LEAK = 0.02
_WIDEST_SHARE = 0.3
_LEAST_RISE = 1.3
_LEAST_BROAD_RISE = 1.5
_SCALES = (1, 8, 32)
_LOWEST_INDEX = 12
_MOST = 32


@dataclass(frozen=True)
class Line:
    """A line: frequency in Hz, amplitude in the unit of a sample."""

    frequency_hz: float
    amplitude: float


def find_lines(pieces: list[Piece], bins: Bins, axis: int, dt: float,
               expected: Array) -> tuple[list[Line], Mask]:
    """
    Find the lines of one axis.

    Parameters
    ----------
    pieces : list of Piece
        From the slowest to the fastest part.
    bins : Bins
        Of the same pieces.
    axis : int
    dt : float
        Sample interval in seconds.
    expected : ndarray, shape (bins,)
        A first fit, by which the spectrum is flattened.

    Returns
    -------
    lines : list of Line
        The strongest first.
    keep : ndarray of bool, shape (bins,)
        False where a line or its side lobes are.
    """
    keep = np.ones(len(bins.frequency), dtype=bool)
    lines: list[Line] = []
    spans: list[tuple[float, float]] = []
    longest = {piece.step: max(p.length for p in pieces if p.step == piece.step)
               for piece in pieces}
    # The fastest part first: what it finds may stand again in a slower one, folded.
    for number in reversed(range(len(pieces))):
        piece = pieces[number]
        if piece.length != longest[piece.step] or piece.length < _SHORTEST_PIECE:
            continue
        here = np.flatnonzero(bins.piece == number)
        here = here[max(0, _LOWEST_INDEX - piece.first):]
        if len(here) < _NEIGHBOURHOOD:
            continue
        ratio = bins.power[axis, here] / expected[here]
        width = 1 / (2 * piece.length * piece.step * dt)
        taken = np.zeros(len(here), dtype=bool)
        for scale in _SCALES:
            for begin, end, floor in _rises(np.where(taken, np.nan, ratio), piece.blocks, scale):
                excess = np.maximum(ratio[begin:end] - floor, 0)
                # A sharp line leaks into side lobes; a broad one has skirts of its own width.
                reach = 1 + (int(np.ceil(np.sqrt(excess.max() / floor / _LEAK) / np.pi))
                             if scale == 1 else end - begin)
                left, right = max(0, begin - reach), min(len(here), end + reach)
                taken[left:right] = True
                spans.append((bins.frequency[here[left]], bins.frequency[here[right - 1]]))
                level = excess * expected[here[begin:end]]
                for part in _peaks(level) if scale == 1 else [slice(None)]:
                    at = bins.frequency[here[begin:end]][part]
                    frequency = float(level[part] @ at / level[part].sum())
                    amplitude = float(np.sqrt(2 * level[part].sum() / piece.length))
                    if piece.step == 1 or not _folded(frequency, lines,
                                                      1 / (piece.step * dt), 3 * width):
                        lines.append(Line(frequency, amplitude))
        keep[here[taken]] = False
    # Shorter blocks of the same stage see the same lines, only less sharply.
    for number, piece in enumerate(pieces):
        if piece.length == longest[piece.step]:
            continue
        width = 2 / (2 * piece.length * piece.step * dt)
        here = np.flatnonzero(bins.piece == number)
        for low_hz, high_hz in spans:
            inside = ((bins.frequency[here] > low_hz - width)
                      & (bins.frequency[here] < high_hz + width))
            keep[here[inside]] = False
    lines.sort(key=lambda line: -line.amplitude)
    return lines[:_MOST], keep


def _rises(ratio: Array, blocks: int, scale: int) -> list[tuple[int, int, float]]:
    """
    Where a flattened spectrum rises above its neighbourhood: begin, end and level around.

    The spectrum is averaged over `scale` bins first, which decides how broad a line is seen. Bins
    that are NaN have been taken by a sharper line.
    """
    count = len(ratio) // scale
    if count < _NEIGHBOURHOOD:
        return []
    cells = ratio[:count * scale].reshape(count, scale)
    known = np.isfinite(cells).sum(axis=1)
    mean = np.nansum(cells, axis=1) / np.maximum(known, 1)
    empty = known < (scale + 1) // 2
    dof = blocks * scale
    middle = chi2.ppf(0.5, dof) / dof
    chance = chi2.isf(_FALSE_ALARM / count, dof) / dof
    least = _LEAST_RISE if scale == 1 else _LEAST_BROAD_RISE
    hit = np.zeros(count, dtype=bool)
    floor = mean
    for _ in range(4):
        # Cells already found are levelled, lest several lines lift the median together.
        good = np.flatnonzero(~(hit | empty))
        if len(good) < _NEIGHBOURHOOD:
            return []
        level = np.interp(np.arange(count), good, mean[good])
        floor = median_filter(level, _NEIGHBOURHOOD, mode='nearest') / middle
        found = (mean > floor * max(chance, least)) & ~empty
        if (found == hit).all():
            break
        hit = found
    if not hit.any() or hit.mean() > _WIDEST_SHARE:
        return []
    places = np.flatnonzero(hit)
    groups = np.split(places, np.flatnonzero(np.diff(places) > 4) + 1)
    return [(int(g[0]) * scale, (int(g[-1]) + 1) * scale, float(floor[g].min())) for g in groups]


def _peaks(level: Array) -> list[slice]:
    """Parts of a cluster, one for every line that stands out in it, cut at the lowest points."""
    padded = np.log(np.maximum(np.concatenate(([0.0], level, [0.0])), 1e-6 * level.max()))
    tops = find_peaks(padded, prominence=np.log(4), distance=3)[0] - 1
    if len(tops) < 2:
        return [slice(0, len(level))]
    cuts = [int(a + np.argmin(level[a:b])) for a, b in zip(tops[:-1], tops[1:])]
    return [slice(a, b) for a, b in zip([0, *cuts], [*cuts, len(level)])]


def _folded(frequency: float, lines: list[Line], rate: float, width: float) -> bool:
    """Whether a line is the image of a known one at a lower sample rate."""
    return any(abs(abs(line.frequency_hz - rate * round(line.frequency_hz / rate)) - frequency)
               < width for line in lines)
