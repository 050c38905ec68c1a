# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from math import sqrt
from pathlib import Path

from changed import only, UNSEEN, with_coefficient
from imu_allan.noise.terms import AXES
from imu_allan.result import Result
from imu_allan.writers.comparison import compare, difference_table, names_of, verdicts
from on_terminal import shown
import pytest
from whole_lines import refused, Varying


def one(make_result, make_axis, value, interval):
    result = make_result(axes={'gyro_x': make_axis('gyro_x', {'noise_density': 1.0})})
    return with_coefficient(result, 'gyro_x', 'noise_density', value=value, ci95=interval)


def test_a_difference_is_in_units_of_the_interval_halves_that_face_each_other(
        make_result, make_axis):
    low = one(make_result, make_axis, 10.0, (9.0, 13.0))
    high = one(make_result, make_axis, 20.0, (16.0, 21.0))
    (up,), (down,) = compare({'low': low, 'high': high}), compare({'high': high, 'low': low})
    assert (up.in_intervals, up.ratio) == pytest.approx((10 / sqrt(3**2 + 4**2), 2.0))
    assert down.in_intervals == pytest.approx(-up.in_intervals)


@pytest.mark.parametrize(('value', 'interval', 'bound', 'least'), [
    (10.0, (8.0, 13.0), 6.0, -2.0), (10.0, (8.0, 13.0), 9.0, -0.5),
    (10.0, (8.0, 13.0), 11.0, None), (-10.0, (-13.0, -8.0), 6.0, 2.0)])
def test_a_value_that_a_bound_excludes_differs_by_its_distance_from_the_bound(
        make_result, make_axis, value, interval, bound, least):
    known = one(make_result, make_axis, value, interval)
    bounded = with_coefficient(known, 'gyro_x', 'noise_density', **UNSEEN, upper95=bound)
    (down,) = compare({'known': known, 'bounded': bounded})
    (up,) = compare({'bounded': bounded, 'known': known})
    assert (down.in_intervals, up.in_intervals) == (least, least if least is None else -least)
    assert verdicts([down])[:-1] == ([] if least is None or abs(least) < 1 else [
        f'N of gyro x of bounded is {"below" if value > 0 else "above"} that of known '
        '(at least 2 intervals)'])


def test_results_with_nothing_in_common_are_refused(result):
    gyro, accel = only(result, 'gyro'), only(result, 'accel')
    with refused('the results have no axis in common on which a coefficient is observable'):
        compare({'a': gyro, 'b': accel})
    with refused('a comparison needs at least two results'):
        compare({'a': gyro})


@pytest.mark.parametrize(('paths', 'names'), [
    (['a.json', 'b.json'], ['a', 'b']),
    (['mon/result.json', 'tue/result.json'], ['mon', 'tue']),
    (['x/mon/result.json', 'y/mon/result.json'], ['x/mon', 'y/mon']),
    (['a/r.json', 'b/s.json', 'c/r.json'], ['a/r', 'b/s', 'c/r']),
    (['a.json', 'a.json'], ['a (1)', 'a (2)'])])
def test_results_are_named_as_shortly_as_tells_them_apart(paths, names):
    assert names_of([Path(path) for path in paths]) == names


def test_the_table_has_a_row_for_each_difference(result, make_result):
    differences = compare({'a': result, '[bold]\x1b[2J': make_result(2.0)})
    text = shown(difference_table(differences), 140)
    assert text.count('[bold]\\x1b[2J') == 1
    assert '\x1b' not in text


def test_what_differs_is_said_first_and_of_all_axes_together(make_result, make_axis):
    def unit(n: float, k: float) -> Result:
        axes = {name: make_axis(name, {'noise_density': n, 'rate_random_walk': (
            k if name == 'gyro_x' else 1e-5)}) for name in AXES}
        return make_result(axes=axes)

    *said, last = verdicts(compare({'A': unit(1e-3, 1e-5), 'B': unit(1.1e-3, 3e-5)}))
    assert said == [
        Varying('N of all gyroscope axes of B is 10 % above that of A (<number> intervals)'),
        Varying('K of gyro x of B is 3 times that of A (<number> intervals)'),
        Varying('N of all accelerometer axes of B is 10 % above that of A (<number> intervals)')]
    assert last == ('7 of 12 coefficients differ by more than the 95 % intervals; of two '
                    'recordings of one sensor, one coefficient in twenty does so by chance')
    assert verdicts(compare({'A': unit(1e-3, 1e-5), 'B': unit(1e-3, 1e-5)})) == [
        '0 of 12 coefficients differ by more than the 95 % intervals']
