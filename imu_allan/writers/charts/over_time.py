# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Charts over the time of the recording: the signal, and the noise density by segment."""

from collections.abc import Mapping

from imu_allan.result import AxisResult, Result, Timeline
from imu_allan.sensor.units import convert, engineering, MEAN_UNITS, typeset
from imu_allan.wording import duration, measured, number
from imu_allan.writers.charts.chart import box_of, Chart, padded, sensor_chart, shape_of
from imu_allan.writers.curves import marked, time_unit, wander
from imu_allan.writers.svg import Drawing, group, Panel
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def signal_chart(result: Result, sensor: str, axes: Mapping[str, AxisResult]) -> Chart | None:
    """
    Draw the wandering of the mean of every axis, and below it lowest and highest samples.

    Parameters
    ----------
    result : Result
        What the axes are from.
    sensor : str
        'gyro' or 'accel'.
    axes : mapping of name to AxisResult
        Of the sensor.

    Returns
    -------
    Chart or None
        None where the result does not have the signal.

    """
    known = {name: axis for name, axis in axes.items()
             if axis.signal is not None and axis.signal.mean and not axis.constant}
    if not known:
        return None
    unit = next(iter(known.values())).unit
    shown = MEAN_UNITS[unit]
    factor = convert(1.0, unit, shown)
    length = max(result.timeline.duration_s, 1e-9)
    scale, units = time_unit(length)
    warmth = result.temperature
    extents = [(name[-1], f'axis-{name[-1]}', axis.signal, factor)
               for name, axis in known.items() if axis.signal is not None]
    if warmth is not None:
        extents.append(('°C', 'warmth', warmth, 1.0))

    def draw(drawing: Drawing, narrow: bool) -> None:
        left, top, right, _ = box_of(drawing, narrow)
        strip = 52.0
        split = drawing.height - 46 - strip * (len(known) + (warmth is not None)) - 26
        main = drawing.panel((left, top, right, split), (0, length / scale, False),
                             _wander(known, factor))
        _shade(main, result.timeline, scale, known)
        main.frame('', f'mean of each segment less the mean of all [{typeset(shown)}]',
                   x_labels=False, most_y=6)
        courses = [(name[-1], *wander(axis)) for name, axis in known.items()]
        lines = [group(letter, f'axis-{letter}', [main.line(time / scale, mean * factor, 'curve')])
                 for letter, time, mean in courses]
        # Over all of the lines.
        marks = [group(letter, f'axis-{letter}', [
            _marks(main, letter, time, mean * factor, marked(mean, place), scale)])
            for place, (letter, time, mean) in enumerate(courses)]
        drawing.add(main, [*lines, *marks])
        drawing.text(left - 50, split + 18, f'lowest and highest sample [{typeset(shown)}]',
                     'title')
        for place, (tag, kind, signal, times) in enumerate(extents):
            y0 = split + 26 + place * strip
            low, high = (np.array([np.nan if v is None else v for v in values]) * times
                         for values in (signal.low, signal.high))
            ends = float(np.nanmin(low)), float(np.nanmax(high))
            part = drawing.panel((left, y0 + 2, right, y0 + strip - 12),
                                 (0, length / scale, False), padded(*ends))
            _shade(part, result.timeline, scale, known)
            last = place == len(extents) - 1
            part.frame(f'time [{units}]' if last else '', '', x_labels=last, most_y=3)
            time = (np.arange(len(low)) + 0.5) * signal.step_s / scale
            shape = part.line(time, (low + high) / 2, 'curve') if signal is warmth else \
                part.band(time, low, high, 'extent')
            drawing.add(part, [group(tag, kind, [shape])])
            if signal is warmth:
                drawing.text(right - 4, y0 + 14, tag, f'tag {kind}', 'end')
            else:
                # On the paper: on the band of its own colour it would hardly be seen.
                drawing.text(right + 4, y0 + strip / 2 - 1, tag, f'tag {kind}')

    text = ('Mean and extremes of equal segments of the recording. A drift, a warm-up or a knock '
            'shows here before any fit.')
    shades = [label for label, spans in (('Grey: gap.', result.timeline.gaps),
                                         ('Yellow: motion, left out.', result.timeline.motion))
              if spans]
    if warmth is not None:
        shades.append('°C: of the thermometer beside the sensor.')
    height = 354 if warmth is None else 406
    return sensor_chart(sensor, 'signal', 'the signal', 'mean and extremes over time',
                        ' '.join([text, *shades]), (height, height), draw, known)


def _marks(panel: Panel, letter: str, time_s: Array, mean: Array, at: NDArray[np.intp],
           scale: float) -> str:
    """Draw the mark of an axis here and there on its curve: in grey colours are alike."""
    return panel.points(time_s[at] / scale, mean[at], shape_of(letter),
                        [f'{letter} axis, after {duration(time_s[i])}: {number(mean[i], 3)}'
                         for i in at], [False] * len(at))


def _wander(axes: Mapping[str, AxisResult], factor: float) -> tuple[float, float, bool]:
    values = np.concatenate([wander(axis)[1] for axis in axes.values()]) * factor
    return padded(float(np.nanmin(values)), float(np.nanmax(values)))


def _shade(panel: Panel, timeline: Timeline, scale: float,
           axes: Mapping[str, AxisResult]) -> None:
    """Shade what was left out, and mark where the parts begin that were fitted by themselves."""
    for spans, kind, what in ((timeline.motion, 'motion', 'motion, left out'),
                              (timeline.gaps, 'gap', 'gap')):
        # Of more, each has less than three of the 1080 points, and the page only grows.
        for span in spans[:400]:
            panel.parts.append(panel.span(
                span.start_s / scale, (span.start_s + span.duration_s) / scale, kind,
                f'{what}: {duration(span.duration_s)} from {duration(span.start_s)} on'))
    steady = next((axis.stationarity for axis in axes.values()
                   if axis.stationarity is not None), None)
    for segment in steady.segments[1:] if steady else ():
        panel.parts.append(panel.upright(segment.start_s / scale, 'segment', 'next segment'))


def segment_chart(sensor: str, axes: Mapping[str, AxisResult]) -> Chart | None:
    """
    Draw the noise density of every part of the record with its interval.

    Parameters
    ----------
    sensor : str
        'gyro' or 'accel'.
    axes : mapping of name to AxisResult
        Of the sensor.

    Returns
    -------
    Chart or None
        None where no part is known.

    """
    known = {name: axis for name, axis in axes.items() if axis.stationarity is not None and any(
        segment.noise_density for segment in axis.stationarity.segments)}
    if not known:
        return None
    unit = next(iter(known.values())).coefficients['noise_density'].unit
    factor, shown = engineering(1.0, unit)
    rows = {name: [(s.start_s + s.duration_s / 2, s.noise_density * factor,
                    s.ci95[0] * factor, s.ci95[1] * factor)
                   for s in axis.stationarity.segments
                   if s.noise_density is not None and s.ci95 is not None]
            if axis.stationarity is not None else [] for name, axis in known.items()}
    scale, units = time_unit(max(
        s.start_s + s.duration_s for axis in known.values()
        for s in (axis.stationarity.segments if axis.stationarity else ())))
    ends = max(s.start_s + s.duration_s for axis in known.values()
               for s in (axis.stationarity.segments if axis.stationarity else ())) / scale
    values = [v for points in rows.values() for point in points for v in point[1:]]

    def draw(drawing: Drawing, narrow: bool) -> None:
        panel = drawing.panel(box_of(drawing, narrow), (0, ends, False),
                              padded(min(values), max(values)))
        panel.frame(f'time [{units}]', f'N of each segment [{typeset(shown)}]',
                    None if narrow else (1 / factor, f'[{typeset(unit)}]'), most_y=6)
        inside = []
        for place, (name, points) in enumerate(rows.items()):
            apart = (place - 1) * ends * 0.008
            parts = [panel.line([at / scale + apart] * 2, [low, high], 'whisker')
                     for at, _, low, high in points]
            parts.append(panel.points(
                [p[0] / scale + apart for p in points], [p[1] for p in points], shape_of(name[-1]),
                [f'{name[-1]} axis, segment {number_}: N {measured(*p[1:])[0]} {typeset(shown)}'
                 for number_, p in enumerate(points, 1)], [False] * len(points)))
            inside.append(group(name[-1], f'axis-{name[-1]}', parts))
        drawing.add(panel, inside)

    return sensor_chart(sensor, 'segments', 'by segment', 'noise density of each segment',
                        'The noise density of equal segments of the recording, each by itself, '
                        'with its 95 % interval.', (260, 260), draw, known)
