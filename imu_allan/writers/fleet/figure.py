# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Figures of several units: few in colour, of many the population in grey and outliers in colour.

They show the Allan deviations, and the coefficients of all units side by side.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from imu_allan.arrays import Array
from imu_allan.errors import printable, shorten
from imu_allan.fleet.names import distinct_labels
from imu_allan.noise.terms import AXES, LASTING_TERMS, TERMS
from imu_allan.result import AxisResult, Coefficient
from imu_allan.sensor.units import engineering, typeset
from imu_allan.wording import SENSORS
from imu_allan.writers.figure_style import (
    allan_panels,
    COLOURS,
    DASHES,
    empty_figure,
    plot_style,
    SERIES,
)
from imu_allan.writers.fleet.findings import Fleet
from imu_allan.writers.panels import draw_curve
import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

_MARKERS = 'os^Dv*P'
_MOST_CURVES = 200
"""Most grey curves to draw; more are indistinguishable and enlarge a vector file."""
_PALETTE = (*SERIES[1:], SERIES[0])
"""The blue of the band comes last. Outliers beyond the palette are named only in the table."""
_MOST_TICKS = 12
"""Most units to name below a panel; more are only counted."""
_WIDTH = 11.0
"""Width in inches, chosen so that text of 8 points is 11 pixels high on the page."""


def curves_figure(fleet: Fleet, title: str = '') -> 'Figure':
    """Draw the Allan deviations of a fleet or of results to compare, one panel per axis."""
    few = len(fleet.results) <= len(SERIES)
    colours = dict(zip(fleet.results, SERIES, strict=False)) if few else _odd_colours(fleet)
    sensors = _sensors(fleet)
    with plot_style():
        figure = empty_figure(_WIDTH, 0.9 + 3.7 * max(1, len(sensors)))
        grid = figure.add_gridspec(
            max(1, len(sensors)), 3, left=0.075, right=0.925, wspace=0.09, hspace=0.3,
            bottom=0.55 / figure.get_figheight(), top=1 - 1.15 / figure.get_figheight())
        _heading(figure, title or f'Allan deviation of {len(fleet.results)} units',
                 'points: measured · line: fitted · band: 95 % interval' if few else
                 'line: median · band: nine in ten units · in colour: outliers')
        drawn = {name: list(found.values()) for name in AXES if (found := _axes(fleet, name))}
        named: dict[str, Line2D] = {}
        for name, panel in allan_panels(figure, grid, drawn):
            axes = _axes(fleet, name)
            if not few:
                _draw_population(panel, [axis for unit, axis in axes.items()
                                         if unit not in fleet.population.outlier_units])
            for place, (unit, colour) in enumerate(colours.items()):
                look = _MARKERS[place], [*DASHES.values()][place % len(DASHES)]
                if unit in axes:
                    draw_curve(panel, axes[unit], colour, look[0], dashes=look[1])
                    [named[unit]] = panel.plot([], [], color=colour, marker=look[0],
                                               linestyle=look[1], markersize=4.4)
        # A legend, as names beside the curves would overlap.
        figure.legend([*named.values()], distinct_labels([*named], 18),
                      loc='upper left', bbox_to_anchor=(0.013, 1 - 0.58 / figure.get_figheight()),
                      ncol=len(SERIES), frameon=False, fontsize=8, borderpad=0, handlelength=1.8,
                      handletextpad=0.5, columnspacing=1.4)
        return figure


def _draw_population(panel: 'Axes', axes: Sequence[AxisResult]) -> None:
    """Draw the curves of an axis in grey, their median, and the band of nine in ten."""
    usual = [axis.curve for axis in axes if any(axis.curve.adev)]
    step = max(1, len(usual) // _MOST_CURVES)
    for curve in usual[::step]:
        panel.plot(curve.tau_s, curve.adev, color=COLOURS['gap'], linewidth=0.6, alpha=0.45,
                   zorder=2)
    if usual:
        longest = max(usual, key=lambda curve: len(curve.tau_s))
        tau = np.array(longest.tau_s)
        low, middle, high = _percentiles([(np.array(c.tau_s), np.array(c.adev)) for c in usual],
                                         tau)
        panel.fill_between(tau, low, high, color=COLOURS['z'], alpha=0.18, linewidth=0,
                           zorder=3)
        panel.plot(tau, middle, color=COLOURS['ink'], linewidth=1.4, zorder=4)


def _percentiles(curves: Sequence[tuple[Array, Array]], tau: Array) -> tuple[Array, Array, Array]:
    """Return the 5, 50 and 95 % percentiles of the curves at each averaging time."""
    rows = [np.interp(np.log(tau), np.log(times[adev > 0]), np.log(adev[adev > 0]),
                      left=np.nan, right=np.nan) for times, adev in curves]
    low, middle, high = np.exp(np.nanpercentile(rows, (5, 50, 95), axis=0))
    return low, middle, high


def units_figure(fleet: Fleet) -> 'Figure':
    """Draw the coefficients of all units side by side: value and interval, or upper bound."""
    colours = _odd_colours(fleet)
    names = [axis for axis in AXES if _axes(fleet, axis)]
    known = {trait.key for trait in fleet.population.traits}
    keys = [key for key in LASTING_TERMS if key in known] or ['noise_density']
    with plot_style():
        rows = [(sensor, key) for sensor in _sensors(fleet) for key in keys]
        figure = empty_figure(_WIDTH, 0.9 + 2.1 * max(1, len(rows)))
        grid = figure.add_gridspec(
            max(1, len(rows)), 3, left=0.075, right=0.985, wspace=0.3, hspace=0.62,
            bottom=0.5 / figure.get_figheight(), top=1 - 0.95 / figure.get_figheight())
        _heading(figure, 'Coefficients of every unit', 'line: centre · band: nine in ten units · '
                 'in colour: outliers · small arrow: upper bound')
        for row, (sensor, key) in enumerate(rows):
            for column, name in enumerate(n for n in names if n.startswith(sensor)):
                panel = figure.add_subplot(grid[row, column])
                _draw_units(panel, fleet, name, key, colours)
                if row == len(rows) - 1:
                    panel.set_xlabel('unit, counted in the order of the names'
                                     if len(fleet.population.units) > _MOST_TICKS else '')
        return figure


def _draw_units(panel: 'Axes', fleet: Fleet, name: str, key: str, colours: Mapping[str, str]
                ) -> None:
    from matplotlib.ticker import MaxNLocator

    unit = TERMS[key].unit(AXES[name])
    shown_unit = engineering(1.0, unit)[1]
    panel.set_title(f'{TERMS[key].symbol} {name.replace("_", " ")}', loc='left')
    panel.set_ylabel(typeset(shown_unit))
    panel.grid(True, axis='y')
    axes = _axes(fleet, name)
    trait = next((t for t in fleet.population.traits if (t.axis, t.key) == (name, key)), None)
    if trait is not None:
        low, middle, high = (engineering(trait.percentiles[p], unit)[0] for p in (5, 50, 95))
        panel.axhspan(low, high, color=COLOURS['z'], alpha=0.13, linewidth=0)
        panel.axhline(middle, color=COLOURS['ink'], linewidth=0.9)
    many = len(axes) > _MOST_CURVES
    # Name only outliers in this coefficient; other names would cover neighbouring points.
    odd = {outlier.unit for outlier in fleet.population.outliers
           if (outlier.axis, outlier.key) == (name, key)}
    for place, member in enumerate(fleet.population.units, 1):
        if member in axes:
            _draw_unit(panel, place, axes[member].coefficients[key], colours.get(member),
                       shorten(printable(member), 24) if member in odd else '',
                       rasterized=many)
    # Unit numbers are integers.
    panel.xaxis.set_major_locator(MaxNLocator(nbins=8, integer=True, min_n_ticks=1))
    units = fleet.population.units
    if len(units) <= _MOST_TICKS:
        # Characters that fit below a tick.
        panel.set_xticks(range(1, len(units) + 1), distinct_labels(units, 14), rotation=20,
                         ha='right', rotation_mode='anchor')
    panel.margins(x=0.03, y=0.12)
    if panel.get_ylim()[0] < 0:
        panel.set_ylim(bottom=0)


def _draw_unit(panel: 'Axes', place: int, found: Coefficient, colour: str | None, name: str,
               *, rasterized: bool) -> None:
    """Draw the value and interval of a unit as a dot with a line, a bound as a small arrow."""
    ink = colour or COLOURS['soft']
    if found.value is None or found.ci95 is None:
        if found.upper95 is not None:
            panel.plot([place], [engineering(found.upper95, found.unit)[0]], 'v', color=ink,
                       markersize=2.6, alpha=0.5, rasterized=rasterized)
        return
    value, low, high = (engineering(v, found.unit)[0] for v in (found.value, *found.ci95))
    panel.plot([place, place], [low, high], color=ink, linewidth=0.8, rasterized=rasterized)
    panel.plot([place], [value], 'o', color=ink, markersize=4.2 if colour else 2.4,
               rasterized=rasterized)
    if name:
        panel.annotate(name, (place, value), xytext=(4, 4), textcoords='offset points',
                       fontsize=8, color=COLOURS['ink'])


def _heading(figure: 'Figure', title: str, key: str) -> None:
    height = figure.get_figheight()
    figure.text(0.02, 1 - 0.25 / height, title, fontsize=13, fontweight='bold', va='center')
    figure.text(0.02, 1 - 0.5 / height, key, fontsize=8.5, va='center', color=COLOURS['soft'])


def _odd_colours(fleet: Fleet) -> dict[str, str]:
    return dict(zip(fleet.population.outlier_units, _PALETTE, strict=False))


def _sensors(fleet: Fleet) -> list[str]:
    return [sensor for sensor in SENSORS
            if any(name.startswith(sensor) for result in fleet.results.values()
                   for name in result.axes)]


def _axes(fleet: Fleet, name: str) -> dict[str, AxisResult]:
    return {unit: fleet.results[unit].axes[name] for unit in fleet.population.units
            if name in fleet.results[unit].axes}
