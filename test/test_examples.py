# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The examples: the Allan variance study of the documentation, and a navigation filter."""

import importlib.util
from math import log, pi
from pathlib import Path
import sys

import imu_allan
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import sici

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / 'docs' / 'allan_variance_study.md').read_text()


def loaded(name):
    path = ROOT / 'examples' / f'{name}.py'
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope='module')
def study():
    return loaded('allan_variance_study/study')


def cells_of(row):
    return [cell.strip() for cell in row.strip('|').split('|')]


def test_the_command_draws_every_figure_and_finds_every_term(study, tmp_path):
    tables = study.run(tmp_path, hours=0.25, seed=3)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        *(f'figure_{place:02d}.png' for place in range(1, 12)), 'tables.md']
    table = tables.partition('### Theory and estimate')[2].strip().split('\n\n')[0]
    rows = [cells_of(line) for line in table.splitlines()[2:]]
    assert len(rows) == 14
    for row in (row for row in rows if row[0] in ('alone', 'with N')):
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
        cells = cells_of(row)
        assert cells[:4] == expected[:4]
        if cells[4] == expected[4] == 'not observable':
            assert float(cells[5].removeprefix('below ')) > float(cells[3])
            continue
        # The flicker of one seed is not the same with every version of SciPy.
        low, high = (float(part) for part in expected[5].split(' … '))
        assert low < float(cells[4]) < high


@pytest.mark.parametrize('x', [0.3, 1.0, 2.5])
def test_erratum_17_the_cosine_integrals_stand_outside_the_product(x):
    tau = x / pi
    # Equation (8) by quadrature, of flicker up to 1 Hz.
    expected = 4 * quad(lambda f: np.sin(pi * f * tau)**4 / (pi * f * tau)**2 / (2 * pi * f),
                        0, 1, limit=2000)[0]

    def ci(z):
        return sici(z)[1]

    corrected = 2 / pi * (log(2) - np.sin(x)**3 / (2 * x**2) * (np.sin(x) + 4 * x * np.cos(x))
                          + ci(2 * x) - ci(4 * x))
    printed = 2 / pi * (log(2) - np.sin(x)**3 / (2 * x**2) * (
        np.sin(x) + 4 * x * np.cos(x) + ci(x) - ci(4 * x)))
    assert corrected == pytest.approx(expected, rel=1e-7)
    assert printed != pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize(('name', 'samples', 'rate', 'off', 'low', 'high'), [
    ('consistency', 12_000, 1.0, 0.1, 0.6, 1.4), ('with_gtsam', 15_000, 10.0, 0.15, 0.4, 2.5)])
def test_a_navigation_filter_predicts_what_happens_where_its_numbers_are_right(
        name, samples, rate, off, low, high, monkeypatch):
    if name == 'with_gtsam':
        pytest.importorskip('gtsam')
        monkeypatch.setitem(sys.modules, 'consistency', loaded('filter_consistency/consistency'))
    example = loaded(f'filter_consistency/{name}')
    n, k = np.array([1e-4] * 3 + [1e-3] * 3), np.array([1e-6] * 3 + [1e-5] * 3)
    rates = np.stack([imu_allan.simulate({'noise_density': n[i], 'rate_random_walk': k[i]},
                                         samples, rate, i) for i in range(6)], axis=1)
    nees, nis = example.run(rates, (n, k), 1)
    assert nis.mean() == pytest.approx(1, abs=off)
    assert low < nees[:, -1].mean() < high
    overconfident, _ = example.run(rates, (n / 3, k / 3), 1)
    assert overconfident[:, -1].mean() > 4
