# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The style of all figures: colours, fonts and lines, and the frame of the panels.

The colours of the three axes are distinguishable with colour-blind vision, their markers and
dashes also in greyscale print. Figures use matplotlib's object interface and its built-in
defaults, without pyplot or a display, and independently of files in the current folder.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from imu_allan.result import AxisResult
from imu_allan.sensor.units import engineering, typeset
from imu_allan.wording import SAMPLES
from imu_allan.writers.curves import limits_of
from imu_allan.writers.svg import power_text
import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure
    from matplotlib.gridspec import GridSpec

# After Okabe and Ito's palette for colour-blind readers. The blue is deeper, as theirs resembles
# the green to tritanopes.
COLOURS = {'x': '#d55e00', 'y': '#009e73', 'z': '#2340a0', 'ink': '#1a1a1a', 'soft': '#6b6b6b',
           'grid': '#e3e3e3', 'paper': '#ffffff', 'gap': '#8c8c8c', 'motion': '#e69f00',
           'good': '#eef3f7'}
SERIES = (COLOURS['z'], COLOURS['x'], COLOURS['y'], '#cc79a7', '#b8860b', '#56b4e9', '#6b6b6b')
"""Colours of results that are compared; no more than seven can be distinguished."""
DARK = {'#d55e00': '#ff8c42', '#009e73': '#4fe3b4', '#2340a0': '#5a8cf0', '#1a1a1a': '#ececec',
        '#6b6b6b': '#a5a5a5', '#e3e3e3': '#333840', '#ffffff': '#16181c', '#eef3f7': '#232a33',
        '#cc79a7': '#e39ac4', '#b8860b': '#f0e442', '#56b4e9': '#9fd0f0'}
"""Replacements for these colours in a picture when the page is dark."""
MARKERS = {'x': 'o', 'y': 's', 'z': '^'}
DASHES: dict[str, str | tuple[int, tuple[float, ...]]] = {
    'x': '-', 'y': (0, (5.0, 1.3)), 'z': (0, (8.0, 1.3, 1.6, 1.3))}
"""Dashes of the model lines if several axes share a panel: x and y look the same in greyscale."""


def empty_figure(width: float, height: float) -> Figure:
    """Return a figure of the given size in inches that needs no display."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    return figure


@contextmanager
def plot_style() -> Iterator[None]:
    """Apply the fonts, lines and colours of all figures within the context."""
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update({
            'font.family': 'DejaVu Sans', 'font.size': 9, 'axes.labelsize': 9,
            'axes.titlesize': 10, 'axes.titleweight': 'bold',
            'xtick.labelsize': 8, 'ytick.labelsize': 8,
            'figure.facecolor': COLOURS['paper'], 'axes.facecolor': COLOURS['paper'],
            'text.color': COLOURS['ink'],
            'axes.labelcolor': COLOURS['ink'], 'xtick.color': COLOURS['soft'],
            'ytick.color': COLOURS['soft'], 'axes.edgecolor': COLOURS['soft'],
            'axes.linewidth': 0.7, 'grid.color': COLOURS['grid'], 'grid.linewidth': 0.7,
            'axes.axisbelow': True, 'pdf.fonttype': 42, 'svg.fonttype': 'none',
            'svg.hashsalt': 'imu_allan', 'path.simplify': True})
        yield


def allan_panels(figure: Figure, grid: GridSpec, curves: Mapping[str, Mapping[str, AxisResult]]
                 ) -> Iterator[tuple[str, Axes]]:
    """Yield every axis with its panel: one row per sensor, with a common scale."""
    for row, sensor in enumerate(dict.fromkeys(name.partition('_')[0] for name in curves)):
        names = [name for name in curves if name.startswith(sensor)]
        limits = limits_of([axis for name in names for axis in curves[name].values()])
        for column, name in enumerate(names):
            panel = figure.add_subplot(grid[row, column])
            frame(panel, sensor, limits, left=column == 0, right=column == len(names) - 1)
            panel.set_title(name.replace('_', ' '), loc='left')
            yield name, panel


def frame(panel: Axes, sensor: str, limits: tuple[float, float], *, of_spectrum: bool = False,
          left: bool = True, right: bool = True) -> None:
    """Set scales, limits and labels of a panel of Allan deviation or spectrum; SI is right."""
    x_title, y_title = ('frequency [Hz]', 'PSD (two-sided)') if of_spectrum else (
        'averaging time τ [s]', f'Allan deviation of {SAMPLES[sensor]}')
    panel.set_xscale('log')
    panel.set_yscale('log')
    panel.set_ylim(*limits)
    panel.grid(True)
    unit = 'rad/s' if sensor == 'gyro' else 'm/s^2'
    factor, other = engineering(1.0, unit)
    factor **= 2 if of_spectrum else 1
    _mark_powers(panel.xaxis)
    _mark_powers(panel.yaxis, limits, factor)
    panel.set_xlabel(x_title)
    si, shown = (f'({typeset(text)})²/Hz' if of_spectrum else typeset(text)
                 for text in (unit, other))
    if left:
        panel.set_ylabel(f'{y_title} [{shown}]')
    else:
        panel.tick_params(labelleft=False)
    if right:
        # The data are in SI units; grid and labels on the left use the units of the tables.
        second = panel.secondary_yaxis('right')
        second.set_ylabel(f'[{si}]')
        _mark_powers(second.yaxis, limits)


def _mark_powers(axis: Axis, limits: tuple[float, float] | None = None,
                 factor: float = 1.0) -> None:
    """Place ticks at powers of ten of value times `factor`, over short `limits` at 2 and 5 too."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    # A longer range contains two powers of ten wherever it begins.
    short = limits is not None and limits[1] < limits[0] * 100.0
    subs = np.array((1.0, 2.0, 5.0) if short else (1.0,)) * 10.0**(-np.log10(factor) % 1)
    axis.set_major_locator(LogLocator(subs=subs, numticks=9))
    # Minor ticks and labels set as formulas would take two thirds of the time of a figure.
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _: power_text(value * factor)))


def write_in_a_row(panel: Axes, parts: Sequence[tuple[str, str]]) -> None:
    """Write coloured texts in a row above `panel`."""
    from matplotlib.artist import Artist
    from matplotlib.offsetbox import AnchoredOffsetbox, HPacker, TextArea

    areas: list[Artist] = [TextArea(text, textprops={'color': colour, 'fontsize': 8,
                                                     'parse_math': False})
                           for text, colour in parts]
    panel.add_artist(AnchoredOffsetbox(
        'lower left', child=HPacker(children=areas, pad=0, sep=14), frameon=False, pad=0,
        borderpad=0.2, bbox_to_anchor=(0, 1), bbox_transform=panel.transAxes))
