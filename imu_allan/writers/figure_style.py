# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The look of every figure: colours, markers, fonts and lines.

The three axes have colours that stay apart in colour-blind vision, and markers and dashes that
stay apart in print.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Literal, TYPE_CHECKING

from imu_allan.writers.default_style import matplotlib_alone, own_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Theme = Literal['light', 'dark']
# After Okabe and Ito's palette for colour-blind readers, with a deeper blue: to tritanopes theirs
# is close to the green.
COLOURS: dict[Theme, dict[str, str]] = {
    'light': {'x': '#d55e00', 'y': '#009e73', 'z': '#2340a0', 'ink': '#1a1a1a', 'soft': '#6b6b6b',
              'grid': '#e3e3e3', 'paper': '#ffffff', 'gap': '#8c8c8c', 'motion': '#e69f00',
              'good': '#eef3f7'},
    'dark': {'x': '#ff8c42', 'y': '#4fe3b4', 'z': '#5a8cf0', 'ink': '#ececec', 'soft': '#a5a5a5',
             'grid': '#333840', 'paper': '#16181c', 'gap': '#8c8c8c', 'motion': '#e69f00',
             'good': '#232a33'},
}
MARKERS = {'x': 'o', 'y': 's', 'z': '^'}
DASHES: dict[str, str | tuple[int, tuple[float, ...]]] = {
    'x': '-', 'y': (0, (5.0, 1.3)), 'z': (0, (8.0, 1.3, 1.6, 1.3))}
"""Of the model's lines where several axes share a panel: in grey x and y are alike."""


def empty_figure(width: float, height: float) -> 'Figure':
    """Return a figure of this size in inches that needs no display."""
    matplotlib_alone()
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    return figure


@contextmanager
def plot_style(theme: Theme = 'light', size: float = 9.0) -> Iterator[None]:
    """
    Fonts, lines and colours of every figure, for as long as the context lasts.

    Parameters
    ----------
    theme : 'light' or 'dark'
        Colours of the paper.
    size : float, optional
        Of the text, in points; the numbers beside the axes are a point smaller, 7 at least.

    """
    colours = COLOURS[theme]
    with own_style({
            'font.family': 'DejaVu Sans', 'font.size': size, 'axes.labelsize': size,
            'axes.titlesize': size + 1, 'axes.titleweight': 'bold',
            'xtick.labelsize': max(7.0, size - 1), 'ytick.labelsize': max(7.0, size - 1),
            'figure.facecolor': colours['paper'], 'axes.facecolor': colours['paper'],
            'text.color': colours['ink'],
            'axes.labelcolor': colours['ink'], 'xtick.color': colours['soft'],
            'ytick.color': colours['soft'], 'axes.edgecolor': colours['soft'],
            'axes.linewidth': 0.7, 'grid.color': colours['grid'], 'grid.linewidth': 0.7,
            'axes.axisbelow': True, 'pdf.fonttype': 42, 'svg.fonttype': 'none',
            'svg.hashsalt': 'imu_allan', 'path.simplify': True}):
        yield
