# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Chart of unaided drift: of the model, predicted by the filter, and observed."""

from collections.abc import Mapping

from imu_allan.noise.terms import AXES
from imu_allan.result import AxisResult
from imu_allan.sensor.units import engineering, typeset
from imu_allan.tuning.backtest import bands_of
from imu_allan.tuning.tune import FilterTuning
from imu_allan.wording import duration, number, SAMPLES
from imu_allan.writers.charts.chart import box_of, Chart, sensor_chart, shape_of
from imu_allan.writers.svg import Drawing, group
import numpy as np


def drift_chart(sensor: str, axes: Mapping[str, AxisResult],
                tunings: Mapping[str, FilterTuning]) -> Chart | None:
    """
    Draw unaided drift over time: of the model, predicted by the filter, and observed.

    Parameters
    ----------
    sensor : str
        'gyro' or 'accel'.
    axes : mapping of name to AxisResult
        Of the sensor.
    tunings : mapping of name to FilterTuning
        What is expected of a filter, and what it predicts.

    Returns
    -------
    Chart or None
        None where nothing is known.

    """
    known = {name: axis for name, axis in axes.items()
             if name in tunings or (axis.backtest is not None and axis.backtest.coast)}
    if not known:
        return None
    unit = AXES[next(iter(known))].unit
    factor, shown = engineering(1.0, unit)
    horizons, values = [], []
    for name, axis in known.items():
        if name in tunings:
            horizons += [row[0] for row in tunings[name].consistency]
            values += [v for row in tunings[name].consistency for v in row[1:]]
        for row in axis.backtest.coast if axis.backtest else ():
            horizons.append(row.horizon_s)
            values += [row.predicted_sigma, row.observed_rms]
        values += [end for band in bands_of(axis) for end in band]
    values = [value for value in values if value > 0]
    if not values:
        return None
    ends = min(horizons) / 1.4, max(horizons) * 1.4

    def draw(drawing: Drawing, narrow: bool) -> None:
        panel = drawing.panel(box_of(drawing, narrow), (*ends, True),
                              (min(values) * factor / 1.7, max(values) * factor * 1.7, True))
        panel.frame('unaided time [s]', f'error of the mean {SAMPLES[sensor]} over it '
                    f'[{typeset(shown)}]', None if narrow else (1 / factor, f'[{typeset(unit)}]'))
        inside = []
        for name, axis in known.items():
            parts = []
            if name in tunings:
                h, expected, by_filter = np.array(tunings[name].consistency).T
                parts += [panel.line(h, expected * factor, 'curve'),
                          panel.line(h, by_filter * factor, 'by-filter')]
            if axis.backtest is not None:
                coast = axis.backtest.coast
                if coast:
                    low, high = np.array(bands_of(axis)).T * factor
                    parts.insert(0, panel.band([c.horizon_s for c in coast], low, high,
                                               'expected'))
                parts.append(panel.line([c.horizon_s for c in coast],
                                        [c.predicted_sigma * factor for c in coast], 'predicted'))
                parts.append(panel.points(
                    [c.horizon_s for c in coast], [c.observed_rms * factor for c in coast],
                    shape_of(name[-1]), [
                        f'{name[-1]} axis, after {duration(c.horizon_s)}: predicted '
                        f'{number(c.predicted_sigma * factor, 3)}, observed '
                        f'{number(c.observed_rms * factor, 3)} {typeset(shown)}'
                        for c in coast], [False] * len(coast)))
            inside.append(group(name[-1], f'axis-{name[-1]}', parts))
        drawing.add(panel, inside)

    tested = any(axis.backtest is not None for axis in known.values())
    return sensor_chart(
        sensor, 'drift', 'unaided drift', 'predicted and observed drift',
        'Line: what a filter with the tuned numbers gets wrong, as the drift model has it. '
        'Dashed: what that filter predicts.' + (
            ' Points: what happened in the part of the recording that the model was not fitted '
            'to; dotted: what it predicted for them; shade: where 95 % of the points should lie.'
            if tested else ''), (340, 300), draw, known)
