# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The study of docs/allan_variance_study.md: its command, its tables, its errata."""

import importlib.util
from math import log, pi
from pathlib import Path
import re

from imu_allan.sensor.noise_model import load_model
from imu_allan.sensor.units import parse
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import sici

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / 'docs' / 'allan_variance_study.md').read_text()
GYRO_N, RATE = 'rad/s/sqrt(Hz)', 'rad/s'


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


def test_in_one_unit_the_sensor_is_better_than_its_datasheet(study):
    rows = study.section_4()
    assert [row[6] for row in rows if row[1] == 'N (Q)'] == ['below the limit'] * 3
    assert [row[4] for row in rows if row[1] == 'N (Q)'] == ['1.8'] * 3
    assert [row[6] for row in rows if row[1] == 'B'] == ['above the limit'] * 3


def test_what_the_page_says_of_the_mems_gyroscope():
    n, b = parse('0.03 deg/s/sqrt(Hz)', GYRO_N), parse('18 deg/h', RATE)
    assert (n / (0.66428 * b))**2 == pytest.approx(82, abs=0.5)
    misread = parse('0.03 deg/sqrt(h)', GYRO_N)
    assert n / misread == pytest.approx(60)
    assert (misread / (0.66428 * b))**2 == pytest.approx(0.02, abs=0.005)


def test_what_the_page_says_of_the_ring_laser():
    n = parse('0.015 deg/sqrt(h)', GYRO_N)

    def crossing(q):
        return 3 * parse(q, 'rad')**2 / n**2

    assert crossing('1.62 rad') > 10_000 * 365.25 * 86_400
    assert crossing('1.62 arcsec') == pytest.approx(9.7, abs=0.05)
    assert crossing('1.62 urad') == pytest.approx(0.4, abs=0.05)
    assert 200 < 1.62 * 2**0.5 * 100 < 250
    axis = load_model(ROOT / 'config' / 'allan_variance_ring_laser.yaml').axes['gyro_z']
    assert axis['quantization_noise'] == 1.62


def test_the_quantization_noise_of_table_3_contradicts_its_random_walk():
    tau = 3**0.5
    by_q = parse('0.7528 deg', 'rad') * 3**0.5 / tau
    by_n = parse('1.4 deg/sqrt(h)', GYRO_N) / tau**0.5
    assert by_q / by_n == pytest.approx(42, abs=1)


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


def test_erratum_11_quantization_noise_falls_with_the_square_of_the_time():
    dt = 0.01
    for m in (10, 40):
        variance = allan_variance(lambda f: (2 * pi * f)**2 * dt, m * dt, 0, 1 / (2 * dt))
        assert variance == pytest.approx(3 / (m * dt)**2, rel=1e-6)


def test_erratum_22_a_ramp_gives_half_the_square():
    samples = 3.0 * 0.01 * np.arange(1000)
    means = samples.reshape(-1, 50).mean(axis=1)
    assert np.mean(np.diff(means)**2) / 2 == pytest.approx((3.0 * 0.5)**2 / 2, rel=1e-12)


def test_the_page_shows_all_figures_and_they_are_there():
    names = re.findall(r'\((images/allan_variance_study/figure_\d\d\.png)\)', PAGE)
    assert len(names) == 11
    for name in names:
        assert (ROOT / 'docs' / name).read_bytes().startswith(b'\x89PNG')
