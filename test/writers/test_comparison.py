# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0

from dataclasses import replace
import json
from math import sqrt
import re

from browser import faults_of, needs_browser, pages_in_print
from exact_results import (
    axis_result,
    build_result,
    only,
    UNSEEN,
    with_coefficient,
    without,
)
from imu_allan.fleet import Outlier
from imu_allan.noise.terms import AXES, TERMS
from imu_allan.result import Inspection
from imu_allan.writers.comparison import compare, difference_table, verdicts
from imu_allan.writers.fleet import (
    Failure,
    Fleet,
    fleet_csv,
    fleet_html,
    fleet_json,
    population_table,
    sentence,
)
import numpy as np
from on_terminal import FLAT, shown
import pytest
from whole_lines import refused, Varying


def one(value, interval):
    result = build_result(axes={'gyro_x': axis_result('gyro_x', {'noise_density': 1.0})})
    return with_coefficient(result, 'gyro_x', 'noise_density', value=value, ci95=interval)


def test_a_difference_is_in_units_of_the_interval_halves_that_face_each_other():
    low, high = one(10.0, (9.0, 13.0)), one(20.0, (16.0, 21.0))
    (up,), (down,) = compare({'low': low, 'high': high}), compare({'high': high, 'low': low})
    assert (up.in_intervals, up.ratio) == pytest.approx((10 / sqrt(3**2 + 4**2), 2.0))
    assert down.in_intervals == pytest.approx(-up.in_intervals)


@pytest.mark.parametrize(('value', 'interval', 'bound', 'least'), [
    (10.0, (8.0, 13.0), 6.0, -2.0), (10.0, (8.0, 13.0), 9.0, -0.5),
    (10.0, (8.0, 13.0), 11.0, None), (-10.0, (-13.0, -8.0), 6.0, 2.0)])
def test_a_value_differs_by_its_distance_from_a_bound(value, interval, bound, least):
    known = one(value, interval)
    bounded = with_coefficient(known, 'gyro_x', 'noise_density', **UNSEEN, upper95=bound)
    (down,) = compare({'known': known, 'bounded': bounded})
    (up,) = compare({'bounded': bounded, 'known': known})
    assert (down.in_intervals, up.in_intervals) == (least, least if least is None else -least)
    assert verdicts({'known': known, 'bounded': bounded})[:-1] == (
        [] if least is None or abs(least) < 1 else [
            f'N of gyro x of bounded is {"below" if value > 0 else "above"} that of known '
            '(at least 2 intervals)'])


def test_results_with_nothing_in_common_are_refused(result):
    with refused('the results have no axis in common on which a coefficient is observable'):
        compare({'a': only(result, 'gyro'), 'b': only(result, 'accel')})


def test_the_table_names_a_result_without_steering_the_terminal(result):
    text = shown(difference_table(compare({'a': result, '[bold]\x1b[2J': result})), 140)
    assert text.count('[bold]\\x1b[2J') == 1
    assert '\x1b' not in text


def test_what_differs_is_said_first_and_of_all_axes_together():
    def unit(n, k):
        axes = {name: axis_result(name, {'noise_density': n, 'rate_random_walk': (
            k if name == 'gyro_x' else 1e-5)}) for name in AXES}
        return build_result(axes=axes)

    *said, last = verdicts({'A': unit(1e-3, 1e-5), 'B': unit(1.1e-3, 3e-5)})
    assert said == [
        Varying('N of all gyroscope axes of B is 10 % above that of A (<number> intervals)'),
        Varying('K of gyro x of B is 3 times that of A (<number> intervals)'),
        Varying('N of all accelerometer axes of B is 10 % above that of A (<number> intervals)')]
    assert last == ('7 of 12 coefficients differ by more than the 95 % intervals; of two '
                    'recordings of one sensor, one coefficient in twenty does so by chance')
    assert verdicts({'A': unit(1e-3, 1e-5), 'B': unit(1e-3, 1e-5)}) == [
        '0 of 12 coefficients differ by more than the 95 % intervals']


def test_an_axis_that_does_not_measure_is_named(result):
    still = axis_result('gyro_y', {}, dict.fromkeys(TERMS), curve=FLAT)
    died = without(replace(result, axes={**result.axes, 'gyro_y': still}), 'gyro_z')
    *said, _ = verdicts({'before': result, 'after': died, 'later': result})
    assert said == ['gyro y of after is constant', 'gyro z of after is missing']
    # Of two, either may have an axis more.
    assert verdicts({'before': result, 'after': died})[0] == 'gyro y of after is constant'
    assert 'missing' not in str(verdicts({'before': result, 'after': died}))


@pytest.fixture(scope='module')
def fleet():
    """Twelve units that differ by 3 %, unit 5 by much more."""
    rng = np.random.default_rng(1)
    results = {f'unit{n}': build_result(scale=1.5 if n == 5 else float(np.exp(.03 * rng.normal())))
               for n in range(1, 13)}
    return Fleet(results, (Failure('unit13', 'units/13', 'units/13: cannot be read'),), True)


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
               '=1+1': fleet.results['unit2'],
               'unit1': replace(fleet.results['unit1'], inspection=Inspection('A-17'))}
    copy = Failure('copy', 'units/copy', 'unit1 and copy hold the same messages')
    fleet = replace(fleet, results=results, folders=False, failures=(*fleet.failures, copy))
    table, page = shown(population_table(fleet, 140), 140), fleet_html(fleet)
    assert 'zero bias' in table
    assert 'zero bias' in page
    for text in table, page, fleet_csv(fleet), fleet_json(fleet):
        for word in 'unit5', 'angle random walk', 'cannot be read':
            assert word in text
    assert '<b>evil' not in page
    for part in ('&lt;b&gt;evil', '>centre</th>', '<small>A-17</small>', '2 not counted',
                 '<b>copy</b> is not counted: unit1 and copy hold the same messages'):
        assert part in page
    serials = {unit['name']: unit['serial'] for unit in json.loads(fleet_json(fleet))['units']}
    assert serials['unit1'] == 'A-17'
    assert "\n'=1+1,," in fleet_csv(fleet)
    nothing = Fleet({}, fleet.failures)
    assert 'unit13' in fleet_html(nothing)
    assert json.loads(fleet_json(nothing))['units'] == []


def test_what_one_unit_of_four_shifts_is_not_called_a_median():
    fleet = Fleet({f'unit{n}': build_result(scale) for n, scale in enumerate((1, 1, 1, 16))})
    text = shown(population_table(fleet, 140), 140)
    # 2.406 times the fourth root of 16.
    assert re.search(r'term +unit +centre .*\ngyro x +N +deg/sqrt\(h\) +4.81 ', text)
    assert 'median' not in text


@pytest.mark.slow
@needs_browser
@pytest.mark.parametrize('dark', [False, True])
def test_a_page_of_forty_units_can_be_read(tmp_path, browser, dark):
    rng = np.random.default_rng(2)
    results = {f'front_left_SN{n}': build_result(
        2.2 if n == 1017 else float(np.exp(.05 * rng.normal()))) for n in range(1000, 1040)}
    page = tmp_path / 'fleet.html'
    page.write_text(fleet_html(Fleet(results), 'forty units'), encoding='utf-8')
    for width in (400, 1400):
        assert faults_of(page, browser, width, dark) == []
        assert 'SN1017' in browser.run('return document.body.innerText')
        # No column has to be scrolled to.
        assert not browser.run('return [...document.querySelectorAll(".wide")].some('
                               'item => item.scrollWidth > item.clientWidth)')
    browser.show(page, width=400, phone=True)
    assert not browser.run('return [...document.querySelectorAll("td:empty")].some('
                           'item => item.offsetParent)')
    # The population, a picture that is cut nowhere, the table of units.
    assert len(pages_in_print(page, browser)) == 3
