# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Figure of several units: few in colour, of many the population, and outliers in colour."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from imu_allan.errors import printable, shorten
from imu_allan.fleet.population import Population
from imu_allan.noise.terms import AXES
from imu_allan.result import AxisResult, Result
from imu_allan.wording import counted
from imu_allan.writers import figure_style as style
from imu_allan.writers.panels import draw_curve
import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D


def curves_figure(results: Mapping[str, Result], fleet: Population, title: str = '') -> 'Figure':
    """Draw the Allan deviations of a fleet or of results to compare, one panel per axis."""
    few = len(results) <= len(style.SERIES)
    # The band of a population is blue; outliers beyond the others are named only in the table.
    colours = dict(zip(results if few else fleet.outlier_units,
                       style.SERIES if few else style.SERIES[1:], strict=False))
    drawn = {name: axes for name in AXES if (axes := {
        unit: results[unit].axes[name] for unit in fleet.units if name in results[unit].axes})}
    rows = max(1, len({name.partition('_')[0] for name in drawn}))
    height = 0.9 + 3.7 * rows
    with style.plot_style():
        # In this width, text of 8 points is 11 pixels high on the page.
        figure = style.empty_figure(11.0, height)
        grid = figure.add_gridspec(rows, 3, left=0.075, right=0.925, wspace=0.09, hspace=0.3,
                                   bottom=0.55 / height, top=1 - 1.15 / height)
        figure.text(0.02, 1 - 0.25 / height,
                    title or f'Allan deviation of {counted(len(results), "unit")}',
                    fontsize=13, fontweight='bold', va='center')
        figure.text(0.02, 1 - 0.5 / height,
                    'points: measured · line: fitted · band: 95 % interval' if few else
                    'line: median · band: nine in ten units · in colour: outliers', fontsize=8.5,
                    va='center', color=style.COLOURS['soft'])
        named: dict[str, Line2D] = {}
        for name, panel in style.allan_panels(figure, grid, drawn):
            axes = drawn[name]
            if not few:
                _draw_population(panel, [axis for unit, axis in axes.items()
                                         if unit not in fleet.outlier_units])
            for place, (unit, colour) in enumerate(colours.items()):
                marker, dashes = 'os^Dv*P'[place], [*style.DASHES.values()][place % 3]
                if unit in axes:
                    draw_curve(panel, axes[unit], colour, marker, dashes=dashes)
                    [named[unit]] = panel.plot([], [], color=colour, marker=marker,
                                               linestyle=dashes, markersize=4.4)
        # A legend, as names beside the curves would overlap; the places tell names apart that were
        # shortened to the same.
        names = [shorten(printable(name), 18) for name in named]
        if len({*names}) < len(names):
            names = [f'{place} {shorten(name, 15)}' for place, name in enumerate(names, 1)]
        figure.legend([*named.values()], names, loc='upper left',
                      bbox_to_anchor=(0.013, 1 - 0.58 / height), ncol=len(style.SERIES),
                      frameon=False, fontsize=8, borderpad=0, handlelength=1.8, handletextpad=0.5,
                      columnspacing=1.4)
        return figure


def _draw_population(panel: 'Axes', axes: Sequence[AxisResult]) -> None:
    """Draw the curves of an axis in grey, their median, and the band of nine in ten."""
    usual = [axis.curve for axis in axes if any(axis.curve.adev)]
    # More than some 200 grey curves are indistinguishable and enlarge a vector file.
    step = max(1, len(usual) // 200)
    for curve in usual[::step]:
        panel.plot(curve.tau_s, curve.adev, color=style.COLOURS['gap'], linewidth=0.6, alpha=0.45,
                   zorder=2)
    if usual:
        tau = np.array(max((curve.tau_s for curve in usual), key=len))
        rows = []
        for curve in usual:
            adev = np.array(curve.adev)
            rows.append(np.interp(np.log(tau), np.log(curve.tau_s)[adev > 0],
                                  np.log(adev[adev > 0]), left=np.nan, right=np.nan))
        low, middle, high = np.exp(np.nanpercentile(rows, (5, 50, 95), axis=0))
        panel.fill_between(tau, low, high, color=style.COLOURS['z'], alpha=0.18, linewidth=0,
                           zorder=3)
        panel.plot(tau, middle, color=style.COLOURS['ink'], linewidth=1.4, zorder=4)
