# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What a filter needs, as tables for the terminal: four ways to feed it, side by side."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from imu_allan.errors import ImuAllanError
from imu_allan.result import AxisResult, Result
from imu_allan.sensor.units import engineering
from imu_allan.tuning.field_test import FieldTest
from imu_allan.tuning.forecast import DriftForecast, predicted_drift
from imu_allan.tuning.tune import assess, Bias, FilterTuning, optimum, tune
from imu_allan.tuning.verification import Excess, Verification
from imu_allan.wording import duration, number
import numpy as np
from rich.console import Group
from rich.table import Table
from rich.text import Text

TUNED, MEASURED, TENFOLD, FULL = 'tuned', 'as measured', 'ten times K', 'full drift model'
CONSERVATIVE = 'conservative'
_FORECAST_S = (1.0, 10.0, 60.0, 600.0, 3600.0)


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
             _choice(CONSERVATIVE, tune(axis, aiding_s, coast_s, bias, conservative=True))]
    n, k = (axis.coefficients.get(key) for key in ('noise_density', 'rate_random_walk'))
    noise = n and (n.value if n.observable else n.upper95)
    walk = k and (k.value if k.observable else k.upper95)
    if noise and walk and k is not None:
        for name, factor in ((MEASURED, 1.0), (TENFOLD, 10.0)):
            found.append(_choice(name, assess(axis, noise, factor * walk, aiding_s, coast_s),
                                 bound=not k.observable))
    best = optimum(axis, aiding_s, coast_s)
    found.append(Choice(FULL, None, False, 1.0, 1.0, best[-1][2]))
    return found


def _choice(name: str, tuning: FilterTuning, *, bound: bool = False) -> Choice:
    return Choice(name, tuning, bound, tuning.nis, tuning.coast_ratio, tuning.consistency[-1][2])


def tuning_table(result: Result, aiding_s: float, coast_s: float, bias: Bias = 'random_walk'
                 ) -> Table:
    """
    Return the table of every axis that has a drift model.

    Raises
    ------
    ImuAllanError
        If no axis has one.

    """
    axes = _known(result)
    table = Table(title=f'Numbers for a filter that is corrected every {duration(aiding_s)} and '
                  f'must do without for {duration(coast_s)}', title_justify='left')
    for heading in ('axis', 'numbers', 'N', 'K' if bias == 'random_walk' else 'sigma, Tc', 'NIS',
                    f'error over {duration(coast_s)}', f'claimed over {duration(coast_s)}'):
        table.add_column(heading, justify='left' if heading in ('axis', 'numbers') else 'right')
    for name, axis in axes.items():
        for i, choice in enumerate(choices(axis, aiding_s, coast_s, bias)):
            table.add_row(name if i == 0 else '', *_cells(choice, axis.unit),
                          end_section=choice.name == FULL)
    table.caption = ('SI units. NIS: mean squared innovation over what is claimed; error: squared '
                     'error without\ncorrection over what is claimed. 1 is right, above 1 '
                     'overconfident, far below 1 useless as a bound.')
    table.caption_justify = 'left'
    return table


def _cells(choice: Choice, unit: str) -> list[str]:
    tuning = choice.tuning
    claimed = f'{number(choice.coast_sigma, 3)} {unit}'
    if tuning is None:
        return [choice.name, '', '', '1', '1', claimed]
    if tuning.random_walk is not None:
        bias = ('< ' if choice.bound and choice.name == MEASURED else '') + number(
            tuning.random_walk)
    else:
        bias = f'{number(tuning.sigma or 0.0)}, {duration(tuning.correlation_time_s or 0.0)}'
    return [choice.name, number(tuning.noise_density), bias, f'{choice.nis:.3g}',
            f'{choice.coast_ratio:.3g}', claimed]


def _known(result: Result) -> dict[str, AxisResult]:
    axes = {name: axis for name, axis in result.axes.items() if axis.drift_model is not None}
    if not axes:
        raise ImuAllanError('no axis of this result has a drift model (constant, too short, or '
                            'from an older version): analyze the recording again')
    return axes


def forecast_table(result: Result, calibration_s: float = 60.0) -> Table:
    """Return the predicted drift of every axis without correction."""
    table = Table(title='Drift without correction, the bias averaged over '
                  f'{duration(calibration_s)} before (one standard deviation)',
                  title_justify='left')
    table.add_column('axis')
    table.add_column('of')
    for horizon in _FORECAST_S:
        table.add_column(f'after {duration(horizon)}', justify='right')
    for name, axis in _known(result).items():
        forecast = predicted_drift(axis, _FORECAST_S, calibration_s)
        gyro = forecast.position is None
        rows = [('heading' if gyro else 'velocity', forecast.integral,
                 (180 / np.pi, '\u00b0') if gyro else (1.0, ' m/s'))]
        if forecast.position is not None:
            rows.append(('position', forecast.position, (1.0, ' m')))
        for i, (what, values, (factor, unit)) in enumerate(rows):
            table.add_row(name if i == 0 else '', what, *(
                _known_or_more(forecast, horizon, value * factor, unit)
                for horizon, value in zip(_FORECAST_S, values, strict=True)))
    return table


def _known_or_more(forecast: DriftForecast, horizon: float, value: float, unit: str) -> str:
    text = f'{number(value, 2)}{unit}'
    return text if horizon <= forecast.known_to_s * (1 + 1e-6) else f'({text})'


def forecast_sentences(result: Result, calibration_s: float = 60.0) -> list[str]:
    """Say in plain words what the worst axis of each sensor does within a minute."""
    said = []
    for sensor, what, factor, unit in (('gyro', 'heading', 180 / np.pi, '\u00b0'),
                                       ('accel', 'position', 1.0, ' m')):
        worst: tuple[float, float, float, str] | None = None
        for name, axis in result.axes.items():
            if not name.startswith(sensor) or axis.drift_model is None:
                continue
            forecast = predicted_drift(axis, (60.0,), calibration_s)
            values = forecast.position or forecast.integral
            bands = forecast.position_ci95 or forecast.integral_ci95
            if worst is None or values[0] > worst[0]:
                worst = (values[0], *bands[0], name)
        if worst is not None:
            value, low, high, name = worst
            said.append(f'One minute without correction costs about {number(value * factor, 2)}'
                        f'{unit} of {what} ({number(low * factor, 2)} to '
                        f'{number(high * factor, 2)}{unit}; {name}, the worst axis).')
    if any(axis.drift_model is not None and axis.drift_model.to_s < _FORECAST_S[-1]
           for axis in result.axes.values()):
        said.append('Numbers in brackets are beyond what this recording knows, and widened.')
    return said


def field_test_table(found: Mapping[str, FieldTest], other: str, units: Mapping[str, str]
                     ) -> Group:
    """
    Return what filters with the numbers of one recording met in another.

    Parameters
    ----------
    found : mapping of name to FieldTest
        Not empty.
    other : str
        Name of the other recording.
    units : mapping of name to str
        Of a sample of each axis.

    """
    first = next(iter(found.values()))
    parts = ('in one part' if first.stops == 1
             else f'in {first.stops} parts, in each of which the filter begins anew')
    table = Table('axis', 'numbers')
    intervals = [row.interval_s for row in first.full.innovations]
    horizons = [row.horizon_s for row in first.full.coasts]
    for interval in intervals:
        table.add_column(f'NIS {duration(interval)}', justify='right')
    for horizon in horizons:
        table.add_column(f'off after {duration(horizon)} (predicted)', justify='right')
    for name, one in found.items():
        for what, met in ((TUNED, one.tuned), (FULL, one.full)):
            factor, unit = engineering(1.0, units[name])
            table.add_row(
                name if what == TUNED else '', what,
                *(f'{row.nis:.3g}' for row in met.innovations),
                *(f'{number(row.observed_rms * factor, 3)} ({number(low * factor, 2)}-'
                  f'{number(high * factor, 2)}) {unit}'
                  for row, (low, high) in zip(met.coasts, met.bands, strict=True)),
                end_section=what == FULL)
    return Group(
        Text(f'Filters with these numbers, run over {duration(first.tested_s)} of rest in '
             f'{other}, {parts}', 'italic'), table,
        Text('NIS: mean squared innovation over what is claimed, of means over that time: 1 is '
             'right, above 1 overconfident. Off after: root mean square error of the mean over '
             'that time without correction; in brackets where 95 % of such errors should lie if '
             'the sensor were as the first recording has it.\n'))


def verification_table(found: Mapping[str, Verification], other: str, *, run: bool = False
                       ) -> Table:
    """
    Return how numbers from one recording hold in another.

    Parameters
    ----------
    found : mapping of name to Verification
        By axis.
    other : str
        Name of the other recording.
    run : bool, optional
        Whether filters were run over it, so that what its model expects needs no column.

    """
    table = Table(title=f'The tuned numbers held against {other}', title_justify='left')
    for heading in ('axis', *(() if run else ('NIS there', 'error there')), 'N times', 'K times',
                    'Allan deviation over prediction, by averaging time'):
        table.add_column(heading, justify='left' if heading == 'axis' else 'right')
    for name, one in found.items():
        bands = ', '.join(f'{_span(e)} {e.ratio:.2f} ({e.ci95[0]:.2f}-{e.ci95[1]:.2f})'
                          for e in one.excess)
        expected = () if run else (f'{one.met.nis:.3g}', f'{one.met.coast_ratio:.3g}')
        table.add_row(name, *expected, _factor(one.noise_factor, one.noise_ci95),
                      _factor(one.walk_factor, one.walk_ci95), bands)
    table.caption = ('N times, K times: the factor that would make the numbers right there, with '
                     'its 95 % interval.\nAbove 1 with motors or wheels running, it is what the '
                     'motion adds: put it into --inflate.' + (
                         '' if run else '\nThe models are compared; name the recording itself to '
                         'run filters over it.'))
    table.caption_justify = 'left'
    return table


def _span(excess: Excess) -> str:
    low, high = number(excess.from_s, 2), number(excess.to_s, 2)
    return f'{low} s' if low == high else f'{low}-{high} s'


def _factor(value: float, ci95: tuple[float, float]) -> str:
    return f'{value:.2f} ({ci95[0]:.2f}-{ci95[1]:.2f})'


def field_test_document(found: Mapping[str, FieldTest], against: Mapping[str, Verification]
                        ) -> dict[str, Any]:
    """Return the same as plain numbers, for JSON."""
    axes: dict[str, Any] = {}
    for name, one in against.items():
        axes[name] = {'noise_factor': one.noise_factor, 'noise_ci95': _finite(one.noise_ci95),
                      'walk_factor': one.walk_factor, 'walk_ci95': _finite(one.walk_ci95),
                      'excess': [asdict(excess) for excess in one.excess]}
        if name in found:
            test = found[name]
            axes[name] |= {'tested_s': test.tested_s, 'stops': test.stops,
                           'tuned': asdict(test.tuned), 'full': asdict(test.full)}
    return axes


def _finite(ends: tuple[float, float]) -> list[float | None]:
    return [end if np.isfinite(end) else None for end in ends]


def tuning_document(result: Result, aiding_s: float, coast_s: float, bias: Bias,
                    calibration_s: float = 60.0) -> dict[str, Any]:
    """Return the same as plain numbers, for JSON."""
    axes: dict[str, Any] = {}
    for name, axis in _known(result).items():
        forecast = predicted_drift(axis, _FORECAST_S, calibration_s)
        axes[name] = {'choices': [_plain(choice) for choice in
                                  choices(axis, aiding_s, coast_s, bias)],
                      'forecast': {'calibration_s': forecast.calibration_s,
                                   'horizons_s': list(forecast.horizons_s),
                                   'integral': list(forecast.integral),
                                   'integral_ci95': _lists(forecast.integral_ci95),
                                   'position': forecast.position and list(forecast.position),
                                   'position_ci95': forecast.position_ci95 and _lists(
                                       forecast.position_ci95),
                                   'known_to_s': forecast.known_to_s}}
    return {'aiding_interval_s': aiding_s, 'coast_s': coast_s, 'bias': bias, 'axes': axes}


def _lists(pairs: Iterable[tuple[float, float]]) -> list[list[float]]:
    return [list(pair) for pair in pairs]


def _plain(choice: Choice) -> dict[str, Any]:
    line: dict[str, Any] = {'numbers': choice.name, 'nis': choice.nis,
                            'coast_ratio': choice.coast_ratio, 'coast_sigma': choice.coast_sigma}
    if choice.tuning is not None:
        tuning = choice.tuning
        line.update(noise_density=tuning.noise_density, random_walk=tuning.random_walk,
                    sigma=tuning.sigma, correlation_time_s=tuning.correlation_time_s,
                    consistency=[list(row) for row in tuning.consistency])
    return line
