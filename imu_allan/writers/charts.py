# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The charts of the report, drawn as SVG into the page, for desktop and phone.

The three axes share a panel. The expected band, the terms and their names are shown for one axis
at a time: the worst one, until the reader chooses another.
"""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass

from imu_allan.arrays import Array
from imu_allan.noise.terms import AXES, FLICKER_FLOOR, TERMS
from imu_allan.result import AxisResult, Result, Timeline
from imu_allan.sensor.units import convert, engineering, MEAN_UNITS, typeset
from imu_allan.tuning.backtest import bands_of
from imu_allan.tuning.tune import FilterTuning
from imu_allan.wording import duration, measured, number, SAMPLES, SENSORS, spoken
from imu_allan.writers import curves
from imu_allan.writers.svg import Box, Drawing, group, Panel, SHAPES
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


def both(name: str, label: str, height: float, narrow_height: float,
         draw: Callable[[Drawing, bool], None]) -> str:
    """Draw once for desktop and print, and once for phones; return both as SVG."""
    drawings = []
    for size, width, tall in (('at-desk', 1080.0, height), ('on-phone', 380.0, narrow_height)):
        drawing = Drawing(width, tall, f'{name}-{size}', label)
        draw(drawing, size == 'on-phone')
        drawings.append(drawing.svg(size))
    return ''.join(drawings)


def sensor_chart(sensor: str, kind: str, title: str, label: str, caption: str,
                 heights: tuple[float, float], draw: Callable[[Drawing, bool], None],
                 axes: Mapping[str, AxisResult], focus: str = '') -> Chart:
    """Return a chart of the axes of a sensor."""
    name = f'{sensor}-{kind}'
    return Chart(name, f'{SENSORS[sensor]}: {title}', caption,
                 both(name, f'{SENSORS[sensor]}: {label}', *heights, draw), tuple(
                     (axis[-1], f'axis-{axis[-1]}', f'{axis[-1]} axis') for axis in axes), focus)


def box_of(drawing: Drawing, narrow: bool) -> Box:
    """Return the position of the axes in a drawing."""
    return (56.0 if narrow else 64.0, 26, drawing.width - (14 if narrow else 68),
            drawing.height - 46)


def shape_of(letter: str) -> str:
    """Return the marker shape of an axis."""
    return SHAPES['xyz'.index(letter)]


def worst_axis(axes: Mapping[str, AxisResult]) -> str:
    """Return the letter of the axis with the largest noise density."""
    return max(axes, key=lambda name: axes[name].coefficients['noise_density'].value or 0.0)[-1]


def padded(low: float, high: float) -> tuple[float, float, bool]:
    """Return the range of a linear axis, with a margin at both ends."""
    room = 0.06 * (high - low) or max(abs(high), 1e-9) * 0.01
    return low - room, high + room, False


def allan_chart(sensor: str, axes: Mapping[str, AxisResult], timeline: Timeline) -> Chart | None:
    """Draw the Allan deviation with model, expected band and terms; None without a curve."""
    known = {name: axis for name, axis in axes.items() if any(axis.curve.adev)}
    if not known:
        return None
    factor, shown = engineering(1.0, next(iter(known.values())).unit)
    limits = curves.limits_of(known.values(), rings=True)
    models = {name: curves.model_curve(axis, timeline) for name, axis in known.items()}

    def draw(drawing: Drawing, narrow: bool) -> None:
        panel = _framed(drawing, narrow, sensor, known.values(), limits, 1.9)
        inside = [_of(name, [*_expected(panel, axis, models[name], factor),
                             panel.line(models[name].tau, models[name].bound * factor, 'bound')],
                      'detail ') for name, axis in known.items()]
        inside += [_of(name, _curve(panel, axis, models[name], (factor, shown),
                                    f'{name[-1]} axis', shape_of(name[-1])))
                   for name, axis in known.items()]
        # Avoid the curves of all axes: a label of one could hide the curve of another.
        avoid = np.vstack([panel.pixels(x, np.asarray(y) * factor) for name, axis in known.items()
                           for x, y in ((axis.curve.tau_s, axis.curve.adev), models[name][:2])])
        inside += [group(name[-1], 'detail', _term_labels(panel, axis, factor, avoid,
                                                          brief=narrow))
                   for name, axis in known.items()]
        drawing.add(panel, inside)

    caption = ('Points: measured, hollow where few averages stand behind one. Line: reported. '
               'Of the axis chosen: 95 % of the points should fall into the shade, unless the '
               'mean moves. Ring: where a coefficient is read. Dots: the most that a hidden term '
               'may add.')
    if curves.beyond(known.values(), limits):
        caption += ' Arrow: a point beyond the axes.'
    return sensor_chart(sensor, 'allan', 'Allan deviation',
                        'Allan deviation against averaging time', caption, (470, 330), draw,
                        known, worst_axis(known))


def _of(name: str, parts: Iterable[str], before: str = '') -> str:
    """Return a group of parts of one axis, which are shown and hidden together."""
    return group(name[-1], f'{before}axis-{name[-1]}', parts)


def _framed(drawing: Drawing, narrow: bool, sensor: str, axes: Collection[AxisResult],
            limits: tuple[float, float], beyond: float) -> Panel:
    """Return the panel for curves within `limits` (SI); extend the time axis by `beyond`."""
    unit = next(iter(axes)).unit
    factor, shown = engineering(1.0, unit)
    ends = (min(axis.curve.tau_s[0] for axis in axes) / 1.5,
            max(axis.curve.tau_s[-1] for axis in axes) * beyond)
    panel = drawing.panel(box_of(drawing, narrow), (*ends, True),
                          (limits[0] * factor, limits[1] * factor, True))
    panel.frame('averaging time τ [s]', f'Allan deviation of {SAMPLES[sensor]} '
                f'[{typeset(shown)}]', None if narrow else (1 / factor, f'[{typeset(unit)}]'))
    return panel


def _expected(panel: Panel, axis: AxisResult, model: curves.ModelCurve, factor: float
              ) -> list[str]:
    """Return the band in which 95 % of the points should fall."""
    if not (model.adev > 0).any():
        return []
    low, high = curves.expected_band(axis, model.tau, model.adev)
    return [panel.band(model.tau, low * factor, high * factor, 'expected')]


def _curve(panel: Panel, axis: AxisResult, model: curves.ModelCurve, unit: tuple[float, str],
           label: str, shape: str) -> list[str]:
    """Return the line of the model, and the points above zero with their tooltips."""
    factor, shown = unit
    x, y, titles, hollow = [], [], [], []
    for tau, adev, band, few in zip(axis.curve.tau_s, axis.curve.adev, axis.curve.ci95,
                                    curves.few_degrees(axis), strict=True):
        if adev > 0:
            value, *bounds = measured(*(v * factor for v in (adev, *band)))
            x.append(tau)
            y.append(adev * factor)
            titles.append(f'{label}, τ = {tau:.4g} s: {value} {typeset(shown)}, '
                          f'95 % {" – ".join(bounds)}')
            hollow.append(few)
    return [panel.line(model.tau, model.adev * factor, 'curve model'),
            panel.points(x, y, shape, titles, hollow)]


def _term_labels(panel: Panel, axis: AxisResult, factor: float, avoid: Array, *,
                 brief: bool) -> list[str]:
    """Return the lines of terms and processes, with reading points as rings, and values."""
    parts: list[str] = []
    taken: list[Box] = []
    tau = np.geomspace(axis.curve.tau_s[0], axis.curve.tau_s[-1], 81)
    values = {key: value for key, value in curves.coefficients_of(axis).items() if value}
    for key, value in values.items():
        parts.append(panel.line(tau, TERMS[key].adev(value, tau) * factor, 'term'))
    for key, value in values.items():
        term = TERMS[key]
        at = curves.reading_point(term, axis, tau)
        name = term.name(AXES['gyro_x' if axis.unit == 'rad/s' else 'accel_x'])
        lines = [f'{term.symbol} = {curves.value_with_unit(axis.coefficients[key], abs(value))}',
                 name, *([] if term.read_at else [f'line at {FLICKER_FLOOR:.3f} B'])]
        height = float(term.adev(value, at)) * factor
        parts.append(panel.label(at, height, lines[:1] if brief else lines, avoid, 'name', taken))
    for line, place, words in curves.other_noise(axis, tau):
        parts.append(panel.line(tau, line * factor, 'term'))
        parts.append(panel.label(tau[place], line[place] * factor, words[:1] if brief else words,
                                 avoid, 'name', taken, ring=False))
    return parts


def comparison_chart(results: Mapping[str, Result], axis: str) -> Chart | None:
    """Draw the Allan deviation of one axis of every result; None if no result has it."""
    known = {str(place): (name, result.axes[axis], result.timeline)
             for place, (name, result) in enumerate(results.items())
             if axis in result.axes and any(result.axes[axis].curve.adev)}
    if not known:
        return None
    factor, shown = engineering(1.0, AXES[axis].unit)
    found = [item for _, item, _ in known.values()]
    limits = curves.limits_of(found)
    kinds = {place: f'result-{int(place) % 7}' for place in known}

    def draw(drawing: Drawing, narrow: bool) -> None:
        panel = _framed(drawing, narrow, axis.partition('_')[0], found, limits, 1.6)
        inside = []
        for place, (name, item, timeline) in known.items():
            seen = np.array(item.curve.adev) > 0
            low, high = np.array(item.curve.ci95)[seen].T * factor
            inside.append(group(place, f'detail {kinds[place]}', [
                panel.band(np.array(item.curve.tau_s)[seen], low, high, 'expected')]))
            inside.append(group(place, kinds[place], _curve(
                panel, item, curves.model_curve(item, timeline), (factor, shown), name,
                SHAPES[int(place) % len(SHAPES)])))
        drawing.add(panel, inside)

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
    moved = {name: curves.mean_over_time(axis) for name, axis in known.items()}
    unit = next(iter(known.values())).unit
    shown = MEAN_UNITS[unit]
    factor = convert(1.0, unit, shown)
    length = max(result.timeline.duration_s, 1e-9)
    scale, units = curves.time_unit(length)
    warm = len(curves.over_time(result.temperature)[0]) > 0
    strips = [(name[-1], f'axis-{name[-1]}', axis.signal, factor) for name, axis in known.items()]
    if warm:
        strips.append(('°C', 'warmth', result.temperature, 1.0))

    def draw(drawing: Drawing, narrow: bool) -> None:
        left, top, right, _ = box_of(drawing, narrow)
        strip = 52.0
        split = drawing.height - 46 - strip * len(strips) - 26
        values = np.concatenate([mean for _, mean in moved.values()]) * factor
        main = drawing.panel((left, top, right, split), (0, length / scale, False),
                             padded(float(np.nanmin(values)), float(np.nanmax(values))))
        _shade(main, result.timeline, scale, known)
        main.frame('', f'mean of each segment less the mean of all [{typeset(shown)}]',
                   x_labels=False, most_y=6)
        lines, marks = [], []
        for place, name in enumerate(known):
            time, mean = moved[name]
            at = curves.marker_indices(mean, place)
            lines.append(_of(name, [main.line(time / scale, mean * factor, 'curve')]))
            # Markers distinguish the axes in greyscale print.
            marks.append(_of(name, [main.points(
                time[at] / scale, mean[at] * factor, shape_of(name[-1]),
                [f'{name[-1]} axis, after {duration(time[i])}: {number(mean[i] * factor, 3)}'
                 for i in at])]))
        # Draw the marks above all lines.
        drawing.add(main, [*lines, *marks])
        drawing.text(left - 50, split + 18, f'lowest and highest sample [{typeset(shown)}]',
                     'title')
        for place, (tag, kind, signal, times) in enumerate(strips):
            y0 = split + 26 + place * strip
            time, rows = curves.over_time(signal)
            low, _, high = rows * times
            ends = float(np.nanmin(low)), float(np.nanmax(high))
            part = drawing.panel((left, y0 + 2, right, y0 + strip - 12),
                                 (0, length / scale, False), padded(*ends))
            _shade(part, result.timeline, scale, known)
            last = place == len(strips) - 1
            part.frame(f'time [{units}]' if last else '', '', x_labels=last, most_y=3)
            shape = part.line(time / scale, (low + high) / 2, 'curve') if kind == 'warmth' else \
                part.band(time / scale, low, high, 'extent')
            drawing.add(part, [group(tag, kind, [shape])])
            if kind == 'warmth':
                drawing.text(right - 4, y0 + 14, tag, f'tag {kind}', 'end')
            else:
                # Place it beside the band, as it would hardly be visible on the same colour.
                drawing.text(right + 4, y0 + strip / 2 - 1, tag, f'tag {kind}')

    text = ('Mean and extremes of equal segments of the recording. A drift, a warm-up or a knock '
            'shows here before any fit.')
    shades = [label for label, spans in (('Grey: gap.', result.timeline.gaps),
                                         ('Yellow: motion, left out.', result.timeline.motion))
              if spans]
    if warm:
        shades.append('°C: of the thermometer beside the sensor.')
    height = 406 if warm else 354
    return sensor_chart(sensor, 'signal', 'the signal', 'mean and extremes over time',
                        ' '.join([text, *shades]), (height, height), draw, known)


def _shade(panel: Panel, timeline: Timeline, scale: float, axes: Mapping[str, AxisResult]) -> None:
    """Shade excluded spans, and mark where the separately fitted segments begin."""
    for spans, kind, what in ((timeline.motion, 'motion', 'motion, left out'),
                              (timeline.gaps, 'gap', 'gap')):
        # With more, each would be narrower than three of 1080 units and only enlarge the page.
        for span in spans[:400]:
            panel.parts.append(panel.span(
                span.start_s / scale, (span.start_s + span.duration_s) / scale, kind,
                f'{what}: {duration(span.duration_s)} from {duration(span.start_s)} on'))
    steady = next((axis.stationarity for axis in axes.values()
                   if axis.stationarity is not None), None)
    for segment in steady.segments[1:] if steady else ():
        panel.parts.append(panel.vertical(segment.start_s / scale, 'segment', 'next segment'))


def density_chart(sensor: str, axes: Mapping[str, AxisResult], timeline: Timeline) -> Chart | None:
    """Draw spectrum, model and excluded lines; None if there is neither of the first two."""
    known = {name: axis for name, axis in axes.items()
             if axis.spectrum is not None or curves.coefficients_of(axis)}
    rate = timeline.sample_rate_hz
    if not known or rate is None or timeline.duration_s <= 0:
        return None
    unit = AXES[next(iter(known))].unit
    factor, shown = engineering(1.0, unit)
    low, high = curves.density_limits(known.values(), timeline)
    lowest = min(1 / timeline.duration_s, rate / 4)
    frequency = np.geomspace(lowest, rate / 2, 160)

    def draw(drawing: Drawing, narrow: bool) -> None:
        panel = drawing.panel(box_of(drawing, narrow), (lowest / 1.2, rate / 2 * 1.2, True),
                              (low * factor**2, high * factor**2, True))
        for name, axis in known.items():
            if axis.band_edge_hz is not None:
                panel.parts.append(group(name[-1], 'detail', [panel.span(
                    axis.band_edge_hz, rate / 2, 'beyond-band',
                    f'{name[-1]} axis: not fitted above {axis.band_edge_hz:.3g} Hz')]))
            # Only the strongest, since more labels would overlap.
            for tone in axis.tones[:12]:
                amount = number(tone.amplitude * factor, 3)
                panel.parts.append(group(name[-1], 'detail', [panel.vertical(
                    tone.frequency_hz, 'tone',
                    f'{name[-1]} axis: line at {tone.frequency_hz:.4g} Hz, {amount} '
                    f'{typeset(shown)}, left out of the fit')]))
        panel.frame('frequency [Hz]',
                    f'power spectral density, two-sided [({typeset(shown)})²/Hz]',
                    None if narrow else (factor**-2, f'[({typeset(unit)})²/Hz]'))
        inside = []
        for name, axis in known.items():
            if axis.spectrum is not None:
                at, power = curves.in_bands(axis.spectrum)
                inside.append(_of(name, [panel.line(at, power * factor**2, 'measured')]))
        for name, axis in known.items():
            model = curves.model_density(axis, frequency, rate) * factor**2
            inside.append(_of(name, [panel.line(
                frequency, np.where(model > 0, model, np.nan), 'curve model')]))
        drawing.add(panel, inside)

    shaded = any(axis.band_edge_hz is not None for axis in known.values())
    return sensor_chart(
        sensor, 'psd', 'power spectral density', 'power spectral density against frequency',
        'Thin: measured, in bands of a quarter of an octave. Thick: fitted model, low-pass '
        'included; white noise of density N stands at N². Upright: lines that were left out of '
        'the fit.' + (' Shaded: frequencies that were left out.' if shaded else ''), (400, 320),
        draw, known, worst_axis(known))


def drift_chart(sensor: str, axes: Mapping[str, AxisResult],
                tunings: Mapping[str, FilterTuning]) -> Chart | None:
    """Draw the unaided drift over time, predicted and observed; None if neither is known."""
    known = {name: axis for name, axis in axes.items()
             if name in tunings or (axis.backtest is not None and axis.backtest.coast)}
    if not known:
        return None
    unit = AXES[next(iter(known))].unit
    factor, shown = engineering(1.0, unit)
    expected = {name: np.array(tunings[name].consistency).T for name in known if name in tunings}
    coasts = {name: axis.backtest.coast if axis.backtest else () for name, axis in known.items()}
    met = [coast for each in coasts.values() for coast in each]
    horizons = np.concatenate([*(line[0] for line in expected.values()),
                               [one.horizon_s for one in met]])
    values = np.concatenate([*(line[1] for line in expected.values()),
                             [one.observed_rms for one in met],
                             [end for axis in known.values() for band in bands_of(axis)
                              for end in band]])
    values = values[values > 0]
    if not len(values):
        return None
    low, high = float(values.min()) * factor, float(values.max()) * factor
    ends = float(horizons.min()) / 1.4, float(horizons.max()) * 1.4

    def draw(drawing: Drawing, narrow: bool) -> None:
        panel = drawing.panel(box_of(drawing, narrow), (*ends, True),
                              (low / 1.7, high * 1.7, True))
        panel.frame('unaided time [s]', f'error of the mean {SAMPLES[sensor]} over it '
                    f'[{typeset(shown)}]', None if narrow else (1 / factor, f'[{typeset(unit)}]'))
        inside = []
        for name, axis in known.items():
            parts, coast = [], coasts[name]
            if name in expected:
                parts.append(panel.line(expected[name][0], expected[name][1] * factor,
                                        'curve model'))
            if coast:
                times = [c.horizon_s for c in coast]
                least, most = np.array(bands_of(axis)).T * factor
                inside.append(_of(name, [panel.band(times, least, most, 'expected')], 'detail '))
                parts.append(panel.points(
                    times, [c.observed_rms * factor for c in coast], shape_of(name[-1]), [
                        f'{name[-1]} axis, after {duration(c.horizon_s)}: predicted '
                        f'{number(c.predicted_sigma * factor, 3)}, observed '
                        f'{number(c.observed_rms * factor, 3)} {typeset(shown)}'
                        for c in coast]))
            inside.append(_of(name, parts))
        drawing.add(panel, inside)

    tested = any(axis.backtest is not None for axis in known.values())
    return sensor_chart(
        sensor, 'drift', 'unaided drift', 'predicted and observed drift',
        'Line: expected error of a filter with the tuned numbers.' + (
            ' Points: what happened in the part of the recording that the model was not fitted '
            'to. Of the axis chosen, 95 % of them should fall into the shade.'
            if tested else ''), (340, 300), draw, known, worst_axis(known))
