# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Charts as SVG text: grid, bands, lines, points, and labels that do not overlap.

The charts of the report are drawn here and not by a library in the browser. So they need no
script, print as displayed, contain text that can be searched and copied, and take only kilobytes.
Colours are classes of the page's style sheet, so a dark page has dark charts.
"""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from html import escape
from itertools import product
from math import ceil, floor, inf, log10

from imu_allan.arrays import Array
import numpy as np
from numpy.typing import ArrayLike

Box = tuple[float, float, float, float]

LETTER = 0.56
"""Mean width of a letter relative to its height, in the sans-serif fonts of browsers."""

FONT = 12.5
"""Size of all text in view box units, which are pixels at the intended width."""


@dataclass(frozen=True)
class Scale:
    """
    A linear or logarithmic mapping from values to pixels.

    Attributes
    ----------
    low, high : float
        Values at the ends.
    log : bool
    start, end : float
        Pixels at the ends.

    """

    low: float
    high: float
    log: bool
    start: float
    end: float

    def __call__(self, values: ArrayLike) -> Array:
        """Return the pixels of `values`; values far below a logarithmic scale are clipped."""
        v = np.asarray(values, dtype=np.float64)
        # Clip at a thousand times the length of the scale, far out of sight, to avoid overflow.
        with np.errstate(over='ignore'):
            if self.log:
                share = (np.log(np.maximum(v, self.low * 1e-6)) - np.log(self.low)) / np.log(
                    self.high / self.low)
            else:
                share = (v - self.low) / (self.high - self.low)
        return np.asarray(self.start + np.clip(share, -1e3, 1e3) * (self.end - self.start))

    def ticks(self, most: int = 8, factor: float = 1.0) -> list[tuple[float, str]]:
        """Return pixels and labels of at most `most` ticks, in a unit with `factor` per value."""
        ticks = (_log_ticks if self.log else _linear_ticks)(
            self.low * factor, self.high * factor, most)
        return [(float(self(value / factor)), text) for value, text in ticks]


def power_text(value: float) -> str:
    """
    Format the label of a tick on a logarithmic axis.

    Examples
    --------
    >>> power_text(0.02), power_text(1e-5), power_text(2e6)
    ('0.02', '10⁻⁵', '2×10⁶')

    """
    k = floor(log10(value) + 1e-9)
    if -3 <= k <= 3:
        return f'{value:.6g}'
    times = round(value / 10.0**k)
    power = str(k).translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))
    return f'{"" if times == 1 else f"{times}×"}10{power}'


def _log_ticks(low: float, high: float, most: int) -> list[tuple[float, str]]:
    first, last = ceil(log10(low) - 1e-9), floor(log10(high) + 1e-9)
    step = max(1, ceil((last - first + 1) / most))
    powers = [10.0**k for k in range(first, last + 1) if k % step == 0]
    if last <= first:
        powers = [m * 10.0**k for k in range(first - 1, last + 1) for m in (1, 2, 5)
                  if low <= m * 10.0**k <= high]
        if len(powers) < 2:
            return _linear_ticks(low, high, 4)
    return [(value, power_text(value)) for value in powers]


def _linear_ticks(low: float, high: float, most: int) -> list[tuple[float, str]]:
    rough = (high - low) / max(1, most - 1)
    size = 10.0 ** floor(log10(rough))
    step = size * next(m for m in (1, 2, 5, 10) if m * size >= rough * 0.999)
    # A single tick would not show the scale of the axis.
    while floor(high / step + 1e-9) - ceil(low / step - 1e-9) < 1:
        size = 10.0 ** floor(log10(step * 0.999))
        step = size * next(m for m in (5, 2, 1) if m * size < step * 0.999)
    digits = max(0, -floor(log10(step) + 1e-9))
    ticks = [(k * step, f'{k * step:.{digits}f}'.replace('-', '\N{MINUS SIGN}'))
             for k in range(ceil(low / step - 1e-9), floor(high / step + 1e-9) + 1)]
    return ticks[::2] if len(ticks) > most else ticks


@dataclass
class Panel:
    """
    One pair of axes in a drawing, whose methods draw in turn, clipped within `framed`.

    Attributes
    ----------
    drawing : Drawing
    box : Box
        Left, top, right and bottom in pixels.
    x, y : Scale
    factor : float
        Units of the axis on the left per unit of y.
    x_title, y_title : str
    second : str
        Title of an axis on the right, in the unit of y; empty if there is none.

    """

    drawing: 'Drawing'
    box: Box
    x: Scale
    y: Scale
    factor: float
    x_title: str
    y_title: str
    second: str

    def framed(self, *, x_labels: bool = True, most_y: int = 8) -> AbstractContextManager[None]:
        """Draw grid, ticks, titles and frame, and clip what is drawn within the context."""
        left, top, right, bottom = self.box
        text, line = self.drawing.text, self.drawing.line
        written = inf
        for at, label in self.y.ticks(most_y, self.factor):
            line('grid', left, at, right, at)
            # A low strip has room for fewer labels than lines.
            if abs(at - written) >= FONT * 1.1:
                text(left - 7, at + FONT * 0.35, label, 'tick', 'end')
                written = at
        for at, label in self.x.ticks(max(3, int((right - left) / 70))):
            line('grid', at, top, at, bottom)
            if x_labels:
                text(at, bottom + FONT * 1.35, label, 'tick', 'middle')
        if self.x_title:
            text((left + right) / 2, bottom + FONT * 2.9, self.x_title, 'title', 'middle')
        if self.y_title:
            # Place the title above the axis, as rotated titles are rarely read.
            text(left - 50, top - 9, self.y_title, 'title')
        if self.second:
            for at, label in self.y.ticks(most_y):
                line('tickmark', right, at, right + 5, at)
                text(right + 9, at + FONT * 0.35, label, 'tick')
            text(right + 50, top - 9, self.second, 'title', 'end')
        place = f'x="{left:g}" y="{top:g}" width="{right - left:g}" height="{bottom - top:g}"'
        clip = f'{self.drawing.name}-clip{len(self.drawing.parts)}'
        return self._within(f'<clipPath id="{clip}"><rect {place}/></clipPath>'
                            f'<rect class="frame" {place}/><g clip-path="url(#{clip})">')

    def group(self, name: str, kind: str) -> AbstractContextManager[None]:
        """Group what is drawn within the context, which is shown and hidden together."""
        return self._within(f'<g class="{kind}" data-group="{escape(name)}">')

    @contextmanager
    def _within(self, opening: str) -> Iterator[None]:
        self.drawing.parts.append(opening)
        yield
        self.drawing.parts.append('</g>')

    def band(self, kind: str, x: ArrayLike, low: ArrayLike, high: ArrayLike) -> None:
        """Draw the area between two curves, with gaps where a value is NaN."""
        px, lows, highs = self.x(x), self._clipped(low), self._clipped(high)
        self.drawing.path(kind, ''.join(
            f'{_path(np.r_[px[part], px[part][::-1]], np.r_[highs[part], lows[part][::-1]])}Z'
            for part in _unbroken(lows + highs)))

    def line(self, kind: str, x: ArrayLike, y: ArrayLike) -> None:
        """Draw a curve, with gaps where a value is NaN, that ends at the edge of the panel."""
        px, py = self.x(x), self._clipped(y)
        self.drawing.path(kind, ''.join(_path(px[part], py[part]) for part in _unbroken(py)))

    def points(self, x: ArrayLike, y: ArrayLike, shape: str, titles: Sequence[str],
               hollow: ArrayLike = False) -> None:
        """Draw markers with tooltips; points outside the panel become arrows."""
        _, top, _, bottom = self.box
        for px, py, title, empty in zip(self.x(x), self.y(y), titles,
                                        np.broadcast_to(hollow, len(titles)), strict=True):
            if self._inside(px, py):
                kind, path = 'mark hollow' if empty else 'mark', _MARKS[shape]
            else:
                kind = 'beyond'
                path = 'v13m-4 -7l4 -6l4 6' if py < top else 'v-13m-4 7l4 6l4 -6'
                py = min(max(float(py), top + 1), bottom - 1)
            self.drawing.path(kind, f'M{px:.1f} {py:.1f}{path}', title)

    def span(self, x0: float, x1: float, kind: str, title: str) -> None:
        """Shade a range of x, at least one pixel wide."""
        left, top, right, bottom = self.box
        begin, end = np.clip(self.x([x0, x1]), left, right)
        self.drawing.parts.append(
            f'<rect class="{kind}" x="{begin:.1f}" y="{top:g}" '
            f'width="{max(1.0, end - begin):.1f}" height="{bottom - top:g}">'
            f'<title>{escape(title)}</title></rect>')

    def vertical(self, x: float, kind: str, title: str) -> None:
        """Draw a vertical line from top to bottom."""
        _, top, _, bottom = self.box
        self.drawing.path(kind, f'M{float(self.x(x)):.1f} {top:g}V{bottom:g}', title)

    def label(self, x: float, y: float, lines: Sequence[str], avoid: Array, taken: list[Box], *,
              ring: bool = True) -> None:
        """Label a point where this hides least, tied to the point; add the box to `taken`."""
        px, py = float(self.x(x)), float(self.y(y))
        if not self._inside(px, py):
            return
        width = LETTER * FONT * max(map(len, lines)) + 8
        height = FONT * 1.25 * len(lines) + 4
        place = best_place((px, py), (width, height), self.box, avoid, taken)
        taken.append(place)
        left, top, _, _ = place
        self.drawing.line('leader', px, py, left if left > px else left + width, top + height / 2)
        self.drawing.parts.append(
            (f'<circle class="ring" cx="{px:.1f}" cy="{py:.1f}" r="5.5"/>' if ring else '')
            + f'<rect class="plate" x="{left:.1f}" y="{top:.1f}" width="{width:.1f}" '
            f'height="{height:.1f}"/>')
        for row, text in enumerate(lines):
            self.drawing.text(left + 4, top + FONT * (1.1 + 1.25 * row), text, 'name')

    def _inside(self, px: float, py: float) -> bool:
        left, top, right, bottom = self.box
        return left - 0.5 <= px <= right + 0.5 and top - 0.5 <= py <= bottom + 0.5

    def _clipped(self, y: ArrayLike) -> Array:
        """Return the pixels of y, limited to a margin around the panel, where they are clipped."""
        _, top, _, bottom = self.box
        return np.clip(self.y(y), top - 40, bottom + 40)


_MARKS = {'circle': 'm-3.8 0a3.8 3.8 0 1 0 7.6 0a3.8 3.8 0 1 0 -7.6 0Z',
          'square': 'm-3.5 -3.5h7v7h-7Z', 'triangle': 'm0 -4.6l4.3 7.6h-8.6Z',
          'diamond': 'm0 -4.8l4.8 4.8l-4.8 4.8l-4.8 -4.8Z'}
SHAPES = tuple(_MARKS)


@dataclass
class Drawing:
    """
    An SVG image.

    Attributes
    ----------
    width, height : float
    name : str
        Identifier, unique in the page.
    label : str
        Alternative text for screen readers.
    parts : list of str
        What has been drawn so far.

    """

    width: float
    height: float
    name: str
    label: str
    parts: list[str] = field(default_factory=list)

    @property
    def narrow(self) -> bool:
        """Whether it is for a phone."""
        return self.width < 500

    def panel(self, box: Box, x: tuple[float, float, bool], y: tuple[float, float, bool],
              titles: tuple[str, str, str], factor: float = 1.0) -> Panel:
        """Return a panel that fills a box; `x` and `y`: lowest, highest, whether logarithmic."""
        left, top, right, bottom = box
        return Panel(self, box, Scale(*x, left, right), Scale(*y, bottom, top), factor, *titles)

    def text(self, x: float, y: float, text: str, kind: str, anchor: str = 'start') -> None:
        """Draw a text."""
        self.parts.append(f'<text class="{kind}" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">'
                          f'{escape(text)}</text>')

    def line(self, kind: str, x0: float, y0: float, x1: float, y1: float) -> None:
        """Draw a straight line."""
        self.path(kind, f'M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}')

    def path(self, kind: str, path: str, title: str = '') -> None:
        """Draw a path, with a tooltip if there is a `title`; nothing if it is empty."""
        end = f'><title>{escape(title)}</title></path>' if title else '/>'
        self.parts += [f'<path class="{kind}" d="{path}"{end}'] if path else []

    def svg(self, size: str) -> str:
        """Return the image as SVG; the class `size` selects the page width for which it is."""
        return (f'<svg class="chart {size}" viewBox="0 0 {self.width:g} {self.height:g}" '
                f'role="img" aria-label="{escape(self.label)}">{"".join(self.parts)}</svg>')


def _path(x: Array, y: Array) -> str:
    return 'M' + 'L'.join(f'{px:.1f} {py:.1f}' for px, py in zip(x, y, strict=True))


def _unbroken(values: Array) -> Iterable[slice]:
    """Return slices of the values between NaNs."""
    edges = np.flatnonzero(np.diff(np.isfinite(values), prepend=False, append=False))
    return map(slice, edges[::2], edges[1::2])


def best_place(point: tuple[float, float], size: tuple[float, float], panel: Box, avoid: Array,
               taken: Sequence[Box], scale: float = 1.0) -> Box:
    """
    Return the best box for a label near a point.

    Parameters
    ----------
    point : (float, float)
        The labelled point in pixels; y grows downwards.
    size : (float, float)
        Width and height of the label.
    panel : (float, float, float, float)
        Left, top, right and bottom of the panel.
    avoid : ndarray, shape (n, 2)
        Points that should stay free.
    taken : sequence of box
        Boxes of the labels placed so far.
    scale : float, optional
        Factor on the distances to try: the height of the text divided by 12.5.

    """
    # Try closest positions first, above right of the point; distances are for text 12.5 high.
    down, along = np.array([*product((-34, 34, -58, 58, -86, 86, 0, -120, 120),
                                     (16, -16, 44, -44, 90, -90))]).T
    begin = np.array([point[0] + along * scale - np.where(along < 0, size[0], 0),
                      point[1] + down * scale - size[1] / 2])
    end = begin + np.reshape(size, (2, 1))

    def covered(boxes: ArrayLike, gap: float) -> Array:
        """Return how many of some boxes each position comes closer to than `gap`."""
        left, top, right, bottom = np.reshape(boxes, (-1, 4, 1)).swapaxes(0, 1)
        near = ((begin[0] < right + gap) & (left - gap < end[0])
                & (begin[1] < bottom + gap) & (top - gap < end[1]))
        return np.asarray(np.count_nonzero(near, axis=0))

    left, top, right, bottom = panel
    outside = ((begin[0] < left + 2) | (end[0] > right - 2)
               | (begin[1] < top + 2) | (end[1] > bottom - 2))
    # Cost per unit of distance, compared with 3 for each covered point.
    cost = (1000 * outside + 500 * covered(taken, 3) + 3 * covered(np.hstack([avoid, avoid]), 4)
            + 0.02 * (abs(along) + abs(down)))
    x, y = map(float, begin[:, np.argmin(cost)])
    return x, y, x + size[0], y + size[1]
