# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace
import json

from browser import faults_of, needs_browser, pages_in_print
from imu_allan.fleet.population import Outlier
from imu_allan.result import Inspection
from imu_allan.writers.fleet import Failure, Fleet, population_table
from imu_allan.writers.fleet.figure import units_figure
from imu_allan.writers.fleet.findings import sentence
from imu_allan.writers.fleet.written import fleet_csv, fleet_html, fleet_json
import numpy as np
from on_terminal import shown
import pytest


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


def test_units_and_failures_are_named_everywhere_and_strangers_are_escaped(fleet):
    # Its page takes two seconds: one is looked at for all.
    results = {**fleet.results, '<b>evil</b>': fleet.results['unit5'],
               'unit1': replace(fleet.results['unit1'], inspection=Inspection('A-17'))}
    copy = Failure('copy', 'units/copy', 'unit1 and copy hold the same messages')
    fleet = replace(fleet, results=results, folders={}, failures=(*fleet.failures, copy))
    page = fleet_html(fleet)
    for text in (shown(population_table(fleet, 140), 140), page, fleet_csv(fleet),
                 fleet_json(fleet)):
        for word in 'unit5', 'angle random walk', 'cannot be read':
            assert word in text
    assert '<b>evil' not in page
    for part in ('&lt;b&gt;evil', '<small>A-17</small>', '2 not counted',
                 '<b>copy</b> is not counted: unit1 and copy hold the same messages'):
        assert part in page
    serials = {unit['name']: unit['serial'] for unit in json.loads(fleet_json(fleet))['units']}
    assert serials['unit1'] == 'A-17'


def test_a_name_is_no_formula_in_the_table_and_failures_alone_are_reported(fleet):
    results = {'=1+1': fleet.results['unit1'], 'b': fleet.results['unit2']}
    assert "\n'=1+1,," in fleet_csv(Fleet(results))
    nothing = Fleet({}, {}, fleet.failures)
    assert 'unit13' in fleet_html(nothing)
    assert json.loads(fleet_json(nothing))['units'] == []


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


def test_units_whose_long_names_differ_in_the_middle_have_labels_that_differ(make_result):
    results = {f'recording_of_{unit}_monday_night': make_result() for unit in 'abc'}
    for panel in units_figure(Fleet(results)).axes:
        assert len({tick.get_text() for tick in panel.get_xticklabels()}) == 3
