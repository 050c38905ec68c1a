# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""LaTeX output for a paper: a table, a paragraph on the method, and references."""

from imu_allan.noise.terms import AXES, TERMS
from imu_allan.result import Coefficient, Result
from imu_allan.sensor.units import engineering
from imu_allan.version import __version__
from imu_allan.wording import duration, listed, SENSORS
from imu_allan.writers.curves import axes_of, reported, sensors_of
from imu_allan.writers.pages import text_of

BIBLIOGRAPHY = text_of('imu_noise.bib')


def escaped(text: str) -> str:
    r"""
    Escape text so that LaTeX prints it literally.

    Examples
    --------
    >>> print(escaped('imu_link 5 %'))
    imu\_link 5 \%

    """
    special = {**{letter: f'\\{letter}' for letter in '&%$#_{}'}, '\\': r'\textbackslash{}',
               '~': r'\textasciitilde{}', '^': r'\textasciicircum{}'}
    return ''.join(special.get(letter, letter) for letter in text)


def noise_table(result: Result) -> str:
    """Return a table of the coefficients for LaTeX, and a paragraph on the method."""
    lines = ['% Needs \\usepackage{booktabs}; the references are in imu_noise.bib.',
             '\\begin{table}', '  \\centering', '  \\caption{Noise coefficients with their '
             '95\\,\\% intervals.}', '  \\label{tab:imu-noise}', '  \\begin{tabular}{llrrr}',
             '    \\toprule', '    Term & Unit & $x$ & $y$ & $z$ \\\\']
    units = {
        'deg': r'$^\circ$', 'deg/sqrt(h)': r'$^\circ/\sqrt{\mathrm{h}}$',
        'deg/h': r'$^\circ/\mathrm{h}$', 'deg/h/sqrt(h)': r'$^\circ/\mathrm{h}/\sqrt{\mathrm{h}}$',
        'deg/h^2': r'$^\circ/\mathrm{h}^2$', 'mm/s': r'$\mathrm{mm/s}$',
        'ug/sqrt(Hz)': r'$\mu\mathrm{g}/\sqrt{\mathrm{Hz}}$', 'ug': r'$\mu\mathrm{g}$',
        'ug/sqrt(h)': r'$\mu\mathrm{g}/\sqrt{\mathrm{h}}$', 'ug/h': r'$\mu\mathrm{g}/\mathrm{h}$'}
    for sensor in sensors_of(result):
        axes = axes_of(result, sensor)
        lines += ['    \\midrule', f'    \\multicolumn{{5}}{{l}}{{{SENSORS[sensor]}}} \\\\']
        for key, term in TERMS.items():
            quantity = AXES[f'{sensor}_x']
            cells = [axes.get(f'{sensor}_{letter}') for letter in 'xyz']
            if not any(axis is not None and axis.coefficients[key].observable for axis in cells):
                continue
            shown = ' & '.join('--' if axis is None else _cell(axis.coefficients[key])
                               for axis in cells)
            unit = units[engineering(1.0, term.unit(quantity))[1]]
            lines.append(f'    ${term.symbol}$ {term.name(quantity)} & {unit} & {shown} \\\\')
    lines += ['    \\bottomrule', '  \\end{tabular}', '\\end{table}', '', _methods(result)]
    return '\n'.join(lines) + '\n'


def _cell(coefficient: Coefficient) -> str:
    value, *ends = reported(coefficient) or ('--',)
    if ends:
        return f'{value} [{", ".join(ends)}]'
    return value if coefficient.upper95 is None else f'${value}$'


def _methods(result: Result) -> str:
    timeline = result.timeline
    rate = '' if timeline.sample_rate_hz is None else \
        f' at {timeline.sample_rate_hz:.6g}\\,Hz'
    left_out = sum(span.duration_s for span in timeline.motion)
    sentences = [
        f'The coefficients were estimated from {duration(timeline.duration_s)} of samples{rate} '
        'of the sensor at rest'
        + (f', of which {duration(left_out)} of motion were left out' if left_out else '') + '.',
        'Each sample is taken as the mean over its interval. '
        'Models of sums of the terms of IEEE Std~952~\\cite{ieee952} '
        'were weighed by their evidence in the spectrum of the samples. '
        'Values are posterior medians with 95\\,\\% intervals; a term that the data do not '
        'show is given as its 95\\,\\% upper bound.',
        'The overlapping Allan deviation~\\cite{riley2008} has chi-square intervals with the '
        'degrees of freedom of the fitted model~\\cite{greenhall1991}.']
    tones = [name for name, axis in result.axes.items() if axis.tones]
    if tones:
        sentences.append('Narrow lines in the spectrum of '
                         f'{escaped(listed(tones))} were left out of the fit.')
    sentences.append(f'Computed with imu\\_allan {escaped(__version__)}.')
    return '\n'.join(sentences)
