# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Figures of a result, which share heading and table, and of many units.

Each figure is one sheet, composed of the parts in `imu_allan.writers.panels`. Of few units all are
in colour; of many the population is shown, and outliers in colour.
"""

from collections.abc import Mapping, Sequence
from functools import partial
import io
from typing import TYPE_CHECKING

from imu_allan import wording
from imu_allan.errors import printable, shorten
from imu_allan.noise.terms import AXES, LASTING_TERMS, TERMS
from imu_allan.result import AxisResult, Result
from imu_allan.sensor.units import engineering, typeset
from imu_allan.wording import counted
from imu_allan.writers import curves, panels
import numpy as np

if TYPE_CHECKING:
    from imu_allan.fleet import Population
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D


def plot(result: Result | AxisResult) -> 'Figure':
    """
    Draw the Allan deviation of all axes, as the command does, or of one, for a notebook.

    Parameters
    ----------
    result : Result or AxisResult
        The result to draw, or the axis that `imu_allan.characterize` gives.

    Returns
    -------
    matplotlib.figure.Figure
        The figure, to be shown, changed or saved: ``imu_allan.plot(result).savefig('plot.png')``.

    Raises
    ------
    TypeError
        If `result` is neither.

    """
    if isinstance(result, AxisResult):
        return _axis_figure(result)
    if not isinstance(result, Result):
        raise TypeError('expected a result, such as imu_allan.analyze gives, or one of its axes, '
                        f'not {type(result).__name__}')
    return overview_figure(result)


def _axis_figure(axis: AxisResult) -> 'Figure':
    """Draw the Allan deviation of an axis, its intervals, the fitted model and its terms."""
    sensor = 'gyro' if axis.quantity == AXES['gyro_x'] else 'accel'
    with panels.plot_style():
        figure = panels.empty_figure(7.0, 5.0)
        panel = figure.add_axes((0.13, 0.11, 0.73, 0.85))
        panels.frame(panel, sensor, curves.limits_of([axis], rings=True))
        panels.draw_curve(panel, axis, panels.COLOURS['x'])
        panels.draw_terms(panel, axis)
    return figure


def overview_png(result: Result) -> bytes:
    """Draw `overview_figure` as the content of a PNG file."""
    return render(overview_figure(result))


def overview_figure(result: Result) -> 'Figure':
    """Draw the Allan deviation of all axes, coefficients above and signal below, on one sheet."""
    with panels.plot_style():
        sensors = curves.by_sensor(result.axes)
        halves = max(1, len(sensors))
        live = [sensor for sensor, axes in sensors.items()
                if any(any(axis.curve.adev) for axis in axes.values())]
        # Of one sensor alone it is no narrower: the heading takes this width.
        figure = panels.empty_figure(12.0, 8.0 if live else 1.7)
        _write_heading(figure, result)
        for column, (sensor, axes) in enumerate(sensors.items()):
            left, width = column / halves, 1 / halves
            if sensor not in live:
                _write_why(figure, left + 0.04 * width, sensor, axes)
                continue
            _draw_table(figure.add_axes((left + 0.04 * width, 0.745, 0.92 * width, 0.14)),
                        sensor, axes)
            panel = figure.add_axes((left + 0.135 * width, 0.27, 0.735 * width, 0.465))
            panels.frame(panel, sensor, curves.limits_of(axes.values()))
            # The table above names the axes by their markers.
            for name, axis in axes.items():
                if any(axis.curve.adev):
                    panels.draw_curve(panel, axis, panels.COLOURS[name[-1]],
                                      panels.MARKERS[name[-1]], result.timeline,
                                      panels.DASHES[name[-1]])
            strip = figure.add_axes((left + 0.135 * width, 0.065, 0.735 * width, 0.105))
            panels.draw_signal(strip, axes, result)
        return figure


def sensor_figure(result: Result, sensor: str) -> 'Figure':
    """Draw Allan deviation with terms, spectrum and signal of the axes of one sensor."""
    axes = curves.axes_of(result.axes, sensor)
    with panels.plot_style():
        # Of fewer axes it is no narrower, since heading and labels take the same space.
        figure = panels.empty_figure(5.2 * 3 + 0.6, 11.2)
        grid = figure.add_gridspec(2, len(axes), height_ratios=(5.4, 3.6), left=0.062,
                                   right=0.935, top=0.895, bottom=0.215, wspace=0.09, hspace=0.2)
        _write_heading(figure, result, wording.SENSORS[sensor])
        limits = curves.limits_of(axes.values(), rings=True)
        first: list[Axes | None] = [None, None]
        for column, (name, axis) in enumerate(axes.items()):
            colour, marker = panels.COLOURS[name[-1]], panels.MARKERS[name[-1]]
            ends = {'left': column == 0, 'right': column == len(axes) - 1}
            allan = figure.add_subplot(grid[0, column], sharey=first[0])
            panels.frame(allan, sensor, limits, **ends)
            panels.draw_curve(allan, axis, colour, marker, result.timeline)
            panels.draw_terms(allan, axis)
            allan.set_title(f'{name[-1]} axis', color=colour, loc='left')
            density = figure.add_subplot(grid[1, column], sharey=first[1])
            panels.draw_density(density, axis, result.timeline, colour)
            panels.frame(density, sensor, curves.density_limits(axes.values(), result.timeline),
                         of_spectrum=True, **ends)
            first = [first[0] or allan, first[1] or density]
        panels.draw_signal(figure.add_axes((0.062, 0.05, 0.873, 0.085)), axes, result)
        return figure


def render(figure: 'Figure', format: str = 'png', dpi: float = 150) -> bytes:  # noqa: A002
    """Return a figure as the content of a file."""
    content = io.BytesIO()
    # Make the bytes reproducible: no date, and no random identifiers in SVG.
    metadata = {{'png': 'Software', 'svg': 'Date', 'pdf': 'CreationDate'}[format]: None}
    with panels.plot_style():
        figure.savefig(content, format=format, dpi=dpi, metadata=metadata,
                       facecolor=figure.get_facecolor())
    return content.getvalue()


def _write_why(figure: 'Figure', left: float, sensor: str, axes: Mapping[str, AxisResult]) -> None:
    """Write why a sensor has no curves, in place of its panels."""
    top = figure.get_figheight()
    figure.text(left, 1 - 1.05 / top, wording.SENSORS[sensor], fontsize=11, fontweight='bold',
                va='center')
    reasons = {'every sample is the same, there is no noise to draw':
               [name for name, axis in axes.items() if axis.constant],
               'too few samples': [name for name, axis in axes.items() if not axis.curve.adev]}
    figure.text(left, 1 - 1.35 / top, '; '.join(
        f'{wording.named(names)}: {reason}' for reason, names in reasons.items() if names),
        color=panels.COLOURS['soft'], va='center')


def _draw_table(panel: 'Axes', sensor: str, axes: Mapping[str, AxisResult]) -> None:
    """Draw a table of the coefficients that at least one axis shows, with their intervals."""
    panel.axis('off')
    panel.set_xlim(0, 1)
    panel.set_ylim(0, 4.3)
    write = partial(panel.text, va='center')
    right_soft = partial(write, ha='right', color=panels.COLOURS['soft'])
    write(0, 4.1, wording.SENSORS[sensor], fontsize=11, fontweight='bold')
    terms = [term for key, term in TERMS.items()
             if any(axis.coefficients[key].observable or curves.power_law_note(axis, key)
                    for axis in axes.values())]
    # If no term is observable, show the bounds of the most important ones.
    terms = terms or [TERMS[key] for key in LASTING_TERMS]
    rights = [0.05 + 0.95 * (column + 1) / max(3, len(terms)) for column in range(len(terms))]
    for term, right in zip(terms, rights, strict=True):
        unit = typeset(engineering(1.0, term.unit(AXES[next(iter(axes))]))[1])
        right_soft(right, 3.15, f'{term.symbol}  [{unit}]', fontsize=8)
    for row, (name, axis) in enumerate(axes.items()):
        height, colour = 2.3 - 0.9 * row, panels.COLOURS[name[-1]]
        panel.plot([0.012], [height], panels.MARKERS[name[-1]], color=colour, markersize=5)
        write(0.035, height, name[-1], color=colour, fontsize=9.5, fontweight='bold')
        if axis.constant:
            write(0.08, height, 'constant: every sample is the same', fontsize=7,
                  color=panels.COLOURS['soft'])
            continue
        for term, right in zip(terms, rights, strict=True):
            said = curves.reported(axis.coefficients[term.key])
            if len(said) == 3:
                write(right - 0.178, height, said[0], ha='right', fontsize=9.5)
                right_soft(right, height, ' – '.join(said[1:]), fontsize=6.5)
            else:
                right_soft(right, height, ', '.join([
                    curves.power_law_note(axis, term.key) or 'not observable', *said]), fontsize=7)


def _write_heading(figure: 'Figure', result: Result, what: str = '') -> None:
    title = '   '.join(shorten(name, 60) for name in wording.names_of(result))
    facts = [wording.amount_of(result.timeline),
             *(shorten(fact, 40) for fact in wording.origin_of(result)),
             f'imu_allan {shorten(printable(result.imu_allan_version), 20)}']
    key = ('Points: measured, hollow below 3 degrees of freedom.  Line: reported, shaded where '
           '95 % of the points should fall, unless the mean moves.  Short dashes: at most')
    if what:
        title = f'{what}   {title}'
        key += '.  Dashed: its terms.  Ring: where the coefficient is read'
    if any(curves.beyond(axes.values(), curves.limits_of(axes.values(), rings=bool(what)))
           for axes in curves.by_sensor(result.axes).values()):
        key += ';  arrow: a point beyond'
    top = figure.get_figheight()
    for text, below, size, colour, weight in (
            (title, 0.27, 12, 'ink', 'bold'), (' · '.join(facts), 0.50, 8.5, 'soft', 'normal'),
            (key, 0.70, 8.5, 'soft', 'normal')):
        # Names from a recording are plain text: a dollar sign does not start a formula.
        line = figure.text(0.02, 1 - below / top, text, fontsize=size, fontweight=weight,
                           color=panels.COLOURS[colour], va='center', parse_math=False)
        # Serial number, operator and station make a line longer than the sheet is wide.
        room = 0.96 * figure.bbox.width / line.get_window_extent().width
        line.set_fontsize(size * min(1.0, room))


def curves_figure(results: Mapping[str, Result], fleet: 'Population', title: str = '') -> 'Figure':
    """Draw the Allan deviations of a fleet or of results to compare, one panel per axis."""
    few = len(results) <= len(panels.SERIES)
    # The band of a population is blue; outliers beyond the others are named only in the table.
    colours = dict(zip(results if few else fleet.outlier_units,
                       panels.SERIES if few else panels.SERIES[1:], strict=False))
    drawn = {name: axes for name in AXES if (axes := {
        unit: results[unit].axes[name] for unit in fleet.units if name in results[unit].axes})}
    sensors = curves.by_sensor(drawn)
    rows = max(1, len(sensors))
    height = 0.9 + 3.7 * rows
    with panels.plot_style():
        # In this width, text of 8 points is 11 pixels high on the page.
        figure = panels.empty_figure(11.0, height)
        grid = figure.add_gridspec(rows, 3, left=0.075, right=0.925, wspace=0.09, hspace=0.3,
                                   bottom=0.55 / height, top=1 - 1.15 / height)
        figure.text(0.02, 1 - 0.25 / height,
                    title or f'Allan deviation of {counted(len(results), "unit")}',
                    fontsize=13, fontweight='bold', va='center')
        figure.text(0.02, 1 - 0.5 / height,
                    'points: measured · line: fitted · band: 95 % interval' if few else
                    'line: median · band: nine in ten units · in colour: outliers', fontsize=8.5,
                    va='center', color=panels.COLOURS['soft'])
        named: dict[str, Line2D] = {}
        for row, (sensor, own) in enumerate(sensors.items()):
            limits = curves.limits_of([axis for axes in own.values() for axis in axes.values()])
            for column, (name, axes) in enumerate(own.items()):
                panel = figure.add_subplot(grid[row, column])
                panels.frame(panel, sensor, limits, left=column == 0, right=column == len(own) - 1)
                panel.set_title(wording.spoken(name), loc='left')
                if not few:
                    _draw_population(panel, [axis for unit, axis in axes.items()
                                             if unit not in fleet.outlier_units])
                for place, (unit, colour) in enumerate(colours.items()):
                    marker, dashes = 'os^Dv*P'[place], [*panels.DASHES.values()][place % 3]
                    if unit in axes:
                        panels.draw_curve(panel, axes[unit], colour, marker, dashes=dashes)
                        [named[unit]] = panel.plot([], [], color=colour, marker=marker,
                                                   linestyle=dashes, markersize=4.4)
        # A legend, as names beside the curves would overlap; the places tell names apart that were
        # shortened to the same.
        names = [shorten(printable(name), 18) for name in named]
        if len({*names}) < len(names):
            names = [f'{place} {shorten(name, 15)}' for place, name in enumerate(names, 1)]
        figure.legend([*named.values()], names, loc='upper left',
                      bbox_to_anchor=(0.013, 1 - 0.58 / height), ncol=len(panels.SERIES),
                      frameon=False, fontsize=8, borderpad=0, handlelength=1.8, handletextpad=0.5,
                      columnspacing=1.4)
        return figure


def _draw_population(panel: 'Axes', axes: Sequence[AxisResult]) -> None:
    """Draw the curves of an axis in grey, their median, and the band of nine in ten."""
    usual = [axis.curve for axis in axes if any(axis.curve.adev)]
    # More than some 200 grey curves are indistinguishable and enlarge a vector file.
    step = max(1, len(usual) // 200)
    for curve in usual[::step]:
        panel.plot(curve.tau_s, curve.adev, color=panels.COLOURS['gap'], linewidth=0.6, alpha=0.45,
                   zorder=2)
    if usual:
        tau = np.array(max((curve.tau_s for curve in usual), key=len))
        rows = []
        for curve in usual:
            adev = np.array(curve.adev)
            rows.append(np.interp(np.log(tau), np.log(curve.tau_s)[adev > 0],
                                  np.log(adev[adev > 0]), left=np.nan, right=np.nan))
        low, middle, high = np.exp(np.nanpercentile(rows, (5, 50, 95), axis=0))
        panel.fill_between(tau, low, high, color=panels.COLOURS['z'], alpha=0.18, linewidth=0,
                           zorder=3)
        panel.plot(tau, middle, color=panels.COLOURS['ink'], linewidth=1.4, zorder=4)
