# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Charts of the Allan deviation: of one sensor, and of one axis in several results.

Three axes share a panel; the band in which the points should fall, the terms and their names are
shown for one of them at a time, the worst one until the reader chooses another.
"""

from collections.abc import Mapping

from imu_allan.noise.terms import AXES, FLICKER_FLOOR, TERMS
from imu_allan.result import AxisResult, Result, Timeline
from imu_allan.sensor.units import engineering, typeset
from imu_allan.wording import measured, SAMPLES, spoken
from imu_allan.writers import curves
from imu_allan.writers.charts.chart import both, box_of, Chart, sensor_chart, shape_of, worst_axis
from imu_allan.writers.svg import Box, Drawing, group, Panel, SHAPES
import numpy as np


def allan_chart(sensor: str, axes: Mapping[str, AxisResult], timeline: Timeline) -> Chart | None:
    """
    Draw the Allan deviation with the model, where its points should fall, and its terms.

    Parameters
    ----------
    sensor : str
        'gyro' or 'accel'.
    axes : mapping of name to AxisResult
        Of the sensor.
    timeline : Timeline
        Of the same result.

    Returns
    -------
    Chart or None
        None where no axis has a curve above zero.

    """
    known = {name: axis for name, axis in axes.items() if any(axis.curve.adev)}
    if not known:
        return None
    unit = AXES[next(iter(known))].unit
    factor, shown = engineering(1.0, unit)
    low, high = curves.limits_of(known.values(), rings=True)
    ends = (min(axis.curve.tau_s[0] for axis in known.values()) / 1.5,
            max(axis.curve.tau_s[-1] for axis in known.values()) * 1.9)

    def draw(drawing: Drawing, narrow: bool) -> None:
        panel = _framed(drawing, narrow, sensor, unit, ends, (low, high))
        inside = []
        for name, axis in known.items():
            inside.append(group(name[-1], f'detail axis-{name[-1]}',
                                _expected(panel, axis, timeline, factor)))
        for name, axis in known.items():
            tau, adev, bound = curves.model_curve(axis, timeline)
            inside.append(group(name[-1], f'axis-{name[-1]}', [
                panel.line(tau, bound * factor, 'bound'),
                panel.line(tau, adev * factor, 'curve model'),
                _measured_points(panel, axis, factor, shown, f'{name[-1]} axis',
                                 shape_of(name[-1]))]))
        for name, axis in known.items():
            inside.append(group(name[-1], 'detail', _term_labels(
                panel, axis, factor, timeline, brief=narrow)))
        drawing.add(panel, inside)

    caption = ('Points: measured, hollow where fewer than 3 degrees of freedom stand behind one. '
               'Line: what the table reports, over the times of which it was fitted. '
               'Short dashes: with the largest term that may be hidden, at its bound. '
               'Shaded: where 95 % of the points should fall if the line is right. '
               'Ring: where the coefficient is read.')
    if curves.beyond(known.values(), (low, high)):
        caption += ' Arrow: a point beyond the axes.'
    return sensor_chart(sensor, 'allan', 'Allan deviation',
                        'Allan deviation against averaging time', caption, (470, 330), draw,
                        known, worst_axis(known))


def _framed(drawing: Drawing, narrow: bool, sensor: str, unit: str, ends: tuple[float, float],
            heights: tuple[float, float]) -> Panel:
    """Return the panel of a curve between ends of averaging time and heights in SI units."""
    factor, shown = engineering(1.0, unit)
    low, high = heights
    panel = drawing.panel(box_of(drawing, narrow), (*ends, True),
                          (low * factor, high * factor, True))
    panel.frame('averaging time τ [s]', f'Allan deviation of {SAMPLES[sensor]} '
                f'[{typeset(shown)}]', None if narrow else (1 / factor, f'[{typeset(unit)}]'))
    return panel


def _expected(panel: Panel, axis: AxisResult, timeline: Timeline, factor: float) -> list[str]:
    """Return the area in which 95 % of the points should fall."""
    tau, adev, _ = curves.model_curve(axis, timeline)
    if not len(tau) or not (adev > 0).any():
        return []
    low, high = curves.expected_band(axis, tau, adev)
    return [panel.band(tau, low * factor, high * factor, 'expected')]


def _measured_points(panel: Panel, axis: AxisResult, factor: float, unit: str, label: str,
                     shape: str) -> str:
    curve = axis.curve
    titles = []
    for tau, value, band in zip(curve.tau_s, curve.adev, curve.ci95, strict=True):
        shown, *bounds = measured(*(v * factor for v in (value, *band)))
        titles.append(f'{label}, τ = {tau:.4g} s: {shown} {typeset(unit)}, '
                      f'95 % {" – ".join(bounds)}')
    seen = [value > 0 for value in curve.adev]
    return panel.points(np.array(curve.tau_s)[seen], np.array(curve.adev)[seen] * factor, shape,
                        [t for t, there in zip(titles, seen, strict=True) if there],
                        [few for few, there in zip(curves.few_degrees(axis), seen, strict=True)
                         if there])


def _term_labels(panel: Panel, axis: AxisResult, factor: float, timeline: Timeline, *,
                 brief: bool) -> list[str]:
    """Return the line of each term and process, a ring where it is read, and its value."""
    parts: list[str] = []
    taken: list[Box] = []
    tau = np.geomspace(axis.curve.tau_s[0], axis.curve.tau_s[-1], 81)
    smooth = curves.model_curve(axis, timeline)[:2]
    avoid = np.vstack([panel.pixels(axis.curve.tau_s, np.array(axis.curve.adev) * factor),
                       panel.pixels(smooth[0], smooth[1] * factor)])
    values = {key: value for key, value in curves.coefficients_of(axis).items() if value}
    for key, value in values.items():
        parts.append(panel.line(tau, TERMS[key].adev(value, tau) * factor, 'term'))
    for key, value in values.items():
        term = TERMS[key]
        at = curves.reading_point(term, axis, tau)
        name = term.name(AXES['gyro_x' if axis.unit == 'rad/s' else 'accel_x'])
        lines = [f'{term.symbol} = {curves.written(axis.coefficients[key], abs(value))}',
                 name if term.read_at else f'{name}, curve at {FLICKER_FLOOR:.3f} B']
        height = float(term.adev(value, at)) * factor
        parts.append(panel.label(at, height, lines[:1] if brief else lines, avoid, 'name', taken))
    for line, place, words in curves.beside_terms(axis, tau):
        parts.append(panel.line(tau, line * factor, 'term'))
        parts.append(panel.label(tau[place], line[place] * factor, words[:1] if brief else words,
                                 avoid, 'name', taken, ring=False))
    return parts


def comparison_chart(results: Mapping[str, Result], axis: str) -> Chart | None:
    """
    Draw the Allan deviation of one axis of every result.

    Parameters
    ----------
    results : mapping of name to Result
        What is compared.
    axis : str
        Its name, as in `Result.axes`.

    Returns
    -------
    Chart or None
        None where no result has the axis.

    """
    known = {str(place): (name, result.axes[axis], result.timeline)
             for place, (name, result) in enumerate(results.items())
             if axis in result.axes and any(result.axes[axis].curve.adev)}
    if not known:
        return None
    sensor = axis.partition('_')[0]
    unit = AXES[axis].unit
    factor, shown = engineering(1.0, unit)
    found = [item for _, item, _ in known.values()]
    low, high = curves.limits_of(found)
    ends = (min(item.curve.tau_s[0] for item in found) / 1.5,
            max(item.curve.tau_s[-1] for item in found) * 1.6)

    def draw(drawing: Drawing, narrow: bool) -> None:
        panel = _framed(drawing, narrow, sensor, unit, ends, (low, high))
        inside = []
        for place, (name, item, timeline) in known.items():
            tau, adev, _ = curves.model_curve(item, timeline)
            seen = np.array(item.curve.adev) > 0
            bands = np.array(item.curve.ci95)[seen].T * factor
            kind = f'result-{int(place) % 7}'
            inside.append(group(place, f'detail {kind}', [
                panel.band(np.array(item.curve.tau_s)[seen], bands[0], bands[1], 'expected')]))
            inside.append(group(place, kind, [
                panel.line(tau, adev * factor, 'curve model'),
                _measured_points(panel, item, factor, shown, name,
                                 SHAPES[int(place) % len(SHAPES)])]))
        drawing.add(panel, inside)

    return Chart(axis, spoken(axis), '',
                 both(axis, f'Allan deviation of {spoken(axis)} of every result', 400, 340, draw),
                 tuple((place, f'result-{int(place) % 7}', name)
                       for place, (name, _, _) in known.items()), next(iter(known)))
