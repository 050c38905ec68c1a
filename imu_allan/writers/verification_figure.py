# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Figure that compares predicted drift with the drift observed in another recording."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from imu_allan.errors import ImuAllanError, shorten
from imu_allan.noise.terms import AXES
from imu_allan.sensor.units import engineering, typeset
from imu_allan.tuning.field_test import FieldTest
from imu_allan.wording import duration, SAMPLES, SENSORS
from imu_allan.writers.curves import of_sensor
from imu_allan.writers.figure_style import COLOURS, empty_figure, MARKERS, plot_style
import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def verification_figure(found: Mapping[str, FieldTest], other: str) -> 'Figure':
    """Draw observed and predicted errors of the mean after unaided times, by sensor."""
    shown = {name: one for name, one in found.items() if one.full.coasts}
    sensors = [sensor for sensor in SENSORS if of_sensor(shown, sensor)]
    if not sensors:
        raise ImuAllanError('nothing is at rest for long enough to show a drift: no picture')
    with plot_style():
        figure = empty_figure(5.4 * len(sensors), 4.4)
        figure.text(0.02, 0.955, f'Drift observed in {shorten(other, 70)}', fontsize=12,
                    fontweight='bold', parse_math=False)
        figure.text(0.02, 0.905, 'points: observed;  dotted, bars: predicted;  shaded: where 95 % '
                    'of the points should lie', fontsize=8.5, color=COLOURS['soft'])
        for column, sensor in enumerate(sensors):
            panel = figure.add_axes(((column + 0.135) / len(sensors), 0.13,
                                     0.84 / len(sensors), 0.68))
            _draw(panel, sensor, of_sensor(shown, sensor))
    return figure


def _draw(panel: 'Axes', sensor: str, found: Mapping[str, FieldTest]) -> None:
    factor, shown = engineering(1.0, AXES[next(iter(found))].unit)
    horizons = sorted({row.horizon_s for one in found.values() for row in one.full.coasts})
    for place, (name, one) in enumerate(found.items()):
        colour, outcome = COLOURS[name[-1]], one.full
        # Shift the axes slightly so that their points at one horizon are side by side.
        h = np.array([row.horizon_s for row in outcome.coasts]) \
            * 1.06**(place - (len(found) - 1) / 2)
        low, high = (np.array(ends) * factor for ends in zip(*outcome.bands, strict=True))
        panel.fill_between(h, low, high, color=colour, alpha=0.08, linewidth=0)
        # A single horizon has no area, so its band is drawn as a bar.
        panel.vlines(h, low, high, color=colour, alpha=0.35, linewidth=1.2)
        # The dash marks the prediction at a single horizon, where there is no line.
        panel.plot(h, [row.predicted_sigma * factor for row in outcome.coasts], ':', marker='_',
                   markersize=9, color=colour)
        panel.plot(h, [row.observed_rms * factor for row in outcome.coasts], MARKERS[name[-1]],
                   color=colour, markersize=6, label=f'{name[-1]} axis')
    panel.set(xscale='log', yscale='log', xlabel='unaided time',
              xlim=(horizons[0] / 1.5, horizons[-1] * 1.5),
              ylabel=f'error of the mean {SAMPLES[sensor]} over it [{typeset(shown)}]')
    panel.set_xticks(horizons, [duration(h) for h in horizons])
    panel.set_xticks([], minor=True)
    for ticks in (panel.yaxis.set_major_formatter, panel.yaxis.set_minor_formatter):
        ticks(lambda value, _: f'{value:g}' if f'{value:.0e}'[0] in '125' else '')
    panel.set_title(SENSORS[sensor], loc='left')
    panel.grid(visible=True, which='both')
    # Place it above the panel, since points or bands may be anywhere inside.
    panel.legend(frameon=False, ncols=len(found), loc='lower right', bbox_to_anchor=(1.01, 1.0),
                 borderaxespad=0, handletextpad=0.1, columnspacing=1.0)
