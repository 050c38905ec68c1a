# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Repeat the study of the term paper "Allan variance" (Instituto Balseiro), with intervals and units.

    python examples/allan_variance_study/study.py --output study_output

simulates the five terms of its Table 2 one by one and together and the two gyroscopes whose
datasheets it quotes, draws its figures 1 to 11, and prints what theory says beside what the
estimator finds. Then it compares the measurements of its section 4 with the datasheet again, in
one unit. Everything takes about half a minute. docs/allan_variance_study.md is its text.
"""

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import imu_allan
from imu_allan.datasheet import check
from imu_allan.noise.terms import Quantity, TERMS
from imu_allan.result import AxisResult, Result, Source, Spectrum, Timeline
from imu_allan.sensor.noise_model import load_model, parse_model
from imu_allan.sensor.units import convert, engineering, parse, typeset
from imu_allan.wording import number
from imu_allan.writers.atomic import write_atomically
from imu_allan.writers.curves import density_limits, limits_of
from imu_allan.writers.panels import (
    COLOURS,
    draw_curve,
    draw_density,
    draw_terms,
    empty_figure,
    frame,
    plot_style,
)
from imu_allan.writers.plot import render
import numpy as np
import scipy.signal

CONFIG = Path(__file__).resolve().parents[2] / 'config'
RATE_HZ = 100.0
HOURS = 2.0
GYRO = Quantity.ANGULAR_VELOCITY
# IEEE's letters, which imu_allan uses, with the paper's in brackets where they differ.
SYMBOLS = {'quantization_noise': 'Q (Qz)', 'noise_density': 'N (Q)', 'bias_instability': 'B',
           'rate_random_walk': 'K', 'rate_ramp': 'R'}

# Table 3 of the paper: a 3DM-GX3-35 at rest.
MEASURED = {'noise_density': ('deg/sqrt(h)', {'x': 1.4, 'y': 1.17, 'z': 1.33}),
            'bias_instability': ('deg/h', {'x': 30.75, 'y': 23.34, 'z': 18.81})}


def table2() -> dict[str, float]:
    """Return the coefficients of the paper's Table 2 in SI units."""
    return dict(load_model(CONFIG / 'allan_variance_table2.yaml').axes['gyro_x'])


def characterized(coefficients: Mapping[str, float], hours: float, seed: int) -> AxisResult:
    """Simulate one axis and characterize it."""
    samples = imu_allan.simulate(dict(coefficients), round(hours * 3600 * RATE_HZ), RATE_HZ, seed)
    axis = imu_allan.characterize(samples, RATE_HZ, GYRO.value)
    return replace(axis, spectrum=periodogram(samples))


def periodogram(samples: np.ndarray) -> Spectrum:
    """Return the two-sided power spectral density of the whole record, in sixths of octaves."""
    frequency, power = scipy.signal.periodogram(samples, RATE_HZ, 'hann', detrend='constant',
                                                return_onesided=False)
    keep = slice(2, len(samples) // 2)
    band = np.floor(6 * np.log2(frequency[keep])).astype(int)
    band -= band.min()
    count = np.bincount(band)
    filled = count > 0
    mean = [np.bincount(band, values)[filled] / count[filled]
            for values in (frequency[keep], power[keep])]
    return Spectrum(tuple(mean[0].tolist()), tuple(mean[1].tolist()))


def pure_ramp(rate: float, hours: float) -> AxisResult:
    """Return the curve of a ramp alone: without noise it is exact and has no interval."""
    axis = characterized({'rate_ramp': rate}, hours, 0)
    adev = tuple(TERMS['rate_ramp'].adev(rate, axis.curve.tau_s).tolist())
    none = tuple((value, value) for value in axis.curve.adev)
    hidden = {key: replace(coefficient, observable=False, value=None, ci95=None)
              for key, coefficient in axis.coefficients.items()}
    return replace(axis, tones=(), coefficients=hidden,
                   curve=replace(axis.curve, ci68=none, ci95=none, model_adev=adev))


def draw_pair(title: str, axis: AxisResult, truth: Mapping[str, float], hours: float) -> bytes:
    """Draw the PSD and the Allan deviation side by side, as the paper does."""
    with plot_style():
        figure = empty_figure(13.0, 4.9)
        grid = figure.add_gridspec(1, 2, left=0.075, right=0.93, top=0.86, bottom=0.13,
                                   wspace=0.42)
        density, allan = (figure.add_subplot(grid[0, column]) for column in range(2))
        timeline = Timeline(RATE_HZ, round(hours * 3600 * RATE_HZ), hours * 3600)
        draw_density(density, axis, timeline, COLOURS['z'])
        frame(density, 'gyro', density_limits([axis], timeline), of_spectrum=True)
        density.set_title('(a) power spectral density: measured, model', loc='left')
        draw_allan(allan, axis, truth)
        allan.set_title('(b) Allan deviation: measured, model, theory', loc='left')
        figure.text(0.012, 0.96, title, fontsize=12, fontweight='bold', va='center')
        return render(figure, 'png', 110)


def draw_lines(title: str, axis: AxisResult, truth: Mapping[str, float]) -> bytes:
    """Draw the Allan deviation alone, larger, with the characteristic lines."""
    with plot_style():
        figure = empty_figure(9.0, 6.2)
        allan = figure.add_axes((0.11, 0.1, 0.78, 0.79))
        draw_allan(allan, axis, truth)
        figure.text(0.015, 0.965, title, fontsize=12, fontweight='bold', va='center')
        return render(figure, 'png', 110)


def draw_allan(panel, axis: AxisResult, truth: Mapping[str, float]) -> None:
    """Draw the curve over the lines of the true coefficients."""
    frame(panel, 'gyro', limits_of([axis], rings=True))
    draw_curve(panel, axis, COLOURS['z'], 'o')
    draw_terms(panel, replace(axis, gauss_markov=None, power_law=None, coefficients={
        key: replace(found, observable=key in truth, value=truth.get(key))
        for key, found in axis.coefficients.items()}))


def estimate_row(key: str, what: str, truth: float, axis: AxisResult) -> list[str]:
    """Return a row of the table: theory against estimate, in the paper's unit."""
    coefficient = axis.coefficients[key]

    def shown(value: float) -> str:
        return number(engineering(value, coefficient.unit)[0])

    row = [what, SYMBOLS[key], typeset(engineering(1.0, coefficient.unit)[1]),
           shown(truth)]
    if coefficient.value is None or coefficient.ci95 is None:
        bound = '' if coefficient.upper95 is None else f'below {shown(coefficient.upper95)}'
        return [*row, 'not observable', bound, '']
    low, high = coefficient.ci95
    return [*row, shown(coefficient.value), f'{shown(low)} … {shown(high)}',
            f'{100 * (coefficient.value / truth - 1):+.2f} %']


def section_4() -> list[list[str]]:
    """Return the paper's measurements and its datasheet in one unit."""
    datasheet = load_model(CONFIG / 'allan_variance_mems.yaml').axes['gyro_x']
    rows = []
    for key, (unit, values) in MEASURED.items():
        si = TERMS[key].unit(GYRO)
        limit = convert(datasheet[key], si, unit)
        for axis, value in values.items():
            ratio = value / limit
            rows.append([axis, SYMBOLS[key], typeset(unit), number(value),
                         number(limit), f'{ratio:.2f}',
                         'below the limit' if ratio <= 1 else 'above the limit'])
    return rows


def verdict_on_z(hours: float, seed: int) -> list[list[str]]:
    """Check a simulated sensor with the z axis's coefficients against the datasheet."""
    values = {key: parse(f'{axes["z"]} {unit}', TERMS[key].unit(GYRO))
              for key, (unit, axes) in MEASURED.items()}
    axis = characterized(values, hours, seed)
    samples = round(hours * 3600 * RATE_HZ)
    result = Result(imu_allan.__version__, Source('recording', None, None, None, None, None),
                    Timeline(RATE_HZ, samples, samples / RATE_HZ), {'gyro_z': axis})
    specification = parse_model('gyro: {z: {noise_density: 0.03 deg/s/sqrt(Hz), '
                                'bias_instability: 18 deg/h}}')
    rows = []
    for verdict in check(result, specification):
        unit = MEASURED[verdict.key][0]
        low, high = verdict.ci95 or (0.0, verdict.upper95 or 0.0)
        shown = [number(convert(value, verdict.unit, unit))
                 for value in (low, high, verdict.limit)]
        rows.append([SYMBOLS[verdict.key], typeset(unit),
                     f'{shown[0]} … {shown[1]}', shown[2], verdict.verdict])
    return rows


def markdown(heading: list[str], rows: list[list[str]]) -> str:
    """Return a table in Markdown."""
    lines = [heading, ['---'] * len(heading), *rows]
    return '\n'.join(f'| {" | ".join(cells)} |' for cells in lines) + '\n'


def run(output: Path, hours: float = HOURS, seed: int = 1) -> str:
    """
    Draw the figures into `output` and return the tables.

    Parameters
    ----------
    output : Path
        Folder for ``figure_01.png`` to ``figure_11.png`` and ``tables.md``.
    hours : float
        Length of each simulated record.
    seed : int
        Of the simulations.

    """
    truth = table2()
    figures: dict[int, bytes] = {}
    rows = []
    for place, (key, value) in enumerate(truth.items(), 1):
        name = TERMS[key].gyro_name
        axis = pure_ramp(value, hours) if key == 'rate_ramp' else \
            characterized({key: value}, hours, seed)
        figures[place] = draw_pair(f'Figure {place}: {name}', axis, {key: value}, hours)
        if key == 'rate_ramp':
            # A ramp without any noise has no interval: estimate it over the white noise.
            axis = characterized({key: value, 'noise_density': truth['noise_density']}, hours,
                                 seed)
        rows.append(estimate_row(key, 'with N' if key == 'rate_ramp' else 'alone', value, axis))
    together = characterized(truth, hours, seed)
    figures[6] = draw_pair('Figure 6: all five terms together', together, {}, hours)
    figures[7] = draw_lines('Figure 7: all five terms, with the characteristic lines', together,
                            truth)
    rows += [estimate_row(key, 'together', value, together) for key, value in truth.items()]
    for place, file, name in ((8, 'allan_variance_mems', 'MEMS'),
                              (10, 'allan_variance_ring_laser', 'RLG')):
        sheet = dict(load_model(CONFIG / f'{file}.yaml').axes['gyro_x'])
        axis = characterized(sheet, hours, seed)
        figures[place] = draw_pair(f'Figure {place}: the {name} gyroscope of the datasheet', axis,
                                   {}, hours)
        figures[place + 1] = draw_lines(
            f'Figure {place + 1}: the {name} gyroscope, with the characteristic lines', axis,
            sheet)
        rows += [estimate_row(key, name, value, axis) for key, value in sheet.items()]
    for place, content in figures.items():
        write_atomically(output / f'figure_{place:02d}.png', content)
    tables = '\n'.join((
        '### Theory and estimate\n',
        markdown(['record', 'coefficient', 'unit', 'theory', 'estimate', '95 % interval',
                  'difference'], rows),
        '### Section 4 in one unit\n',
        markdown(['axis', 'coefficient', 'unit', 'measured', 'datasheet', 'ratio', ''],
                 section_4()),
        '### What a recording of such a sensor could show\n',
        markdown(['coefficient', 'unit', '95 % interval', 'datasheet', 'verdict'],
                 verdict_on_z(hours, seed))))
    write_atomically(output / 'tables.md', tables.encode())
    return tables


def main() -> None:
    """Run the study from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n\n')[0])
    parser.add_argument('--output', type=Path, default=Path('study_output'), metavar='DIR')
    parser.add_argument('--hours', type=float, default=HOURS, metavar='H',
                        help='length of each record (default: %(default)g)')
    parser.add_argument('--seed', type=int, default=1, metavar='N')
    args = parser.parse_args()
    print(run(args.output, args.hours, args.seed))
    print(f'figures in {args.output}')


if __name__ == '__main__':
    main()
