# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Charts as SVG text: grid, bands, lines, points, and labels that do not overlap.

The charts of the report are drawn here and not by a library in the browser. So they need no
script, print as displayed, contain text that can be searched and copied, and take only kilobytes.
Colours are classes of the page's style sheet, so a dark page has dark charts. The twenty drawings
of a report take 0.2 s of CPU time; matplotlib takes 0.8 s for half of them, and 0.4 s to start.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from html import escape
from itertools import product
from math import ceil, floor, inf, log10
import re

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

    def ticks(self, most: int = 8) -> list[tuple[float, str]]:
        """Return at most `most` tick values with their labels."""
        low, high = self.low, self.high
        if not self.log:
            return _linear_ticks(low, high, most)
        first, last = ceil(log10(low) - 1e-9), floor(log10(high) + 1e-9)
        if last - first >= 1:
            step = max(1, ceil((last - first + 1) / most))
            return [(10.0**k, power_text(10.0**k))
                    for k in range(first, last + 1) if k % step == 0]
        ticks = [(m * 10.0**k, power_text(m * 10.0**k)) for k in range(first - 1, last + 1)
                 for m in (1, 2, 5) if low <= m * 10.0**k <= high]
        return ticks if len(ticks) > 1 else _linear_ticks(low, high, 4)


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
    One pair of axes in a drawing, to which parts are added in turn.

    Attributes
    ----------
    box : Box
        Left, top, right and bottom in pixels.
    x, y : Scale
    parts : list of str
        SVG elements drawn so far.

    """

    box: Box
    x: Scale
    y: Scale
    parts: list[str] = field(default_factory=list)

    def frame(self, x_title: str, y_title: str, second: tuple[float, str] | None = None, *,
              x_labels: bool = True, most_y: int = 8) -> None:
        """Draw grid, ticks and titles; `second`: factor to a scale on the right, and title."""
        left, top, right, bottom = self.box
        written = inf
        for value, text in self.y.ticks(most_y):
            at = float(self.y(value))
            self.parts.append(_line('grid', left, at, right, at))
            # A low strip has room for fewer labels than lines.
            if abs(at - written) >= FONT * 1.1:
                self.parts.append(_text(left - 7, at + FONT * 0.35, text, 'tick', 'end'))
                written = at
        for value, text in self.x.ticks(max(3, int((right - left) / 70))):
            at = float(self.x(value))
            self.parts.append(_line('grid', at, top, at, bottom))
            if x_labels:
                self.parts.append(_text(at, bottom + FONT * 1.35, text, 'tick', 'middle'))
        if x_title:
            self.parts.append(_text((left + right) / 2, bottom + FONT * 2.9, x_title, 'title',
                                    'middle'))
        if y_title:
            # Place the title above the axis, as rotated titles are rarely read.
            self.parts.append(_text(left - 50, top - 9, y_title, 'title', 'start'))
        if second is not None:
            factor, title = second
            other = replace(self.y, low=self.y.low * factor, high=self.y.high * factor)
            for value, text in other.ticks(most_y):
                at = float(other(value))
                self.parts.append(_line('tickmark', right, at, right + 5, at))
                self.parts.append(_text(right + 9, at + FONT * 0.35, text, 'tick', 'start'))
            self.parts.append(_text(right + 50, top - 9, title, 'title', 'end'))
        self.parts.append(f'<rect class="frame" x="{left:g}" y="{top:g}" '
                          f'width="{right - left:g}" height="{bottom - top:g}"/>')

    def band(self, x: ArrayLike, low: ArrayLike, high: ArrayLike, kind: str) -> str:
        """Return the area between two curves, with gaps where a value is NaN."""
        px, lows, highs = self.x(x), self._clipped(low), self._clipped(high)
        path = ''
        for part in _unbroken(lows + highs):
            there = [*zip(px[part], highs[part], strict=True),
                     *zip(px[part][::-1], lows[part][::-1], strict=True)]
            path += f'{_path(there)}Z'
        return f'<path class="{kind}" d="{path}"/>' if path else ''

    def line(self, x: ArrayLike, y: ArrayLike, kind: str) -> str:
        """Return a curve, with gaps where a value is NaN, that ends at the edge of the panel."""
        px, py = self.x(x), self._clipped(y)
        path = ''.join(_path(zip(px[part], py[part], strict=True)) for part in _unbroken(py))
        return f'<path class="{kind}" d="{path}"/>' if path else ''

    def points(self, x: ArrayLike, y: ArrayLike, shape: str, titles: Sequence[str],
               hollow: Sequence[bool] = ()) -> str:
        """Return markers with tooltips; points outside the panel become arrows."""
        _, top, _, bottom = self.box
        marks = []
        for px, py, title, empty in zip(self.x(x), self.y(y), titles,
                                        hollow or [False] * len(titles), strict=True):
            if self._inside(px, py):
                kind, path = 'mark hollow' if empty else 'mark', _MARKS[shape]
            else:
                kind = 'beyond'
                path = 'M{x:.1f} {y:.1f}' + ('v13m-4 -7l4 -6l4 6' if py < top else
                                             'v-13m-4 7l4 6l4 -6')
                py = min(max(float(py), top + 1), bottom - 1)
            marks.append(f'<path class="{kind}" d="{path.format(x=px, y=py)}">'
                         f'<title>{escape(title)}</title></path>')
        return ''.join(marks)

    def span(self, x0: float, x1: float, kind: str, title: str) -> str:
        """Return the shading of a range of x, at least one pixel wide."""
        left, top, right, bottom = self.box
        begin, end = np.clip(self.x([x0, x1]), left, right)
        return (f'<rect class="{kind}" x="{begin:.1f}" y="{top:g}" '
                f'width="{max(1.0, end - begin):.1f}" height="{bottom - top:g}">'
                f'<title>{escape(title)}</title></rect>')

    def vertical(self, x: float, kind: str, title: str) -> str:
        """Return a vertical line from top to bottom."""
        at = float(self.x(x))
        _, top, _, bottom = self.box
        return (f'<path class="{kind}" d="M{at:.1f} {top:g}V{bottom:g}">'
                f'<title>{escape(title)}</title></path>')

    def label(self, x: float, y: float, lines: Sequence[str], avoid: Array, kind: str,
              taken: list[Box], *, ring: bool = True) -> str:
        """Return a label where it hides least, tied to the point; add its box to `taken`."""
        px, py = float(self.x(x)), float(self.y(y))
        if not self._inside(px, py):
            return ''
        width = LETTER * FONT * max(map(len, lines)) + 8
        height = FONT * 1.25 * len(lines) + 4
        place = best_place((px, py), (width, height), self.box, avoid, taken)
        taken.append(place)
        left, top, _, _ = place
        end_x = left if left > px else left + width
        rows = ''.join(_text(left + 4, top + FONT * (1.1 + 1.25 * row), text, kind, 'start')
                       for row, text in enumerate(lines))
        return (f'<path class="leader" d="M{px:.1f} {py:.1f}L{end_x:.1f} {top + height / 2:.1f}"/>'
                + (f'<circle class="ring" cx="{px:.1f}" cy="{py:.1f}" r="5.5"/>' if ring else '')
                + f'<rect class="plate" x="{left:.1f}" y="{top:.1f}" width="{width:.1f}" '
                f'height="{height:.1f}"/>{rows}')

    def pixels(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the pixels of points, shape (n, 2)."""
        return np.column_stack([self.x(x), self.y(y)])

    def _inside(self, px: float, py: float) -> bool:
        left, top, right, bottom = self.box
        return left - 0.5 <= px <= right + 0.5 and top - 0.5 <= py <= bottom + 0.5

    def _clipped(self, y: ArrayLike) -> Array:
        """Return the pixels of y, limited to a margin around the panel, where they are clipped."""
        _, top, _, bottom = self.box
        return np.clip(self.y(y), top - 40, bottom + 40)


_MARKS = {
    'circle': 'M{x:.1f} {y:.1f}m-3.8 0a3.8 3.8 0 1 0 7.6 0a3.8 3.8 0 1 0 -7.6 0Z',
    'square': 'M{x:.1f} {y:.1f}m-3.5 -3.5h7v7h-7Z',
    'triangle': 'M{x:.1f} {y:.1f}m0 -4.6l4.3 7.6h-8.6Z',
    'diamond': 'M{x:.1f} {y:.1f}m0 -4.8l4.8 4.8l-4.8 4.8l-4.8 -4.8Z',
}
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

    """

    width: float
    height: float
    name: str
    label: str
    parts: list[str] = field(default_factory=list)

    def panel(self, box: Box, x: tuple[float, float, bool], y: tuple[float, float, bool]) -> Panel:
        """Return a panel that fills a box; `x` and `y`: lowest, highest, whether logarithmic."""
        left, top, right, bottom = box
        return Panel(box, Scale(*x, left, right), Scale(*y, bottom, top))

    def add(self, panel: Panel, inside: Iterable[str]) -> None:
        """Add the parts of a panel, and the elements `inside`, which are clipped at its edge."""
        number = len(self.parts)
        left, top, right, bottom = panel.box
        name = f'{self.name}-clip{number}'
        self.parts.append(
            f'<clipPath id="{name}"><rect x="{left:g}" y="{top:g}" width="{right - left:g}" '
            f'height="{bottom - top:g}"/></clipPath>{"".join(panel.parts)}'
            f'<g clip-path="url(#{name})">{"".join(inside)}</g>')

    def text(self, x: float, y: float, text: str, kind: str, anchor: str = 'start') -> None:
        """Add a text."""
        self.parts.append(_text(x, y, text, kind, anchor))

    def svg(self, size: str) -> str:
        """Return the image as SVG; the class `size` selects the page width for which it is."""
        return (f'<svg class="chart {size}" viewBox="0 0 {self.width:g} {self.height:g}" '
                f'role="img" aria-label="{escape(self.label)}">{"".join(self.parts)}</svg>')


def group(name: str, kind: str, parts: Iterable[str]) -> str:
    """Return a group of elements that are shown and hidden together."""
    return f'<g class="{kind}" data-group="{escape(name)}">{"".join(parts)}</g>'


def _text(x: float, y: float, text: str, kind: str, anchor: str) -> str:
    shown = re.sub(r'\s+', ' ', text)
    return (f'<text class="{kind}" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">'
            f'{escape(shown)}</text>')


def _line(kind: str, x0: float, y0: float, x1: float, y1: float) -> str:
    return f'<path class="{kind}" d="M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}"/>'


def _path(points: Iterable[tuple[float, float]]) -> str:
    return 'M' + 'L'.join(f'{x:.1f} {y:.1f}' for x, y in points)


def _unbroken(values: Array) -> list[slice]:
    """Return slices of the values between NaNs."""
    there = np.concatenate(([False], np.isfinite(values), [False]))
    edges = np.flatnonzero(there[1:] != there[:-1])
    return [slice(begin, end) for begin, end in zip(edges[::2], edges[1::2], strict=True)]


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
    width, height = size
    best, cost = (point[0], point[1], point[0] + width, point[1] + height), inf
    # Try closest positions first, above right of the point; distances are for text 12.5 high.
    for down, right in product((-34, 34, -58, 58, -86, 86, 0, -120, 120),
                               (16, -16, 44, -44, 90, -90)):
        left = point[0] + right * scale - (width if right < 0 else 0)
        top = point[1] + down * scale - height / 2
        box = (left, top, left + width, top + height)
        # Cost per unit of distance, compared with 3 for each covered point.
        price = _price(box, panel, avoid, taken) + 0.02 * (abs(right) + abs(down))
        if price < cost:
            best, cost = box, price
    return best


def _price(box: Box, panel: Box, avoid: Array, taken: Iterable[Box]) -> float:
    left, top, right, bottom = panel
    price = 0.0
    if box[0] < left + 2 or box[2] > right - 2 or box[1] < top + 2 or box[3] > bottom - 2:
        price += 1000
    for other in taken:
        if (box[0] < other[2] + 3 and other[0] < box[2] + 3
                and box[1] < other[3] + 3 and other[1] < box[3] + 3):
            price += 500
    covered = ((avoid[:, 0] > box[0] - 4) & (avoid[:, 0] < box[2] + 4)
               & (avoid[:, 1] > box[1] - 4) & (avoid[:, 1] < box[3] + 4))
    return price + 3.0 * float(covered.sum())
