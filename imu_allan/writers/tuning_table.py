# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What a filter needs, as tables and words for the terminal: five ways to feed it."""

from collections.abc import Mapping
from dataclasses import dataclass

from imu_allan.errors import ImuAllanError
from imu_allan.noise import chi_square
from imu_allan.result import AxisResult, Result
from imu_allan.tuning.bounds import upper_bound
from imu_allan.tuning.forecast import DriftForecast, FORECAST_S, predicted_drift
from imu_allan.tuning.tune import assess, Bias, FilterTuning, optimum, tune
from imu_allan.tuning.uncertainty import spread_of_forecast
from imu_allan.wording import duration, listed, number, SENSORS, spoken
from imu_allan.writers.included import included
from imu_allan.writers.words import presented, says
import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

TUNED, MEASURED, TENFOLD, FULL = 'tuned', 'as measured', 'ten times K', 'full drift model'


@dataclass(frozen=True)
class Choice:
    """
    One way to feed a filter.

    Attributes
    ----------
    name : str
    tuning : FilterTuning or None
        None for the full drift model, which has more numbers than a row.
    bound : bool
        Whether K is an upper bound.
    nis, coast_ratio : float
        Expected.
    coast_sigma : float
        What the filter claims for the mean over the longest time without correction.

    """

    name: str
    tuning: FilterTuning | None
    bound: bool
    nis: float
    coast_ratio: float
    coast_sigma: float


def choices(axis: AxisResult, aiding_s: float, coast_s: float, bias: Bias = 'random_walk'
            ) -> list[Choice]:
    """
    Return the ways to feed a filter, with what each is expected to reach.

    Parameters
    ----------
    axis : AxisResult
        With a drift model.
    aiding_s, coast_s : float
        Time between two corrections, and the longest without.
    bias : {'random_walk', 'gauss_markov'}, optional
        What the filter takes its bias for.

    Returns
    -------
    list of Choice
        Tuned, conservative, as measured, ten times K, the full drift model.

    Raises
    ------
    ImuAllanError
        If the axis has no drift model or the times make no sense.

    """
    found = [_choice(TUNED, tune(axis, aiding_s, coast_s, bias)),
             _choice('conservative', tune(axis, aiding_s, coast_s, bias, conservative=True))]
    noise, walk = (coefficient.value if (coefficient := axis.coefficients[key]).observable
                   else upper_bound(axis, key) for key in ('noise_density', 'rate_random_walk'))
    if noise and walk:
        bound = not axis.coefficients['rate_random_walk'].observable
        for name, factor in ((MEASURED, 1.0), (TENFOLD, 10.0)):
            found.append(_choice(name, assess(axis, noise, factor * walk, aiding_s, coast_s),
                                 bound=bound))
    best = optimum(axis, aiding_s, coast_s)
    found.append(Choice(FULL, None, False, 1.0, 1.0, best[-1][2]))
    return found


def _choice(name: str, tuning: FilterTuning, *, bound: bool = False) -> Choice:
    return Choice(name, tuning, bound, tuning.nis, tuning.coast_ratio, tuning.consistency[-1][2])


def tuning_table(result: Result, aiding_s: float, coast_s: float, bias: Bias = 'random_walk'
                 ) -> Group:
    """
    Return a table for each sensor, of its axes that have a drift model.

    Raises
    ------
    ImuAllanError
        If no axis has one.

    """
    parts: list[RenderableType] = [Text(
        f'Numbers for a filter that is corrected every {duration(aiding_s)} and must do without '
        f'for {duration(coast_s)}:')]
    for title, axes in _by_sensor(known_axes(result)).items():
        axis = next(iter(axes.values()))
        noise, walk = (axis.coefficients[key].unit for key in ('noise_density',
                                                               'rate_random_walk'))
        # The rows of the coefficients have a walk whatever the filter takes its bias for.
        second = ('K', f'K {walk}') if bias == 'random_walk' else (
            'sigma, Tc', f'sigma {axis.unit}, K {walk}')
        parts.append(Text(f'\n{title}: N {noise}, {second[1]}, predicted {axis.unit}'))
        table = bare_table('', 'numbers', 'N', second[0], 'NIS', 'error', 'predicted')
        for name, axis in axes.items():
            for i, choice in enumerate(choices(axis, aiding_s, coast_s, bias)):
                table.add_row(name[-1] if i == 0 else '', *_cells(choice, bias))
        parts.append(table)
    parts.append(Text(
        f'NIS: mean squared innovation over what the filter predicts; error: squared error after '
        f'{duration(coast_s)} unaided over what it predicts. 1 is right, above 1 overconfident, '
        'far below 1 useless as a bound. Predicted: the error itself, one standard deviation.',
        'dim'))
    return Group(*parts)


def bare_table(*headings: str, texts: int = 2) -> Table:
    """Return a table without lines, to have room at 60 columns; `texts` columns are no numbers."""
    table = Table(box=None, padding=(0, 1, 0, 0), pad_edge=False)
    for place, heading in enumerate(headings):
        table.add_column(heading, justify='left' if place < texts else 'right',
                         overflow='fold')
    return table


def _by_sensor(axes: Mapping[str, AxisResult]) -> dict[str, dict[str, AxisResult]]:
    found = {title: {name: axis for name, axis in axes.items() if name.startswith(sensor)}
             for sensor, title in SENSORS.items()}
    return {title: those for title, those in found.items() if those}


def _cells(choice: Choice, bias: Bias) -> list[str]:
    tuning = choice.tuning
    claimed = number(choice.coast_sigma, 3)
    if tuning is None:
        return ['full model', '', '', '1', '1', claimed]
    if tuning.random_walk is not None:
        second = (('K ' if bias == 'gauss_markov' else '') + ('< ' if choice.bound else '')
                  + number(tuning.random_walk, 3))
    else:
        second = f'{number(tuning.sigma or 0.0, 3)}, {duration(tuning.correlation_time_s or 0.0)}'
    return [choice.name, number(tuning.noise_density, 3), second, f'{choice.nis:.3g}',
            f'{choice.coast_ratio:.3g}', claimed]


def known_axes(result: Result) -> dict[str, AxisResult]:
    """Return the axes with a drift model; ImuAllanError where there is none."""
    axes = {name: axis for name, axis in result.axes.items() if axis.drift_model is not None}
    if not axes:
        raise ImuAllanError('no axis of this result has a drift model (constant, too short, or '
                            'from an older version): analyze the recording again')
    return axes


def left_out_sentences(result: Result) -> list[str]:
    """Name the axes that have no numbers, and why where that is known."""
    why = {'constant': 'it is constant', 'dead': 'it stood still',
           'saturated': 'it is cut off at the end of its range', 'zeroed': 'it has a deadband'}
    return [f'{spoken(name)} is left out: '
            + ('a filter has taken out its slow part' if axis.high_passed_hz is not None
               else why[axis.fault] if axis.fault is not None
               else 'too short for a drift model, or from an older version') + '.'
            for name, axis in result.axes.items() if axis.drift_model is None]


def steadiness_sentences(result: Result, coast_s: float) -> list[str]:
    """
    Say how far another day may be from what is expected, and what changed within the recording.

    Parameters
    ----------
    result : Result
        With a drift model.
    coast_s : float
        The longest time without correction.

    """
    spans = []
    for title, axes in _by_sensor(known_axes(result)).items():
        spread = max(float(spread_of_forecast(axis, np.array([coast_s]))[0])
                     for axis in axes.values())
        by = float(np.exp(2 * chi_square.NORMAL95 * min(spread, 100.0)))
        # Factor on a squared error from which on nobody says that it is known.
        spans.append(f'{number(1 / by, 2)} to {number(by, 2)} times ({title.lower()})'
                     if by < 100.0 else f'any number of times ({title.lower()})')
    return [f'On another day the squared error after {duration(coast_s)} may be {listed(spans)} '
            'as large as here (95 %): sensors change, and a recording is short.',
            *(f'Not steady: {says(found)}.' for found in presented(result.warnings)
              if found.code == 'not_steady')]


def included_sentences(result: Result) -> list[str]:
    """Say what the tuned numbers and the drift have in them that the coefficients have not."""
    return [f'{sentence} The rows "{MEASURED}" and "{TENFOLD}" are without it.'
            for sentence in included(result.axes)]


def forecast_table(result: Result, calibration_s: float = 60.0) -> Group:
    """Return the predicted drift of every axis without correction."""
    table = bare_table('axis', 'off by', *map(duration, FORECAST_S))
    for name, axis in known_axes(result).items():
        forecast = predicted_drift(axis, FORECAST_S, calibration_s)
        gyro = forecast.position is None
        rows = [('heading, deg', forecast.integral, 180 / np.pi) if gyro else
                ('velocity, m/s', forecast.integral, 1.0)]
        if forecast.position is not None:
            rows.append(('position, m', forecast.position, 1.0))
        for i, (what, values, factor) in enumerate(rows):
            table.add_row(spoken(name) if i == 0 else '', what, *(
                _known_or_more(forecast, horizon, value * factor)
                for horizon, value in zip(FORECAST_S, values, strict=True)))
    return Group(
        Text('Drift after a time without correction, one standard deviation, the bias averaged '
             f'over {duration(calibration_s)} before:'), table)


def _known_or_more(forecast: DriftForecast, horizon: float, value: float) -> str:
    text = number(float(f'{value:.2g}'))
    return text if _is_known(forecast, horizon) else f'({text})'


def _is_known(forecast: DriftForecast, horizon: float) -> bool:
    return max(horizon, forecast.calibration_s) <= forecast.known_to_s * (1 + 1e-6)


def forecast_sentences(result: Result, calibration_s: float = 60.0) -> list[str]:
    """Say in plain words what the worst axis of each sensor does within a minute."""
    said = []
    for sensor, what, factor, unit in (('gyro', 'heading', 180 / np.pi, '\u00b0'),
                                       ('accel', 'position', 1.0, ' m')):
        forecasts = {name: predicted_drift(axis, (60.0,), calibration_s)
                     for name, axis in result.axes.items()
                     if name.startswith(sensor) and axis.drift_model is not None}
        known = [((forecast.position or forecast.integral)[0],
                  *(forecast.position_ci95 or forecast.integral_ci95)[0], name)
                 for name, forecast in forecasts.items() if _is_known(forecast, 60.0)]
        if known:
            value, low, high, name = max(known, key=lambda one: one[0])
            which = '' if len(known) == len(forecasts) else ' that is known'
            said.append(f'One minute without correction costs about {number(value * factor, 2)}'
                        f'{unit} of {what} ({number(low * factor, 2)} to '
                        f'{number(high * factor, 2)}{unit}; {name}, the worst axis{which}).')
        elif forecasts:
            said.append('This recording is too short to tell what one minute without correction '
                        f'costs of {what} (bias averaged over {duration(calibration_s)} before).')
    if any(axis.drift_model is not None
           and axis.drift_model.to_s < max(FORECAST_S[-1], calibration_s)
           for axis in result.axes.values()):
        said.append('Numbers in brackets are beyond what this recording knows, and widened.')
    return said
