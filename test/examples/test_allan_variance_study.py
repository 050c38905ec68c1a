# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The study of docs/allan_variance_study.md: its command, its tables, its errata."""

import importlib.util
from math import log, pi
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import sici

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / 'docs' / 'allan_variance_study.md').read_text()


@pytest.fixture(scope='module')
def study():
    path = ROOT / 'examples' / 'allan_variance_study' / 'study.py'
    spec = importlib.util.spec_from_file_location('study', path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def rows_of(markdown, heading):
    part = markdown.partition(heading)[2]
    return [[cell.strip() for cell in line.strip('|').split('|')]
            for line in part.strip().split('\n\n')[0].splitlines()[2:]]


def test_the_command_draws_every_figure_and_finds_every_term(study, tmp_path):
    tables = study.run(tmp_path, hours=0.25, seed=3)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        *(f'figure_{place:02d}.png' for place in range(1, 12)), 'tables.md']
    rows = rows_of(tables, '### Theory and estimate')
    assert len(rows) == 14
    alone = [row for row in rows if row[0] in ('alone', 'with N')]
    for row in alone:
        low, high = (float(part) for part in row[5].split(' … '))
        # Four digits are shown, so the interval's ends are rounded.
        assert low * 0.995 <= float(row[3]) <= high * 1.005, row


def test_the_page_shows_what_the_command_prints(study):
    shown = [line for line in PAGE.splitlines() if line.startswith('|')]
    for line in study.markdown([], study.section_4()).splitlines()[2:]:
        assert line in shown
    mine = study.characterized(study.table2(), study.HOURS, 1)
    for key, value in study.table2().items():
        expected = study.estimate_row(key, 'together', value, mine)
        (row,) = (line for line in shown if line.startswith(
            f'| together | {study.SYMBOLS[key]} |'))
        cells = [cell.strip() for cell in row.strip('|').split('|')]
        assert cells[:4] == expected[:4]
        if cells[4] == expected[4] == 'not observable':
            assert float(cells[5].removeprefix('below ')) > float(cells[3])
            continue
        # The flicker of one seed is not the same with every version of SciPy.
        low, high = (float(part) for part in expected[5].split(' … '))
        assert low < float(cells[4]) < high


def allan_variance(spectrum, tau, low, high):
    """Equation (8) by quadrature."""
    return 4 * quad(lambda f: spectrum(f) * np.sin(pi * f * tau)**4 / (pi * f * tau)**2,
                    low, high, limit=2000)[0]


@pytest.mark.parametrize('x', [0.3, 1.0, 2.5])
def test_erratum_17_the_cosine_integrals_stand_outside_the_product(x):
    f0 = 1.0
    tau = x / (pi * f0)
    expected = allan_variance(lambda f: 1 / (2 * pi * f), tau, 0, f0)

    def ci(z):
        return sici(z)[1]

    corrected = 2 / pi * (log(2) - np.sin(x)**3 / (2 * x**2) * (np.sin(x) + 4 * x * np.cos(x))
                          + ci(2 * x) - ci(4 * x))
    printed = 2 / pi * (log(2) - np.sin(x)**3 / (2 * x**2) * (
        np.sin(x) + 4 * x * np.cos(x) + ci(x) - ci(4 * x)))
    assert corrected == pytest.approx(expected, rel=1e-7)
    assert printed != pytest.approx(expected, rel=0.1)
