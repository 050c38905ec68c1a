# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The charts of the report, drawn as SVG into the page, for desktop and phone.

The three axes share a panel. The expected band, the terms and their names are shown for one axis
at a time: the worst one, until the reader chooses another.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

from imu_allan.arrays import Array
from imu_allan.noise.terms import AXES, FLICKER_FLOOR, TERMS
from imu_allan.result import AxisResult, Result, Timeline
from imu_allan.sensor.units import convert, engineering, MEAN_UNITS, typeset
from imu_allan.tuning.backtest import bands_of
from imu_allan.tuning.tune import FilterTuning
from imu_allan.wording import duration, measured, number, SAMPLES, SENSORS, spoken
from imu_allan.writers import curves
from imu_allan.writers.svg import Box, Drawing, Panel, SHAPES
import numpy as np


@dataclass(frozen=True)
class Chart:
    """
    One chart of the page.

    Attributes
    ----------
    name : str
        Identifier, unique in the page.
    title, caption : str
    svg : str
        The two drawings, for desktop and phone.
    groups : tuple of (str, str, str)
        Name, class and label of each group that the reader can select.
    focus : str
        The group that is selected initially.

    """

    name: str
    title: str
    caption: str
    svg: str
    groups: tuple[tuple[str, str, str], ...] = ()
    focus: str = ''


Draw = Callable[[Drawing], None]
"""What draws a chart, for desktop or phone."""


def both(name: str, label: str, height: float, narrow_height: float, draw: Draw) -> str:
    """Draw once for desktop and print, and once for phones; return both as SVG."""
    drawings = []
    for size, width, tall in (('at-desk', 1080.0, height), ('on-phone', 380.0, narrow_height)):
        drawing = Drawing(width, tall, f'{name}-{size}', label)
        draw(drawing)
        drawings.append(drawing.svg(size))
    return ''.join(drawings)


def sensor_chart(sensor: str, kind: str, title: str, label: str, caption: str,
                 heights: tuple[float, float], draw: Draw, axes: Mapping[str, AxisResult], *,
                 focused: bool = True) -> Chart:
    """Return a chart of the axes of a sensor; if `focused`, with the worst one in focus."""
    name = f'{sensor}-{kind}'
    focus = (curves.worst_of(axes, 'noise_density') or next(iter(axes)))[-1] if focused else ''
    return Chart(name, f'{SENSORS[sensor]}: {title}', caption,
                 both(name, f'{SENSORS[sensor]}: {label}', *heights, draw),
                 tuple((*of(axis), f'{axis[-1]} axis') for axis in axes), focus)


def of(name: str, before: str = '') -> tuple[str, str]:
    """Return name and class of the group of an axis, which is shown and hidden together."""
    return name[-1], f'{before}axis-{name[-1]}'


def box_of(drawing: Drawing) -> Box:
    """Return the position of the axes in a drawing."""
    left, right = (56.0, 14.0) if drawing.narrow else (64.0, 68.0)
    return left, 26, drawing.width - right, drawing.height - 46


def log_panel(drawing: Drawing, ends: tuple[float, float], limits: tuple[float, float], unit: str,
              x_title: str, y_title: str, power: int = 1) -> Panel:
    """Return a panel with units of datasheets on the left and, if it is wide, SI on the right."""
    factor, shown = engineering(1.0, unit)
    left, right = (f'[{typeset(one)}]' if power == 1 else f'[({typeset(one)})²/Hz]'
                   for one in (shown, unit))
    return drawing.panel(
        box_of(drawing), (*ends, True), (*limits, True),
        (x_title, f'{y_title} {left}', '' if drawing.narrow else right), factor**power)


def shape_of(name: str) -> str:
    """Return the marker shape of an axis."""
    return SHAPES['xyz'.index(name[-1])]


def padded(low: float, high: float) -> tuple[float, float, bool]:
    """Return the range of a linear axis, with a margin at both ends."""
    room = 0.06 * (high - low) or max(abs(high), 1e-9) * 0.01
    return low - room, high + room, False


def allan_chart(sensor: str, axes: Mapping[str, AxisResult], timeline: Timeline) -> Chart | None:
    """Draw the Allan deviation with model, expected band and terms; None without a curve."""
    known = {name: axis for name, axis in axes.items() if any(axis.curve.adev)}
    if not known:
        return None
    limits = curves.limits_of(known.values(), rings=True)
    models = {name: curves.model_curve(axis, timeline) for name, axis in known.items()}

    def draw(drawing: Drawing) -> None:
        panel = _allan_panel(drawing, sensor, known.values(), limits, 1.9)
        with panel.framed():
            for name, axis in known.items():
                model = models[name]
                with panel.group(*of(name, 'detail ')):
                    if (model.adev > 0).any():
                        panel.band('expected', model.tau,
                                   *curves.expected_band(axis, model.tau, model.adev))
                    panel.line('bound', model.tau, model.bound)
            for name, axis in known.items():
                with panel.group(*of(name)):
                    _draw_curve(panel, axis, models[name], f'{name[-1]} axis', shape_of(name))
            # Avoid the curves of all axes: a label of one could hide the curve of another.
            avoid = np.vstack([np.column_stack([panel.x(x), panel.y(y)])
                               for name, axis in known.items() for x, y in (
                                   (axis.curve.tau_s, axis.curve.adev), models[name][:2])])
            for name, axis in known.items():
                with panel.group(name[-1], 'detail'):
                    _label_terms(panel, axis, avoid, brief=drawing.narrow)

    caption = ('Points: measured, hollow where few averages stand behind one. Line: reported. '
               'Of the axis chosen: 95 % of the points should fall into the shade, unless the '
               'mean moves. Ring: where a coefficient is read. Dots: the most that a hidden term '
               'may add.')
    if curves.beyond(known.values(), limits):
        caption += ' Arrow: a point beyond the axes.'
    return sensor_chart(sensor, 'allan', 'Allan deviation',
                        'Allan deviation against averaging time', caption, (470, 330), draw,
                        known)


def _allan_panel(drawing: Drawing, sensor: str, axes: Collection[AxisResult],
                 limits: tuple[float, float], beyond: float) -> Panel:
    """Return the panel for curves within `limits`; extend the time axis by `beyond`."""
    ends = (min(axis.curve.tau_s[0] for axis in axes) / 1.5,
            max(axis.curve.tau_s[-1] for axis in axes) * beyond)
    return log_panel(drawing, ends, limits, next(iter(axes)).unit,
                     'averaging time τ [s]', f'Allan deviation of {SAMPLES[sensor]}')


def _draw_curve(panel: Panel, axis: AxisResult, model: curves.ModelCurve, label: str, shape: str
                ) -> None:
    """Draw the line of the model, and the points above zero with their tooltips."""
    panel.line('curve model', model.tau, model.adev)
    factor, unit = engineering(1.0, axis.unit)
    curve = axis.curve
    points = [row for row in zip(curve.tau_s, curve.adev, curve.ci95, curves.few_degrees(axis),
                                 strict=True) if row[1] > 0]
    titles = []
    for tau, adev, ends, _ in points:
        value, *bounds = measured(*(v * factor for v in (adev, *ends)))
        titles.append(f'{label}, τ = {tau:.4g} s: {value} {typeset(unit)}, '
                      f'95 % {" – ".join(bounds)}')
    x, y, _, hollow = zip(*points, strict=True)
    panel.points(x, y, shape, titles, hollow)


def _label_terms(panel: Panel, axis: AxisResult, avoid: Array, *, brief: bool) -> None:
    """Draw the lines of terms and processes, with reading points as rings, and values."""
    taken: list[Box] = []
    tau = np.geomspace(axis.curve.tau_s[0], axis.curve.tau_s[-1], 81)
    values = {key: value for key, value in curves.coefficients_of(axis).items() if value}
    for key, value in values.items():
        panel.line('term', tau, TERMS[key].adev(value, tau))
    for key, value in values.items():
        term = TERMS[key]
        at = curves.reading_point(term, axis, tau)
        lines = [curves.labelled(axis.coefficients[key]),
                 term.name(AXES['gyro_x' if axis.unit == 'rad/s' else 'accel_x']),
                 *([] if term.read_at else [f'line at {FLICKER_FLOOR:.3f} B'])]
        panel.label(at, float(term.adev(value, at)), lines[:1] if brief else lines, avoid, taken)
    for line, place, words in curves.other_noise(axis, tau):
        panel.line('term', tau, line)
        panel.label(tau[place], line[place], words[:1] if brief else words, avoid, taken,
                    ring=False)


def comparison_chart(results: Mapping[str, Result], axis: str) -> Chart | None:
    """Draw the Allan deviation of one axis of every result; None if no result has it."""
    known = {str(place): (name, result.axes[axis], result.timeline)
             for place, (name, result) in enumerate(results.items())
             if axis in result.axes and any(result.axes[axis].curve.adev)}
    if not known:
        return None
    found = [item for _, item, _ in known.values()]
    kinds = {place: f'result-{place}' for place in known}

    def draw(drawing: Drawing) -> None:
        panel = _allan_panel(drawing, axis.partition('_')[0], found, curves.limits_of(found), 1.6)
        with panel.framed():
            for place, (name, item, timeline) in known.items():
                seen = np.array(item.curve.adev) > 0
                with panel.group(place, f'detail {kinds[place]}'):
                    panel.band('expected', np.array(item.curve.tau_s)[seen],
                               *np.array(item.curve.ci95)[seen].T)
                with panel.group(place, kinds[place]):
                    _draw_curve(panel, item, curves.model_curve(item, timeline), name,
                                SHAPES[int(place) % len(SHAPES)])

    return Chart(axis, spoken(axis), '',
                 both(axis, f'Allan deviation of {spoken(axis)} of every result', 400, 340, draw),
                 tuple((place, kinds[place], name) for place, (name, _, _) in known.items()),
                 next(iter(known)))


def signal_chart(result: Result, sensor: str, axes: Mapping[str, AxisResult]) -> Chart | None:
    """Draw the mean of every axis over time above its extremes; None without a signal."""
    known = {name: axis for name, axis in axes.items()
             if not axis.constant and len(curves.over_time(axis.signal)[0])}
    if not known:
        return None
    unit = next(iter(known.values())).unit
    shown = MEAN_UNITS[unit]
    factor = convert(1.0, unit, shown)
    moved = {name: (time, mean * factor) for name, axis in known.items()
             for time, mean in [curves.mean_over_time(axis)]}
    means = np.concatenate([mean for _, mean in moved.values()])
    length = max(result.timeline.duration_s, 1e-9)
    scale, units = curves.time_unit(length)
    warm = len(curves.over_time(result.temperature)[0]) > 0
    strips = [(*of(name), axis.signal, factor) for name, axis in known.items()]
    if warm:
        strips.append(('°C', 'warmth', result.temperature, 1.0))

    def draw(drawing: Drawing) -> None:
        left, top, right, _ = box_of(drawing)
        strip = 52.0
        split = drawing.height - 46 - strip * len(strips) - 26

        def panel_from(top: float, bottom: float, values: Array, x_title: str, y_title: str
                       ) -> Panel:
            panel = drawing.panel(
                (left, top, right, bottom), (0, length / scale, False),
                padded(float(np.nanmin(values)), float(np.nanmax(values))), (x_title, y_title, ''))
            _shade(panel, result.timeline, scale, known)
            return panel

        main = panel_from(top, split, means, '',
                          f'mean of each segment less the mean of all [{typeset(shown)}]')
        with main.framed(x_labels=False, most_y=6):
            for name, (time, mean) in moved.items():
                with main.group(*of(name)):
                    main.line('curve', time / scale, mean)
        drawing.text(left - 50, split + 18, f'lowest and highest sample [{typeset(shown)}]',
                     'title')
        for place, (tag, kind, signal, times) in enumerate(strips, 1):
            y0 = split + 26 + (place - 1) * strip
            time, rows = curves.over_time(signal)
            low, _, high = rows * times
            last = place == len(strips)
            part = panel_from(y0 + 2, y0 + strip - 12, np.concatenate([low, high]),
                              f'time [{units}]' if last else '', '')
            with part.framed(x_labels=last, most_y=3), part.group(tag, kind):
                if kind == 'warmth':
                    part.line('curve', time / scale, (low + high) / 2)
                else:
                    part.band('extent', time / scale, low, high)
            # Place the tag beside a band, as it would hardly be visible on the same colour.
            x, down, anchor = ((right - 4, 14.0, 'end') if kind == 'warmth' else
                               (right + 4, strip / 2 - 1, 'start'))
            drawing.text(x, y0 + down, tag, f'tag {kind}', anchor)

    text = ('Mean and extremes of equal segments of the recording. A drift, a warm-up or a knock '
            'shows here before any fit.')
    shades = [label for label, spans in (('Grey: gap.', result.timeline.gaps),
                                         ('Yellow: motion, left out.', result.timeline.motion))
              if spans]
    if warm:
        shades.append('°C: of the thermometer beside the sensor.')
    height = 406 if warm else 354
    return sensor_chart(sensor, 'signal', 'the signal', 'mean and extremes over time',
                        ' '.join([text, *shades]), (height, height), draw, known,
                        focused=False)


def _shade(panel: Panel, timeline: Timeline, scale: float, axes: Mapping[str, AxisResult]) -> None:
    """Shade excluded spans, and mark where the separately fitted segments begin."""
    for spans, kind, what in ((timeline.motion, 'motion', 'motion, left out'),
                              (timeline.gaps, 'gap', 'gap')):
        # With more, each would be narrower than three of 1080 units and only enlarge the page.
        for span in spans[:400]:
            panel.span(span.start_s / scale, (span.start_s + span.duration_s) / scale, kind,
                       f'{what}: {duration(span.duration_s)} from {duration(span.start_s)} on')
    steady = next((axis.stationarity for axis in axes.values()
                   if axis.stationarity is not None), None)
    for segment in steady.segments[1:] if steady else ():
        panel.vertical(segment.start_s / scale, 'segment', 'next segment')


def density_chart(sensor: str, axes: Mapping[str, AxisResult], timeline: Timeline) -> Chart | None:
    """Draw spectrum, model and excluded lines; None if there is neither of the first two."""
    known = {name: axis for name, axis in axes.items()
             if axis.spectrum is not None or curves.coefficients_of(axis)}
    models = {name: curves.model_density(axis, timeline, 160) for name, axis in known.items()}
    frequency, _ = next(iter(models.values()), (np.zeros(0), None))
    if not len(frequency):
        return None
    unit = AXES[next(iter(known))].unit
    factor, shown = engineering(1.0, unit)
    limits = curves.density_limits(known.values(), timeline)
    lowest, highest = map(float, frequency[[0, -1]])

    def draw(drawing: Drawing) -> None:
        panel = log_panel(drawing, (lowest / 1.2, highest * 1.2), limits, unit,
                          'frequency [Hz]', 'power spectral density, two-sided', 2)
        for name, axis in known.items():
            if axis.band_edge_hz is not None:
                with panel.group(name[-1], 'detail'):
                    panel.span(axis.band_edge_hz, highest, 'beyond-band',
                               f'{name[-1]} axis: not fitted above {axis.band_edge_hz:.3g} Hz')
            # Only the strongest, since more labels would overlap.
            for tone in axis.tones[:12]:
                with panel.group(name[-1], 'detail'):
                    panel.vertical(tone.frequency_hz, 'tone',
                                   f'{name[-1]} axis: line at {tone.frequency_hz:.4g} Hz, '
                                   f'{number(tone.amplitude * factor, 3)} {typeset(shown)}, '
                                   'left out of the fit')
        with panel.framed():
            for name, axis in known.items():
                if axis.spectrum is not None:
                    with panel.group(*of(name)):
                        panel.line('measured', *curves.in_bands(axis.spectrum))
            for name, (frequency, model) in models.items():
                with panel.group(*of(name)):
                    panel.line('curve model', frequency, np.where(model > 0, model, np.nan))

    shaded = any(axis.band_edge_hz is not None for axis in known.values())
    return sensor_chart(
        sensor, 'psd', 'power spectral density', 'power spectral density against frequency',
        'Thin: measured, in bands of a quarter of an octave. Thick: fitted model, low-pass '
        'included; white noise of density N stands at N². Upright: lines that were left out of '
        'the fit.' + (' Shaded: frequencies that were left out.' if shaded else ''), (400, 320),
        draw, known)


def drift_chart(sensor: str, axes: Mapping[str, AxisResult],
                tunings: Mapping[str, FilterTuning]) -> Chart | None:
    """Draw the unaided drift over time, predicted and observed; None if neither is known."""
    coasts = {name: axis.backtest.coast if axis.backtest else () for name, axis in axes.items()}
    known = {name: axis for name, axis in axes.items() if name in tunings or coasts[name]}
    if not known:
        return None
    unit = AXES[next(iter(known))].unit
    factor, shown = engineering(1.0, unit)
    expected = {name: np.array(tunings[name].consistency).T for name in known if name in tunings}
    met = [coast for each in coasts.values() for coast in each]
    horizons = np.concatenate([*(line[0] for line in expected.values()),
                               [one.horizon_s for one in met]])
    values = np.concatenate([*(line[1] for line in expected.values()),
                             [one.observed_rms for one in met],
                             *(band for axis in known.values() for band in bands_of(axis))])
    values = values[values > 0]
    if not len(values):
        return None
    ends = float(horizons.min()) / 1.4, float(horizons.max()) * 1.4
    limits = float(values.min()) / 1.7, float(values.max()) * 1.7

    def draw(drawing: Drawing) -> None:
        panel = log_panel(drawing, ends, limits, unit, 'unaided time [s]',
                          f'error of the mean {SAMPLES[sensor]} over it')
        with panel.framed():
            for name, axis in known.items():
                coast = coasts[name]
                times = [c.horizon_s for c in coast]
                if coast:
                    with panel.group(*of(name, 'detail ')):
                        panel.band('expected', times, *np.array(bands_of(axis)).T)
                with panel.group(*of(name)):
                    if name in expected:
                        panel.line('curve model', *expected[name][:2])
                    panel.points(times, [c.observed_rms for c in coast], shape_of(name), [
                        f'{name[-1]} axis, after {duration(c.horizon_s)}: predicted '
                        f'{number(c.predicted_sigma * factor, 3)}, observed '
                        f'{number(c.observed_rms * factor, 3)} {typeset(shown)}' for c in coast])

    return sensor_chart(
        sensor, 'drift', 'unaided drift', 'predicted and observed drift',
        'Line: expected error of a filter with the tuned numbers.' + (
            ' Points: what happened in the part of the recording that the model was not fitted '
            'to. Of the axis chosen, 95 % of them should fall into the shade.'
            if met else ''), (340, 300), draw, known)
