# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The report: one HTML file, written in one module because its two pages share their parts.

It shows everything and needs nothing else. The answer comes first, then the pictures, then the
tables, then how it was computed. Style, program and pictures are inside the file. Its own security
policy forbids every request and every script but the one it was written with, so that a report
opened years later, offline, or mailed by a stranger shows what it showed on the first day and no
more.
"""

from base64 import b64encode
from collections.abc import Mapping, Sequence
from hashlib import sha256
from importlib.resources import files
import re
from typing import Any

from imu_allan import wording
from imu_allan.errors import ImuAllanError, printable
from imu_allan.noise.terms import AXES, TERMS
from imu_allan.result import AxisResult, Coefficient, Result, Segment, Span
from imu_allan.sensor.units import engineering, MEAN_UNITS, typeset
from imu_allan.version import __version__
from imu_allan.writers.answer import (
    AIDING_S,
    Answer,
    answers,
    CALIBRATION_S,
    COAST_S,
    Figure,
    GOOD,
    outlook_of,
    UNCERTAIN,
    written_mean,
)
from imu_allan.writers.charts.allan import allan_chart, comparison_chart
from imu_allan.writers.charts.chart import Chart
from imu_allan.writers.charts.drift import drift_chart
from imu_allan.writers.charts.over_time import segment_chart, signal_chart
from imu_allan.writers.charts.spectrum import density_chart
from imu_allan.writers.comparison import compare, Difference, shown, verdicts
from imu_allan.writers.curves import axes_of, sensors_of, told
from imu_allan.writers.filters import CONSUMERS, export
from imu_allan.writers.verdict import findings_line, verdict_lines
from imu_allan.writers.words import message_of, presented, title_of

_UNIT = re.compile(r'(?<=\d )[A-Za-z][\w/^()*]*')
"""What follows a number in a sentence: a unit, or a word that `typeset` leaves as it is."""


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
        An HTML document of a few hundred kilobytes, most of it pictures.

    """
    found = answers(result)
    remarks = [{'title': title_of(one), 'severity': one.severity,
                'text': _typeset(message_of(one))} for one in presented(result.warnings)]
    constant = [name for name in AXES if name in result.axes and result.axes[name].constant]
    return _page(
        'report.html.j2', title=' '.join(wording.names_of(result)), names=wording.names_of(result),
        verdict=[_typeset(line) for line in verdict_lines(result)],
        facts=_facts(result), version=printable(result.imu_allan_version),
        cards=[_card(answer) for answer in found], remarks=remarks,
        remark_count=findings_line(result),
        allan=[chart for answer in found for chart in [allan_chart(
            answer.sensor, axes_of(result, answer.sensor), result.timeline)] if chart is not None],
        charts=[chart for kind in zip(*(_charts(result, answer) for answer in found), strict=True)
                for chart in kind if chart is not None],
        rest=wording.duration(result.timeline.rest_s),
        constant=wording.named(constant) if constant else '',
        tables=[_table(result, sensor) for sensor in sensors_of(result)],
        outlook=outlook_of(result),
        tunings=[row for answer in found for row in _tunings(result, answer)],
        segments=[table for sensor in sensors_of(result)
                  for table in [_segments(axes_of(result, sensor))] if table is not None],
        aiding=f'{AIDING_S:g} s', coast=wording.duration(COAST_S),
        calibration=wording.duration(CALIBRATION_S),
        uncertain=UNCERTAIN, gaps=_spans(result.timeline.gaps),
        motion=_spans(result.timeline.motion), configs=_configs(result), fits=_fits(result))


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
    named_results = {printable(name): result for name, result in results.items()}
    charts = [chart for axis in AXES
              for chart in [comparison_chart(named_results, axis)] if chart is not None]
    summaries = [
        {'name': name, 'place': place, 'source': ' '.join(wording.names_of(result)),
         'facts': _facts(result)}
        for place, (name, result) in enumerate(named_results.items())]
    return _page('comparison.html.j2', verdicts=verdicts(differences), charts=charts,
                 title='Allan deviation compared', summaries=summaries,
                 differences=[_difference_row(d) for d in differences], version=__version__)


def _page(template: str, **context: Any) -> str:
    from jinja2 import DictLoader, Environment, StrictUndefined
    from markupsafe import Markup

    folder = files('imu_allan.writers') / 'templates'
    texts = {name: (folder / f'{name}.j2').read_text(encoding='utf-8') for name in (
        'page.html', 'report.html', 'comparison.html', 'report.css', 'report.js')}
    # Style and program are not templates; the name says only that they are parts of one.
    style, program = texts['report.css'], texts['report.js']
    digest = b64encode(sha256(program.encode()).digest()).decode()
    environment = Environment(
        loader=DictLoader({f'{name}.j2': text for name, text in texts.items()}), autoescape=True,
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    return environment.get_template(template).render(
        style=Markup(style), program=Markup(program), hashes=f"'sha256-{digest}'", **context)


def _facts(result: Result) -> list[str]:
    return [wording.amount_of(result.timeline), *wording.origin_of(result),
            *wording.faults_of(result.timeline)]


def _typeset(sentence: str) -> str:
    return _UNIT.sub(lambda match: typeset(match[0]), sentence)


def _card(answer: Answer) -> dict[str, Any]:
    """Say of one sensor what the first screen says."""
    quantity = AXES[f'{answer.sensor}_x']
    tuned = answer.tuned
    return {
        'title': answer.title, 'word': answer.word, 'good': answer.word in GOOD,
        'rows': [_card_row(figure, TERMS[key].name(quantity)) for key, figure in (
            ('noise_density', answer.noise), ('rate_random_walk', answer.drift))
            if figure is not None],
        'tuned': [] if tuned is None else [
            ('N', tuned.noise_density, typeset(tuned.units[0])),
            ('K', tuned.random_walk, typeset(tuned.units[1]))],
        'forecast': answer.forecast.replace(' deg', '°'),
        'between': answer.forecast_interval.replace(' .. ', ' – ').replace(' deg', '°'),
        'extrapolated': answer.extrapolated,
        'sensor': 'gyroscope' if answer.sensor == 'gyro' else 'accelerometer'}


def _card_row(figure: Figure, name: str) -> dict[str, Any]:
    cell, unit = _cell(figure.coefficient), figure.coefficient.unit
    return {**cell, 'symbol': figure.coefficient.symbol, 'name': name, 'axis': figure.axis,
            'word': figure.word, 'good': figure.word in GOOD,
            'unit': typeset(engineering(1.0, unit)[1]), 'si_unit': typeset(unit)}


def _charts(result: Result, answer: Answer) -> list[Chart | None]:
    """Return all charts of a sensor but the first, in the order of the page."""
    axes = axes_of(result, answer.sensor)
    tunings = {} if answer.tuned is None else answer.tuned.tunings
    return [signal_chart(result, answer.sensor, axes),
            density_chart(answer.sensor, axes, result.timeline),
            drift_chart(answer.sensor, axes, tunings), segment_chart(answer.sensor, axes)]


def _table(result: Result, sensor: str) -> dict[str, Any]:
    axes = axes_of(result, sensor)
    quantity = AXES[next(iter(axes))]
    rows = []
    dead = all(axis.constant for axis in axes.values())
    for key, term in TERMS.items():
        if dead:
            break
        unit = term.unit(quantity)
        rows.append({
            'symbol': term.symbol, 'name': term.name(quantity), 'key': key,
            'unit': typeset(engineering(1.0, unit)[1]), 'si_unit': typeset(unit),
            'shown': any(axis.coefficients[key].observable for axis in axes.values()),
            'cells': [_cell(axis.coefficients[key]) for axis in axes.values()]})
    unit = MEAN_UNITS[quantity.unit]
    means = [None if axis.mean is None else tuple(
        written_mean(axis, axis.mean, result.timeline.rest_s, shown)[0]
        for shown in (unit, axis.unit)) for axis in axes.values()]
    return {'title': wording.SENSORS[sensor], 'axes': [name[-1] for name in axes], 'rows': rows,
            'means': means if any(means) else [], 'mean_unit': typeset(unit),
            'mean_si_unit': typeset(quantity.unit), 'dead': dead}


def _cell(coefficient: Coefficient) -> dict[str, str]:
    """Return a coefficient in both units: value and interval, or its bound."""
    cell = {}
    for unit, si in (('', False), ('si_', True)):
        value, *ends = told(coefficient, si=si) or ('not observable',)
        cell[f'{unit}value'], cell[f'{unit}interval'] = value, ' – '.join(ends)
    return {**cell, 'exact': '' if coefficient.value is None else repr(coefficient.value)}


def _tunings(result: Result, answer: Answer) -> list[dict[str, str]]:
    """Say for every axis what the tuned numbers are, and what a filter with them reaches."""
    if answer.tuned is None:
        return []
    rows = []
    for name, tuning in answer.tuned.tunings.items():
        coefficients = result.axes[name].coefficients
        backtest = result.axes[name].backtest
        rows.append({
            'axis': wording.spoken(name),
            'noise': f'{tuning.noise_density:#.3g}',
            'noise_unit': typeset(coefficients['noise_density'].unit),
            'walk': '' if tuning.random_walk is None else f'{tuning.random_walk:#.3g}',
            'walk_unit': typeset(coefficients['rate_random_walk'].unit),
            'nis': f'{tuning.nis:.2f}', 'coast': f'{tuning.coast_ratio:.2f}',
            'tested': '' if backtest is None or not backtest.innovations else ', '.join(
                f'{row.nis:.2f} at {wording.duration(row.interval_s)}'
                for row in backtest.innovations[:3])})
    return rows


def _segments(axes: Mapping[str, AxisResult]) -> dict[str, Any] | None:
    """Lay out what every part of the record has: noise density, mean, drift level."""
    known = {name: axis.stationarity for name, axis in axes.items()
             if axis.stationarity is not None and axis.stationarity.segments}
    if not known:
        return None
    axis = axes[next(iter(known))]
    n_unit = axis.coefficients['noise_density'].unit
    mean_unit = MEAN_UNITS[axis.unit]
    rows = []
    for name, stationarity in known.items():
        for place, segment in enumerate(stationarity.segments):
            density, interval, spread, drift, around = '', '', '', '', ''
            mean, *bounds = written_mean(axes[name], segment.mean, segment.duration_s, mean_unit)
            if segment.noise_density is not None and segment.ci95 is not None:
                spread = ' – '.join(bounds)
                density, *bounds = wording.measured(*(engineering(v, n_unit)[0] for v in (
                    segment.noise_density, *segment.ci95)))
                interval = ' – '.join(bounds)
            if segment.drift_sigma is not None:
                drift, around = _drift_of(segment, axis.unit)
            rows.append({
                'axis': wording.spoken(name) if not place else '',
                'start': wording.duration(segment.start_s),
                'mean': mean, 'spread': spread, 'density': density, 'interval': interval,
                'drift': drift, 'around': around})
    # Without the p-value: in a long record a change far too small to matter is significant.
    verdicts = [f'{wording.spoken(name)} {"steady" if s.steady else "not steady"}'
                for name, s in known.items()]
    return {'title': wording.SENSORS[next(iter(known)).partition('_')[0]], 'rows': rows,
            'verdict': ', '.join(verdicts), 'mean_unit': typeset(mean_unit),
            'unit': typeset(engineering(1.0, n_unit)[1]),
            'drift_unit': typeset(engineering(1.0, axis.unit)[1])}


def _drift_of(segment: Segment, unit: str) -> tuple[str, str]:
    """Say the level of the drift in a segment and its interval, or that none shows."""
    level = engineering(segment.drift_sigma or 0.0, unit)[0]
    if segment.drift_ci95 is None:
        return wording.number(level, 3), ''
    low, high = (engineering(value, unit)[0] for value in segment.drift_ci95)
    if low == 0:
        return f'< {wording.number(high, 2)}', ''
    value, *bounds = wording.measured(level, low, high)
    return value, ' – '.join(bounds)


def _spans(spans: Sequence[Span]) -> dict[str, Any]:
    # Rows: more nobody reads, and the page only grows; the result file has a thousand.
    return {'count': len(spans), 'total': wording.duration(sum(span.duration_s for span in spans)),
            'rows': [(wording.duration(span.start_s), wording.duration(span.duration_s))
                     for span in spans[:500]]}


def _configs(result: Result) -> list[dict[str, str]]:
    configs = []
    for consumer in CONSUMERS:
        title = CONSUMERS[consumer].title
        try:
            config = export(result, consumer)
        except ImuAllanError as error:
            configs.append({'key': consumer, 'title': title, 'name': '', 'text': str(error)})
        else:
            configs.append({'key': consumer, 'title': title, 'name': config.name,
                            'text': config.text})
    return configs


def _fits(result: Result) -> list[dict[str, str]]:
    rows = []
    for name, axis in result.axes.items():
        fit = axis.goodness_of_fit
        if axis.constant:
            continue
        rows.append({
            'axis': wording.spoken(name),
            'p': '' if fit.p_value is None else f'{fit.p_value:.3g}',
            'misfit': '' if fit.worst_relative_misfit is None
            else f'{100 * fit.worst_relative_misfit:.2g} %',
            'acceptable': 'yes' if fit.acceptable else 'no',
            'taus': wording.counted(len(axis.curve.tau_s), 'octave')})
    return rows


def _difference_row(difference: Difference) -> dict[str, Any]:
    z = difference.in_intervals
    return {'axis': wording.spoken(difference.axis), 'symbol': TERMS[difference.key].symbol,
            'unit': typeset(engineering(1.0, difference.unit)[1]),
            'reference': shown(difference.coefficients[0]),
            'other': printable(difference.other), 'value': shown(difference.coefficients[1]),
            'ratio': '' if difference.ratio is None else f'{difference.ratio:.4g}',
            'difference': '' if z is None else f'{z:+.2f}', 'beyond': z is not None and abs(z) > 1}
