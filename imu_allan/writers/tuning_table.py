# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Filter tuning as tables and text for the terminal, and as plain data for JSON.

There are four sets of filter numbers. Their performance in another recording comes last.
"""

from collections.abc import Mapping
from dataclasses import asdict
from itertools import groupby
from typing import Any

from imu_allan.errors import ImuAllanError
from imu_allan.finding_messages import (
    for_display,
    sensor_verdicts,
    sentence_of,
    trend_notes,
    why_left_out,
)
from imu_allan.noise import chi_square
from imu_allan.noise.terms import AXES
from imu_allan.noise.uncertainty import value_or_bound
from imu_allan.result import AxisResult, Interval, Result
from imu_allan.sensor.units import engineering
from imu_allan.tuning.backtest import FieldTest
from imu_allan.tuning.forecast import (
    FORECAST_S,
    known_less_than,
    predicted_drift,
    spread_of_forecast,
)
from imu_allan.tuning.tune import assess, Bias, tune
from imu_allan.wording import duration, listed, number, SENSORS, spoken
from imu_allan.writers.curves import by_sensor
from imu_allan.writers.key_figures import CALIBRATION_S, verdict_lines
from imu_allan.writers.terminal import bare_table
import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

TUNED, MEASURED, TENFOLD = 'tuned', 'as measured', 'ten times K'


def choices(axis: AxisResult, aiding_s: float, coast_s: float, bias: Bias) -> list[dict[str, Any]]:
    """
    Return the sets of numbers for a filter, with the expected performance of each, as for JSON.

    ``coast_sigma`` is the standard deviation that the filter predicts for the mean over the
    longest unaided time.
    """
    found = {TUNED: tune(axis, aiding_s, coast_s, bias),
             'conservative': tune(axis, aiding_s, coast_s, bias, conservative=True)}
    density, random_walk = (
        value_or_bound(axis, key) for key in ('noise_density', 'rate_random_walk'))
    if density and random_walk:
        found |= {name: assess(axis, density, factor * random_walk, aiding_s, coast_s)
                  for name, factor in ((MEASURED, 1.0), (TENFOLD, 10.0))}
    return [{'numbers': name, 'nis': tuning.nis, 'coast_ratio': tuning.coast_ratio,
             'coast_sigma': tuning.consistency[-1][2],
             **{key: value for key, value in asdict(tuning).items()
                if key not in ('aiding_interval_s', 'coast_s')}}
            for name, tuning in found.items()]


def tuning_table(result: Result, aiding_s: float, coast_s: float, bias: Bias) -> Group:
    """Return one table per sensor, with the axes that have a drift model."""
    # Numbers from a few seconds look like any others.
    parts: list[RenderableType] = [
        Text(line) for line, verdict in zip(
            verdict_lines(result), sensor_verdicts(result).values(), strict=True)
        if verdict.verdict == 'not_usable']
    parts.append(Text(
        f'Numbers for a filter that is corrected every {duration(aiding_s)} and unaided for '
        f'{duration(coast_s)}:'))
    if aiding_s * (rate_hz := result.timeline.sample_rate_hz or np.inf) < 1 - 1e-6:
        parts.append(Text(f'That is faster than the samples of this recording, {rate_hz:.6g} Hz: '
                          'noise between two of them is taken for white.'))
    for sensor, axes in by_sensor(known_axes(result)).items():
        axis = next(iter(axes.values()))
        noise, drift = (axis.coefficients[key].unit
                        for key in ('noise_density', 'rate_random_walk'))
        # The rows with measured coefficients give K even if the filter uses a Gauss-Markov bias.
        second = ('filter K', f'filter K {drift}') if bias == 'random_walk' else (
            'sigma, Tc', f'sigma {axis.unit}, K {drift}')
        parts.append(Text(f'\n{SENSORS[sensor]}: filter N {noise}, {second[1]}, '
                          f'predicted {axis.unit}'))
        table = bare_table('', 'numbers', 'filter N', second[0], 'NIS', 'error', 'predicted')
        for name, axis in axes.items():
            bound = not axis.coefficients['rate_random_walk'].observable
            for choice in choices(axis, aiding_s, coast_s, bias):
                table.add_row(name[-1] if choice['numbers'] == TUNED else '', *_cells(
                    choice, bias, bound=bound and choice['numbers'] in (MEASURED, TENFOLD)))
        parts.append(table)
    parts.append(Text(
        f'NIS: mean squared innovation over what the filter predicts; error: squared error after '
        f'{duration(coast_s)} unaided over what it predicts. 1 is right, above 1 overconfident, '
        'far below 1 useless as a bound. Predicted: the error itself, one standard deviation.',
        'dim'))
    return Group(*parts)


def _cells(choice: Mapping[str, Any], bias: Bias, *, bound: bool) -> list[str]:
    if choice['random_walk'] is None:
        second = f'{number(choice["sigma"], 3)}, {duration(choice["correlation_time_s"])}'
    else:
        second = (('K ' if bias == 'gauss_markov' else '') + ('< ' if bound else '')
                  + number(choice['random_walk'], 3))
    return [choice['numbers'], number(choice['noise_density'], 3), second, f'{choice["nis"]:.3g}',
            f'{choice["coast_ratio"]:.3g}', number(choice['coast_sigma'], 3)]


def known_axes(result: Result) -> dict[str, AxisResult]:
    """Return the axes with a drift model; raise ImuAllanError if there are none."""
    axes = {name: axis for name, axis in result.axes.items() if axis.drift_model is not None}
    if not axes:
        raise ImuAllanError(f'no axis of this result has a drift model. '
                            f'{" ".join(verdict_lines(result))} If it is from an older version, '
                            'analyze the recording again')
    return axes


def sentences(result: Result, coast_s: float) -> list[str]:
    """Return the notes below the tables: omitted axes, trends, and steadiness."""
    # The axes without numbers, and the reason if it is known.
    unknown = 'too short for a drift model, or from an older version'
    said = [f'{spoken(name)} is left out: {why_left_out(axis) or unknown}.'
            for name, axis in result.axes.items() if axis.drift_model is None]
    if known_less_than(result.axes, FORECAST_S[-1]) is not None:
        said.append('Numbers in brackets are beyond what this recording knows, and widened.')
    said += [*(f'{note}. The rows "{MEASURED}" and "{TENFOLD}" are without it.'
               for note in trend_notes(result)), *_steadiness(result, coast_s)]
    for time_s, what in ((coast_s, 'unaided'), (CALIBRATION_S, 'of averaging the bias')):
        if (known := known_less_than(result.axes, time_s)) is not None:
            said.append(f'{duration(time_s)} {what} is beyond what this recording knows '
                        f'({duration(known)}): the numbers are widened; record for '
                        f'{duration(3 * time_s)} to know.')
    return said


def _steadiness(result: Result, coast_s: float) -> list[str]:
    """Describe how much another day may differ, and what changed within the recording."""
    spans = []
    for sensor, axes in by_sensor(known_axes(result)).items():
        spread = max(float(spread_of_forecast(axis, np.array([coast_s]))[0])
                     for axis in axes.values())
        by = float(np.exp(2 * chi_square.NORMAL95 * min(spread, 100.0)))
        # Beyond this factor, a squared error counts as unknown.
        spans.append(f'{number(1 / by, 2)} to {number(by, 2)} times ({SENSORS[sensor].lower()})'
                     if by < 100.0 else f'any number of times ({SENSORS[sensor].lower()})')
    return [f'On another day the squared error after {duration(coast_s)} may be {listed(spans)} '
            'as large as here (95 %): sensors change, and a recording is short.',
            *(f'Not steady: {sentence_of(found)}.' for found in for_display(result.warnings)
              if found.code == 'not_steady')]


def forecast_table(result: Result) -> Group:
    """Return the predicted unaided drift of every axis."""
    table = bare_table('axis', 'off by', *map(duration, FORECAST_S))
    for name, axis in known_axes(result).items():
        forecast = predicted_drift(axis, FORECAST_S, CALIBRATION_S)
        rows = [('heading, deg', forecast.integral, 180 / np.pi)]
        if forecast.position is not None:
            rows = [('velocity, m/s', forecast.integral, 1.0),
                    ('position, m', forecast.position, 1.0)]
        known_s = forecast.known_to_s * (1 + 1e-6)
        for i, (what, values, factor) in enumerate(rows):
            shown = [number(float(f'{value * factor:.2g}')) for value in values]
            table.add_row(spoken(name) if i == 0 else '', what, *(
                text if max(horizon, CALIBRATION_S) <= known_s else f'({text})'
                for horizon, text in zip(FORECAST_S, shown, strict=True)))
    return Group(Text('Unaided drift, one standard deviation, the bias averaged over '
                      f'{duration(CALIBRATION_S)} before:'), table)


def field_test_table(found: Mapping[str, FieldTest], other: str, bias: Bias) -> Group:
    """Return tables of how filters with the numbers of one recording performed in another."""
    second = 'K' if bias == 'random_walk' else 'sigma'
    # Sensors of different rates, or of different times at rest, have tables of their own.
    tables = [part for _, same in groupby(found.items(), key=lambda item: _times_of(item[1]))
              for part in (Text(''), *_field_test_table(dict(same), other, second))]
    return Group(
        *tables[1:],
        Text('NIS: mean squared innovation over what is predicted, of means over that time: 1 is '
             'right, above 1 overconfident. Off after: root mean square error of the mean over '
             'that time unaided. In brackets: where 95 % of such errors should lie if '
             'the sensor were as the first recording has it.', 'dim'),
        Text(f'N, {second} times: the root of the first NIS, and the last error over the '
             'predicted one, with 95 % intervals. Above 1 with motors or wheels running, they '
             'are what the motion adds: put them into --inflate.', 'dim'))


def _times_of(one: FieldTest) -> tuple[float, ...]:
    return (one.tested_s, one.stops, *(row.interval_s for row in one.full.innovations),
            *(row.horizon_s for row in one.full.coasts))


def _field_test_table(found: Mapping[str, FieldTest], other: str, second: str
                      ) -> tuple[Text, RenderableType]:
    """Return heading and table of axes that were tested over the same times."""
    def factor_of(found: tuple[float, Interval]) -> str:
        value, (low, high) = found
        return f'{value:.3g}\n({number(low, 2)}-{number(high, 2)})'

    first = next(iter(found.values()))
    parts = ('in one part' if first.stops == 1
             else f'in {first.stops} parts, in each of which the filter begins anew')
    table = bare_table('axis', 'numbers',
                       *(f'NIS {duration(row.interval_s)}' for row in first.full.innovations),
                       *(f'off after {duration(row.horizon_s)}' for row in first.full.coasts))
    for name, one in found.items():
        factor, unit = engineering(1.0, AXES[name].unit)
        for what, met in ((TUNED, one.tuned), ('full model', one.full)):
            table.add_row(
                f'{spoken(name)}\n{unit}' if what == TUNED else '',
                what, *(f'{row.nis:.3g}' for row in met.innovations),
                *(f'{number(row.observed_rms * factor, 3)}\n'
                  f'({number(low * factor, 2)}-{number(high * factor, 2)})'
                  for row, (low, high) in zip(met.coasts, met.bands, strict=True)))
        cells = [''] * (len(one.tuned.innovations) + len(one.tuned.coasts))
        cells[0] = factor_of(one.noise_factor)
        if one.drift_factor is not None:
            cells[-1] = factor_of(one.drift_factor)
        table.add_row('', f'N, {second} times', *cells)
    return Text(f'Filters with these numbers, run over {duration(first.tested_s)} of rest in '
                f'{other}, {parts}:'), table


def tuning_document(result: Result, aiding_s: float, coast_s: float, bias: Bias) -> dict[str, Any]:
    """Return the content of the tables as plain data."""
    axes = {name: {'choices': choices(axis, aiding_s, coast_s, bias),
                   'forecast': asdict(predicted_drift(axis, FORECAST_S, CALIBRATION_S))}
            for name, axis in known_axes(result).items()}
    return {'schema': 'imu_allan.tuning/1', 'aiding_interval_s': aiding_s, 'coast_s': coast_s,
            'bias': bias, 'axes': axes}


def field_test_document(found: Mapping[str, FieldTest], bias: Bias) -> dict[str, Any]:
    """Return the content of the table on another recording as plain data."""
    second = 'random_walk' if bias == 'random_walk' else 'sigma'
    rows: dict[str, Any] = {}
    for name, one in found.items():
        factor, ci95 = one.noise_factor
        drift, drift_ci95 = one.drift_factor or (None, None)
        rows[name] = {'noise_factor': factor, 'noise_ci95': ci95, f'{second}_factor': drift,
                      f'{second}_ci95': drift_ci95, 'tested_s': one.tested_s, 'stops': one.stops,
                      'tuned': asdict(one.tuned), 'full': asdict(one.full)}
    return rows
