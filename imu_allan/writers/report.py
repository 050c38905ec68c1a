# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The report: one HTML file that shows everything and needs nothing else.

Style, program, plotting library and numbers are all inside the file. Its own security policy
forbids every request and every script but those it was written with, so that a report opened years
later, offline, or mailed by a stranger shows what it showed on the first day and no more.
"""

from base64 import b64encode
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from importlib.resources import files
import json
from math import sqrt
from typing import Any, TYPE_CHECKING

from imu_allan.errors import ImuAllanError, printable
from imu_allan.noise.terms import AXES, FLICKER_FLOOR, TERMS
from imu_allan.noise.units import convert, engineering, typeset
from imu_allan.result import AxisResult, Coefficient, Result, Span
from imu_allan.version import __version__
from imu_allan.writers.comparison import compare, Difference, result_colours, shown
from imu_allan.writers.filters import CONSUMERS, export
from imu_allan.writers.panels import (
    axes_of,
    coefficients_of,
    COLOURS,
    model_density,
    sensors_of,
)
from imu_allan.writers.table import duration, number
import numpy as np

if TYPE_CHECKING:
    from jinja2 import Environment

_SENSORS = {'gyro': 'Gyroscope', 'accel': 'Accelerometer'}
_SAMPLE_NAMES = {'gyro': 'angular rate', 'accel': 'acceleration'}
_CONSUMER_TITLES = {
    'kalibr': 'Kalibr', 'openvins': 'OpenVINS', 'orb_slam3': 'ORB-SLAM3',
    'vins_fusion': 'VINS-Fusion', 'lio_sam': 'LIO-SAM', 'fast_lio': 'FAST-LIO', 'gtsam': 'GTSAM',
    'basalt': 'Basalt', 'msckf_vio': 'MSCKF-VIO', 'robot_localization': 'robot_localization',
    'px4': 'PX4', 'ardupilot': 'ArduPilot'}
_LONGEST_LIST = 500


def report_html(result: Result) -> str:
    """
    Return the report of one result.

    Parameters
    ----------
    result : Result
        What to report.

    Returns
    -------
    str
        An HTML document of some 5 MB, most of it the plotting library.

    """
    source = result.source
    names = [name for name in (source.path, source.topic) if name]
    charts = [chart for sensor in sensors_of(result)
              for chart in (_allan_chart(result, sensor), _density_chart(result, sensor))]
    return _page(
        'report.html.j2', charts,
        title=' '.join(printable(name) for name in names) or 'samples',
        names=[printable(name) for name in names] or ['samples'], facts=_facts(result),
        version=printable(result.imu_allan_version),
        tables=[_table(result, sensor) for sensor in sensors_of(result)],
        warnings=_warnings(result),
        findings=_findings(result), strip=_strip(result),
        gaps=_spans(result.timeline.gaps), motion=_spans(result.timeline.motion),
        configs=_configs(result), fits=_fits(result))


def comparison_html(results: Mapping[str, Result]) -> str:
    """
    Return the report that compares several results with the first of them.

    Parameters
    ----------
    results : mapping of name to Result
        At least two.

    Returns
    -------
    str
        An HTML document.

    Raises
    ------
    ImuAllanError
        If the results have nothing in common.

    """
    differences = compare(results)
    charts = [chart for axis in AXES
              for chart in [_comparison_chart(results, axis)] if chart is not None]
    summaries = [
        {'name': printable(name), 'place': place,
         'source': printable(' '.join(filter(None, (result.source.path, result.source.topic)))),
         'facts': _facts(result)}
        for place, (name, result) in enumerate(results.items())]
    return _page('comparison.html.j2', charts, title='Allan deviation compared',
                 summaries=summaries, differences=[_difference_row(d) for d in differences],
                 version=__version__)


def _page(template: str, charts: list[dict[str, Any]], **context: Any) -> str:
    from markupsafe import Markup
    from plotly.offline import get_plotlyjs  # type: ignore[import-untyped]

    library = get_plotlyjs()
    program = _text('report.js')
    # In a script element only "</" and "<!--" mean anything to the HTML parser.
    data = json.dumps(charts, allow_nan=False, separators=(',', ':')).replace('<', '\\u003c')
    hashes = ' '.join(f"'sha256-{b64encode(sha256(script.encode()).digest()).decode()}'"
                      for script in (library, program))
    return _environment().get_template(template).render(
        style=Markup(_text('report.css')), library=Markup(library), program=Markup(program),
        data=Markup(data), hashes=hashes, charts=charts, **context)


def _environment() -> 'Environment':
    from jinja2 import DictLoader, Environment, StrictUndefined

    names = ('page.html.j2', 'report.html.j2', 'comparison.html.j2')
    return Environment(loader=DictLoader({name: _text(name) for name in names}), autoescape=True,
                       undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)


def _text(name: str) -> str:
    # Style and program are not templates; the name says only that they are parts of one.
    stored = name if name.endswith('.j2') else f'{name}.j2'
    return (files('imu_allan.writers') / 'templates' / stored).read_text(encoding='utf-8')


def _facts(result: Result) -> list[str]:
    source, timeline = result.source, result.timeline
    rate = '' if timeline.sample_rate_hz is None else f' at {timeline.sample_rate_hz:.6g} Hz'
    facts = [f'{timeline.samples:,} samples{rate}', duration(timeline.duration_s)]
    if source.frame_id:
        facts.append(f'frame {printable(source.frame_id)}')
    if source.start_time:
        facts.append(f'from {printable(source.start_time)}')
    if source.clock:
        facts.append(f'{source.clock} stamps')
    counts = {'missing': timeline.missing, 'duplicate': timeline.duplicates,
              'out of order': timeline.out_of_order, 'rejected': timeline.rejected}
    facts += [f'{count:,} {name}' for name, count in counts.items() if count]
    return facts


@dataclass(frozen=True)
class _Cell:
    """A coefficient as the table shows it, in both units."""

    value: str
    interval: str
    si_value: str
    si_interval: str
    exact: str
    note: str


def _table(result: Result, sensor: str) -> dict[str, Any]:
    axes = axes_of(result, sensor)
    quantity = AXES[next(iter(axes))]
    rows = []
    for key, term in TERMS.items():
        unit = term.unit(quantity)
        rows.append({
            'symbol': term.symbol, 'name': term.name(quantity), 'key': key,
            'unit': typeset(engineering(1.0, unit)[1]), 'si_unit': typeset(unit),
            'shown': any(axis.coefficients[key].observable for axis in axes.values()),
            'cells': [_cell(axis.coefficients[key]) for axis in axes.values()]})
    unit = 'deg/s' if sensor == 'gyro' else 'm/s^2'
    means = [None if axis.mean is None else number(convert(axis.mean, axis.unit, unit))
             for axis in axes.values()]
    return {'title': _SENSORS[sensor], 'axes': [name[-1] for name in axes], 'rows': rows,
            'means': means if any(means) else [], 'mean_unit': typeset(unit)}


def _cell(coefficient: Coefficient) -> _Cell:
    if coefficient.value is not None and coefficient.ci95 is not None:
        numbers = (coefficient.value, *coefficient.ci95)
        value, low, high = (number(engineering(n, coefficient.unit)[0]) for n in numbers)
        si_value, si_low, si_high = (f'{n:.4g}' for n in numbers)
        return _Cell(value, f'{low} – {high}', si_value, f'{si_low} – {si_high}',
                     repr(coefficient.value), _wait(coefficient.ci_halves_in_s,
                                                    'halves'))
    if coefficient.upper95 is None:
        return _Cell('', 'not observable', '', 'not observable', '', '')
    bound = number(engineering(coefficient.upper95, coefficient.unit)[0])
    return _Cell('', f'not observable, below {bound}', '',
                 f'not observable, below {coefficient.upper95:.4g}', '',
                 _wait(coefficient.observable_in_s, 'observable'))


def _wait(seconds: float | None, what: str) -> str:
    return '' if seconds is None else f'{what} with {duration(seconds)} more'


def _warnings(result: Result) -> list[list[str]]:
    """Return the warnings, those of one kind together."""
    kinds: dict[str, list[str]] = {}
    for warning in result.warnings:
        kinds.setdefault(warning.code, []).append(printable(warning.message))
    return list(kinds.values())


def _findings(result: Result) -> list[str]:
    """Say what was seen of the axes."""
    findings = []
    windows = [f'{_spoken(name)} {duration(axis.band_limit_s)}'
               for name, axis in result.axes.items() if axis.band_limit_s is not None]
    if windows:
        findings.append('Low-passed before it is sampled, with an effective window of: '
                        f'{", ".join(windows)}. Averaging times not far above it tell of the '
                        'filter and not of the sensor, and were left out of the fit.')
    tones = [f'{_spoken(name)} {_frequencies(axis)}'
             for name, axis in result.axes.items() if axis.tones]
    if tones:
        findings.append(f'Tones: {"; ".join(tones)}. They are vibration, mains or an idle tone '
                        'of a converter, not noise, and were left out of the fit.')
    for name, axis in result.axes.items():
        if axis.gauss_markov is not None:
            sigma, unit = engineering(axis.gauss_markov.sigma, axis.unit)
            findings.append(
                f'{_spoken(name)} has a correlated (Gauss-Markov) part of {number(sigma)} '
                f'{typeset(unit)} with a correlation time of '
                f'{duration(axis.gauss_markov.correlation_time_s)}.')
    unfit = [_spoken(name) for name, axis in result.axes.items()
             if not axis.goodness_of_fit.acceptable]
    if unfit:
        findings.append(f'No model of the five terms describes {", ".join(unfit)} well. Take '
                        'the coefficients there as a rough guide.')
    return findings


def _spoken(name: str) -> str:
    return name.replace('_', ' ')


def _frequencies(axis: AxisResult) -> str:
    shown_tones = ', '.join(
        f'{tone.frequency_hz:.4g} Hz ({number(engineering(tone.amplitude, axis.unit)[0])} '
        f'{typeset(engineering(1.0, axis.unit)[1])})' for tone in axis.tones[:6])
    return shown_tones + (f' and {len(axis.tones) - 6} more' if len(axis.tones) > 6 else '')


def _strip(result: Result) -> dict[str, Any]:
    """Positions of the timeline's parts in percent."""
    length = max(result.timeline.duration_s, 1e-9)

    def placed(spans: tuple[Span, ...]) -> list[tuple[str, str]]:
        return [(f'{100 * max(0.0, min(1.0, span.start_s / length)):.3f}',
                 f'{max(0.15, 100 * min(1.0, span.duration_s / length)):.3f}')
                for span in spans[:_LONGEST_LIST]]

    return {'duration': duration(result.timeline.duration_s),
            'gaps': placed(result.timeline.gaps), 'motion': placed(result.timeline.motion)}


def _spans(spans: tuple[Span, ...]) -> dict[str, Any]:
    return {'count': len(spans), 'total': duration(sum(span.duration_s for span in spans)),
            'rows': [(duration(span.start_s), duration(span.duration_s))
                     for span in spans[:_LONGEST_LIST]]}


def _configs(result: Result) -> list[dict[str, str]]:
    configs = []
    for consumer in CONSUMERS:
        try:
            config = export(result, consumer)
        except ImuAllanError as error:
            configs.append({'title': _CONSUMER_TITLES[consumer], 'name': '', 'text': str(error)})
        else:
            configs.append({'title': _CONSUMER_TITLES[consumer], 'name': config.name,
                            'text': config.text})
    return configs


def _fits(result: Result) -> list[dict[str, str]]:
    rows = []
    for name, axis in result.axes.items():
        fit = axis.goodness_of_fit
        rows.append({
            'axis': _spoken(name),
            'p': '' if fit.p_value is None else f'{fit.p_value:.3g}',
            'misfit': '' if fit.worst_relative_misfit is None
            else f'{100 * fit.worst_relative_misfit:.2g} %',
            'acceptable': 'yes' if fit.acceptable else 'no',
            'taus': str(len(axis.curve.tau_s))})
    return rows


def _difference_row(difference: Difference) -> dict[str, Any]:
    z = difference.in_intervals
    return {'axis': _spoken(difference.axis), 'symbol': TERMS[difference.key].symbol,
            'unit': typeset(engineering(1.0, difference.unit)[1]),
            'reference': shown(difference.coefficients[0]),
            'other': printable(difference.other), 'value': shown(difference.coefficients[1]),
            'ratio': '' if difference.ratio is None else f'{difference.ratio:.4g}',
            'difference': '' if z is None else f'{z:+.2f}', 'beyond': z is not None and abs(z) > 1}


def _allan_chart(result: Result, sensor: str) -> dict[str, Any]:
    axes = axes_of(result, sensor)
    traces: list[dict[str, Any]] = []
    for name, axis in axes.items():
        traces += _curve_traces(axis, name[-1], f'{name[-1]} axis')
        traces += _term_traces(axis, name[-1])
    unit = AXES[next(iter(axes))].unit
    return {
        'id': f'{sensor}-allan', 'title': f'{_SENSORS[sensor]}: Allan deviation',
        'x': 'averaging time τ [s]', 'y': f'Allan deviation of {_SAMPLE_NAMES[sensor]}',
        'units': _unit_choice(unit, 1), 'traces': traces,
        'groups': [_group(name[-1], f'{name[-1]} axis') for name in axes],
        'kinds': [{'kind': 'points', 'label': 'measured', 'on': True},
                  {'kind': 'band68', 'label': '68 % interval', 'on': True},
                  {'kind': 'band95', 'label': '95 % interval', 'on': True},
                  {'kind': 'model', 'label': 'fitted model', 'on': True},
                  {'kind': 'term', 'label': 'its terms', 'on': False},
                  {'kind': 'read', 'label': 'where it is read', 'on': False}]}


def _curve_traces(axis: AxisResult, group: str, label: str) -> list[dict[str, Any]]:
    curve = axis.curve
    low95, high95 = ([band[i] for band in curve.ci95] for i in range(2))
    low68, high68 = ([band[i] for band in curve.ci68] for i in range(2))
    return [
        {'kind': 'band95', 'group': group, 'x': curve.tau_s, 'low': low95, 'high': high95},
        {'kind': 'band68', 'group': group, 'x': curve.tau_s, 'low': low68, 'high': high68},
        {'kind': 'model', 'group': group, 'name': f'{label}, model', 'x': curve.tau_s,
         'y': curve.model_adev},
        {'kind': 'points', 'group': group, 'name': label, 'x': curve.tau_s, 'y': curve.adev,
         'low': low95, 'high': high95}]


def _term_traces(axis: AxisResult, group: str) -> list[dict[str, Any]]:
    traces: list[dict[str, Any]] = []
    if not axis.curve.tau_s:
        return traces
    ends = np.array([axis.curve.tau_s[0], axis.curve.tau_s[-1]])
    for key, value in coefficients_of(axis).items():
        term = TERMS[key]
        if value == 0:
            continue
        shown_value, unit = engineering(abs(value), axis.coefficients[key].unit)
        text = f'{group} {term.symbol} = {number(shown_value)} {typeset(unit)}'
        traces.append({'kind': 'term', 'group': group, 'name': f'{text}, slope {term.slope:+g}',
                       'x': ends.tolist(), 'y': term.adev(value, ends).tolist()})
        at = term.read_at if term.read_at is not None else sqrt(float(np.prod(ends)))
        note = f' × {FLICKER_FLOOR:.3f}' if term.read_at is None else f' at τ = {at:.4g} s'
        traces.append({'kind': 'read', 'group': group, 'name': text + note, 'x': [at],
                       'y': term.adev(value, [at]).tolist()})
    return traces


def _density_chart(result: Result, sensor: str) -> dict[str, Any]:
    axes = axes_of(result, sensor)
    rate, length = result.timeline.sample_rate_hz, result.timeline.duration_s
    traces: list[dict[str, Any]] = []
    for name, axis in axes.items():
        if axis.spectrum is not None:
            traces.append({'kind': 'measured', 'group': name[-1], 'name': f'{name[-1]} measured',
                           'x': axis.spectrum.frequency_hz, 'y': axis.spectrum.psd})
        if rate is not None and length > 0:
            frequency = np.geomspace(min(1 / length, rate / 4), rate / 2, 200)
            density = model_density(axis, frequency, rate)
            traces.append({'kind': 'model', 'group': name[-1], 'name': f'{name[-1]} axis, model',
                           'x': frequency.tolist(), 'y': density.tolist()})
            for tone in axis.tones[:20]:
                traces.append({'kind': 'tone', 'group': name[-1], 'x': [tone.frequency_hz] * 2,
                               'name': f'{name[-1]} tone at {tone.frequency_hz:.4g} Hz',
                               'y': [float(density.min()), float(density.max())]})
    unit = AXES[next(iter(axes))].unit
    kinds = [{'kind': 'model', 'label': 'fitted model', 'on': True},
             {'kind': 'tone', 'label': 'tones', 'on': True}]
    if any(trace['kind'] == 'measured' for trace in traces):
        kinds.insert(0, {'kind': 'measured', 'label': 'measured', 'on': True})
    return {'id': f'{sensor}-psd', 'title': f'{_SENSORS[sensor]}: power spectral density',
            'x': 'frequency [Hz]', 'y': 'two-sided PSD', 'units': _unit_choice(unit, 2),
            'traces': traces, 'kinds': kinds,
            'groups': [_group(name[-1], f'{name[-1]} axis') for name in axes]}


def _comparison_chart(results: Mapping[str, Result], axis: str) -> dict[str, Any] | None:
    colours = {theme: result_colours(len(results), theme) for theme in COLOURS}
    traces: list[dict[str, Any]] = []
    groups = []
    for place, (name, result) in enumerate(results.items()):
        if axis in result.axes:
            traces += _curve_traces(result.axes[axis], str(place), printable(name))
            groups.append({'group': str(place), 'label': printable(name), 'symbol': place,
                           'light': colours['light'][place], 'dark': colours['dark'][place]})
    if not traces:
        return None
    sensor = axis.partition('_')[0]
    return {'id': axis, 'title': _spoken(axis), 'x': 'averaging time τ [s]',
            'y': f'Allan deviation of {_SAMPLE_NAMES[sensor]}',
            'units': _unit_choice(AXES[axis].unit, 1), 'traces': traces, 'groups': groups,
            'kinds': [{'kind': 'points', 'label': 'measured', 'on': True},
                      {'kind': 'band68', 'label': '68 % interval', 'on': False},
                      {'kind': 'band95', 'label': '95 % interval', 'on': True},
                      {'kind': 'model', 'label': 'fitted model', 'on': True}]}


def _group(letter: str, label: str) -> dict[str, Any]:
    return {'group': letter, 'label': label, 'symbol': 'xyz'.index(letter),
            'light': COLOURS['light'][letter], 'dark': COLOURS['dark'][letter]}


def _unit_choice(unit: str, power: int) -> list[dict[str, Any]]:
    """Engineering unit first, then SI, each with the factor from SI."""
    factor, other = engineering(1.0, unit)

    def written(text: str) -> str:
        return f'({typeset(text)})²/Hz' if power == 2 else typeset(text)

    return [{'label': written(other), 'factor': factor**power},
            {'label': written(unit), 'factor': 1.0}]
