# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What the numbers of one recording are worth in another, as tables for the terminal."""

from collections.abc import Mapping

from imu_allan.sensor.units import engineering
from imu_allan.tuning.field_test import FieldTest
from imu_allan.tuning.tune import Bias
from imu_allan.tuning.verification import Excess, Verification
from imu_allan.wording import duration, number, spoken
from imu_allan.writers.tuning_table import bare_table, FULL, TUNED
from rich.console import Group
from rich.text import Text


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
    table = bare_table('axis', 'numbers',
                       *(f'NIS {duration(row.interval_s)}' for row in first.full.innovations),
                       *(f'off after {duration(row.horizon_s)}' for row in first.full.coasts))
    for name, one in found.items():
        factor, unit = engineering(1.0, units[name])
        for what, met in ((TUNED, one.tuned), (FULL, one.full)):
            table.add_row(
                f'{spoken(name)}\n{unit}' if what == TUNED else '',
                'full model' if what == FULL else what,
                *(f'{row.nis:.3g}' for row in met.innovations),
                *(f'{number(row.observed_rms * factor, 3)}\n'
                  f'({number(low * factor, 2)}-{number(high * factor, 2)})'
                  for row, (low, high) in zip(met.coasts, met.bands, strict=True)))
    return Group(
        Text(f'Filters with these numbers, run over {duration(first.tested_s)} of rest in '
             f'{other}, {parts}:'), table,
        Text('NIS: mean squared innovation over what is predicted, of means over that time: 1 is '
             'right, above 1 overconfident. Off after: root mean square error of the mean over '
             'that time unaided; in brackets where 95 % of such errors should lie if '
             'the sensor were as the first recording has it.', 'dim'))


def verification_table(found: Mapping[str, Verification], other: str,
                       bias: Bias = 'random_walk', *, run: bool = False) -> Group:
    """
    Return how numbers from one recording hold in another.

    Parameters
    ----------
    found : mapping of name to Verification
        By axis.
    other : str
        Name of the other recording.
    bias : {'random_walk', 'gauss_markov'}, optional
        What the filter takes its bias for.
    run : bool, optional
        Whether filters were run over it, so that what its model expects needs no column.

    """
    spans = list(dict.fromkeys(_span(e) for one in found.values() for e in one.excess))
    second = 'K' if bias == 'random_walk' else 'sigma'
    table = bare_table('axis', *(() if run else ('NIS', 'error')), 'N times', f'{second} times',
                       *spans, texts=1)
    for name, one in found.items():
        bands = {_span(e): f'{e.ratio:.2f}\n{e.ci95[0]:.2f}-{e.ci95[1]:.2f}' for e in one.excess}
        expected = () if run else (f'{one.met.nis:.3g}', f'{one.met.coast_ratio:.3g}')
        table.add_row(spoken(name), *expected, _factor(one.noise_factor, one.noise_ci95),
                      _factor(one.walk_factor, one.walk_ci95),
                      *(bands.get(span, '') for span in spans))
    return Group(
        Text(f'The tuned numbers held against {other}:'), table,
        Text(f'N times, {second} times: the factor that would make the numbers right there, with '
             'its 95 % interval. Above 1 with motors or wheels running, it is what the motion '
             'adds: put it into --inflate. By averaging time: Allan deviation there over the one '
             'predicted.'
             + ('' if run else ' The models are compared; name the recording itself to run '
                'filters over it.'), 'dim'))


def _span(excess: Excess) -> str:
    low, high = number(excess.from_s, 2), number(excess.to_s, 2)
    return f'{low} s' if low == high else f'{low}-{high} s'


def _factor(value: float, ci95: tuple[float, float]) -> str:
    return f'{value:.2f}\n{ci95[0]:.2f}-{ci95[1]:.2f}'
