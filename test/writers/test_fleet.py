# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace
import json

from browser import faults_of, needs_browser, pages_in_print
from changed import UNSEEN, with_coefficient
from imu_allan.fleet.population import Outlier
from imu_allan.result import Inspection
from imu_allan.writers.fleet import Failure, Fleet, population_table
from imu_allan.writers.fleet.figure import curves_figure, units_figure
from imu_allan.writers.fleet.findings import sentence
from imu_allan.writers.fleet.written import cells, fleet_csv, fleet_html, fleet_json
import numpy as np
from on_terminal import shown
import pytest


def printed(fleet, width):
    return shown(population_table(fleet, width), width)


@pytest.fixture(scope='module')
def fleet(make_result):
    """Twelve units that differ by 3 %, unit 5 by much more."""
    rng = np.random.default_rng(1)
    results = {f'unit{n}': make_result(scale=1.5 if n == 5 else float(np.exp(.03 * rng.normal())))
               for n in range(1, 13)}
    return Fleet(results, {name: name for name in results},
                 (Failure('unit13', 'units/13', 'units/13: cannot be read'),))


@pytest.mark.parametrize(('outlier', 'words'), [
    (Outlier('u', 'gyro_y', 'noise_density', None, 2e-4, 1e-4, 9.31),
     'gyro_y angle random walk 0.6875 deg/sqrt(h): 2.00 times the median of the others, '
     '9.3 spreads away'),
    (Outlier('u', 'gyro_y', 'mean', None, 1e-3, 1e-4, -4.0),
     'gyro_y zero bias 206.3 deg/h: the mean of the others is 20.63, 4.0 spreads away'),
    (Outlier('u', 'accel_z', None, 'constant'), 'accel_z is constant')])
def test_an_outlier_is_a_sentence(outlier, words):
    assert sentence(outlier) == words


def test_units_that_do_not_differ_have_no_range_and_a_spread_that_does_not_show_a_limit(fleet):
    trait = fleet.population.traits[0]
    _, _, _, median, middle, spread, *_ = cells(trait)
    assert ' .. ' in middle
    assert not spread.startswith('<')
    same = replace(trait, percentiles={5: trait.median, 95: 1.00001 * trait.median})
    assert cells(same)[4] == median
    assert cells(replace(trait, between=0.0, between_ci95=(0.0, 1e-5)))[5] == '< 0.0344'


def test_what_too_few_units_show_is_said(fleet):
    fleet = Fleet({unit: with_coefficient(result, '', 'rate_random_walk', **UNSEEN, upper95=1e-6)
                   for unit, result in [*fleet.results.items()][:4]})
    assert fleet.unseen == (
        'rate random walk of gyro x, y and z and acceleration random walk of accel x, y and z are '
        'shown by fewer than 3 of 4 units, which makes no population; longer recordings show '
        'more')
    assert fleet.unseen in fleet_html(fleet)
    assert fleet.unseen in printed(fleet, 400)


def test_units_and_failures_are_named_everywhere_and_strangers_are_escaped(fleet):
    # Its page takes two seconds: one is looked at for all.
    results = {**fleet.results, '<b>evil</b>': fleet.results['unit5'],
               'unit1': replace(fleet.results['unit1'], inspection=Inspection('A-17'))}
    copy = Failure('copy', 'units/copy', 'unit1 and copy hold the same messages')
    fleet = replace(fleet, results=results, folders={}, failures=(*fleet.failures, copy))
    page = fleet_html(fleet)
    for text in (printed(fleet, 140), page, fleet_csv(fleet), fleet_json(fleet)):
        assert 'unit5' in text
        assert 'angle random walk' in text
        assert 'cannot be read' in text
    assert '<b>evil' not in page
    assert '&lt;b&gt;evil' in page
    serials = {unit['name']: unit['serial'] for unit in json.loads(fleet_json(fleet))['units']}
    assert serials['unit1'] == 'A-17'
    assert '<small>A-17</small>' in page
    assert '2 not counted' in page
    assert '<b>copy</b> is not counted: unit1 and copy hold the same messages' in page


def test_a_name_is_no_formula_in_the_table_and_failures_alone_are_reported(fleet):
    results = {'=1+1': fleet.results['unit1'], 'b': fleet.results['unit2']}
    assert "\n'=1+1,," in fleet_csv(Fleet(results))
    nothing = Fleet({}, {}, fleet.failures)
    assert 'unit13' in fleet_html(nothing)
    assert json.loads(fleet_json(nothing))['units'] == []


@pytest.mark.parametrize(('count', 'said'), [
    (2, '2 units, too few to compare (fewer than 3)'), (4, '4 units, no outlier')])
def test_the_last_line_says_what_came_of_it(make_result, count, said):
    fleet = Fleet({f'unit{n}': make_result(scale=1 + n / 50) for n in range(count)})
    lines = printed(fleet, 80).splitlines()
    assert lines[-1] == said
    assert [line for line in lines if line != line.rstrip()] == []


def test_units_are_named_above_the_curves(make_result):
    rng = np.random.default_rng(2)
    scales = [2.2, 2.21, *np.exp(.05 * rng.normal(size=18))]
    fleet = Fleet({f'SN-{n}': make_result(scale=float(scale)) for n, scale in enumerate(scales)})
    figure = curves_figure(fleet)
    figure.draw_without_rendering()
    [legend] = figure.legends
    names = {text.get_text(): text.get_window_extent() for text in legend.get_texts()}
    assert set(names) == {'SN-0', 'SN-1'}
    assert not names['SN-0'].overlaps(names['SN-1'])
    assert not any(name.overlaps(panel.get_tightbbox()) for name in names.values()
                   for panel in figure.axes)


@pytest.mark.slow
@needs_browser
@pytest.mark.parametrize('dark', [False, True])
def test_a_page_of_forty_units_can_be_read(make_result, tmp_path, browser, dark):
    rng = np.random.default_rng(2)
    results = {f'SN{n}': make_result(scale=2.2 if n == 1017 else float(np.exp(.05 * rng.normal())))
               for n in range(1000, 1040)}
    page = tmp_path / 'fleet.html'
    page.write_text(fleet_html(Fleet(results), 'forty units'), encoding='utf-8')
    for width in (400, 1400):
        assert faults_of(page, browser, width, dark) == []
        assert 'SN1017' in browser.run('return document.body.innerText')
    # The population, two pictures that are cut nowhere, the table of units.
    assert pages_in_print(page, browser) == 4


def test_a_unit_is_named_where_it_is_an_outlier_and_not_among_the_dots_of_others(fleet):
    results = dict(fleet.results)
    usual, odd = results['unit1'], results['unit5']
    # Of gyro x alone.
    results['unit5'] = replace(usual, axes={**usual.axes, 'gyro_x': odd.axes['gyro_x']})
    figure = units_figure(Fleet(results))
    named = [panel.get_title(loc='left') for panel in figure.axes
             if 'unit5' in {text.get_text() for text in panel.texts}]
    assert 'N gyro x' in named
    assert all(title.endswith('gyro x') for title in named)


def test_units_whose_long_names_differ_in_the_middle_have_labels_that_differ(make_result):
    results = {f'recording_of_{unit}_monday_night': make_result() for unit in 'abc'}
    for panel in units_figure(Fleet(results)).axes:
        assert len({tick.get_text() for tick in panel.get_xticklabels()}) == 3
