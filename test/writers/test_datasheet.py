# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace
import json
import xml.etree.ElementTree as ElementTree

from imu_allan.errors import ImuAllanError
from imu_allan.noise.model import parse_model
from imu_allan.result import Coefficient, GoodnessOfFit
from imu_allan.writers.datasheet import check, overall, to_json, to_junit, verdict_table
import pytest
from rich.console import Console

DEG_PER_ROOT_H = 2.908882086657216e-4


def with_coefficient(result, axis, key, **fields):
    """Return `result` with one coefficient changed."""
    measured = result.axes[axis]
    coefficients = {**measured.coefficients,
                    key: replace(measured.coefficients[key], **fields)}
    return replace(result, axes={**result.axes,
                                 axis: replace(measured, coefficients=coefficients)})


def only(result, text):
    (verdict,) = check(result, parse_model(text))
    return verdict


# gyro_x: N = 7.0e-4 rad/s/sqrt(Hz) = 2.4064 deg/sqrt(h), interval 2.4016 .. 2.4112
@pytest.mark.parametrize(('limit', 'outcome'), [
    ('2.5 deg/sqrt(h)', 'pass'), ('2.3 deg/sqrt(h)', 'fail'), ('2.41 deg/sqrt(h)', 'cannot tell'),
    ('0.042 deg/s/sqrt(Hz)', 'pass'), ('0.039 deg/s/sqrt(Hz)', 'fail'),
    ('7e-4 rad/s/sqrt(Hz)', 'cannot tell')])
def test_the_interval_decides_whatever_the_unit(result, limit, outcome):
    verdict = only(result, f'gyro: {{x: {{noise_density: {limit}}}}}')
    assert verdict.verdict == outcome
    assert verdict.specified == limit


def test_ratio_is_measured_over_specified(result):
    verdict = only(result, 'gyro: {x: {noise_density: 3.5e-4 rad/s/sqrt(Hz)}}')
    assert verdict.ratio == pytest.approx(2.0)
    assert verdict.value == 7.0e-4
    assert verdict.limit == 3.5e-4


def test_the_interval_may_touch_the_limit_from_below(result):
    result = with_coefficient(result, 'gyro_x', 'noise_density', ci95=(1e-4, 5e-4))
    assert only(result, 'gyro: {x: {noise_density: 5e-4 rad/s/sqrt(Hz)}}').verdict == 'pass'


def test_what_is_not_observable_cannot_be_told(result):
    verdict = only(result, 'gyro: {z: {rate_random_walk: 1e-9 rad/s^2/sqrt(Hz)}}')
    assert verdict.verdict == 'cannot tell'
    assert 'not observable' in verdict.reason
    assert verdict.value is None
    assert verdict.upper95 == pytest.approx(1.9e-6)


def test_a_bound_below_the_limit_is_said(result):
    verdict = only(result, 'gyro: {z: {rate_random_walk: 1 rad/s^2/sqrt(Hz)}}')
    assert verdict.verdict == 'cannot tell'
    assert 'below the limit with 95 % confidence' in verdict.reason


def test_a_missing_axis_cannot_be_told(result):
    axes = {name: axis for name, axis in result.axes.items() if name != 'gyro_y'}
    verdict = only(replace(result, axes=axes), 'gyro: {y: {noise_density: 1 deg/sqrt(h)}}')
    assert verdict.verdict == 'cannot tell'
    assert verdict.reason == 'gyro_y N: this axis is not in the result'


def test_an_axis_that_no_model_fits_cannot_be_told(result):
    bad = replace(result.axes['gyro_x'], goodness_of_fit=GoodnessOfFit(1e-9, 0.8, False))
    result = replace(result, axes={**result.axes, 'gyro_x': bad})
    assert only(result, 'gyro: {x: {noise_density: 9 deg/sqrt(h)}}').verdict == 'cannot tell'


@pytest.mark.parametrize(('interval', 'outcome'), [
    ((-3e-9, -2e-9), 'fail'), ((-3e-10, -2e-10), 'pass'), ((-2e-9, 1e-10), 'cannot tell')])
def test_a_falling_ramp_counts_as_much_as_a_rising_one(result, interval, outcome):
    value = sum(interval) / 2
    ramp = Coefficient('R', 'rad/s^2', True, value, interval, None)
    result = with_coefficient(result, 'gyro_x', 'rate_ramp', **{
        field: getattr(ramp, field) for field in ('observable', 'value', 'ci95', 'upper95')})
    verdict = only(result, 'gyro: {x: {rate_ramp: 1e-9 rad/s^2}}')
    assert verdict.verdict == outcome
    assert verdict.value == abs(value)


def test_one_failure_fails_the_sensor_and_one_doubt_keeps_it_from_passing(result):
    specification = parse_model(
        'gyro: {noise_density: 3 deg/sqrt(h), rate_random_walk: 70 deg/h/sqrt(h)}')
    verdicts = check(result, specification)
    assert [v.verdict for v in verdicts] == ['pass', 'pass', 'pass', 'cannot tell', 'pass',
                                             'cannot tell']
    assert overall(verdicts) == 'cannot tell'
    assert overall(verdicts[:3]) == 'pass'
    failing = check(result, parse_model('gyro: {noise_density: 2.5 deg/sqrt(h)}'))
    assert [v.verdict for v in failing] == ['pass', 'fail', 'pass']
    assert overall(failing) == 'fail'


def test_a_specification_without_a_limit_is_refused(result):
    with pytest.raises(ImuAllanError, match='limits no coefficient'):
        check(result, parse_model('gyro: {mean: 1 deg/s}'))


def test_a_limit_of_zero_has_no_ratio(result):
    verdict = only(result, 'gyro: {x: {noise_density: 0 deg/sqrt(h)}}')
    assert verdict.ratio is None
    assert verdict.verdict == 'fail'


def test_the_table_shows_every_number_in_the_unit_of_the_specification(result, tmp_path):
    specification = parse_model('gyro: {x: {noise_density: 0.03 deg/s/sqrt(Hz)}}')
    with (tmp_path / 'out').open('w') as file:
        Console(file=file, width=120).print(verdict_table(check(result, specification), 'Gyro'))
    shown = (tmp_path / 'out').read_text()
    row = next(line for line in shown.splitlines() if 'gyro_x' in line)
    assert row.split() == ['gyro_x', 'N', '0.04011', '0.04003', '..', '0.04019', '0.03',
                           'deg/s/sqrt(Hz)', '1.34', 'fail']


def test_json_has_every_verdict(result):
    specification = parse_model('name: Part 7\ngyro: {noise_density: 2.5 deg/sqrt(h)}')
    verdicts = check(result, specification)
    document = json.loads(to_json(verdicts, result, specification))
    assert document['schema'] == 'imu_allan.check/1'
    assert document['verdict'] == 'fail'
    assert document['specification'] == 'Part 7'
    assert document['source']['topic'] == '/imu/data_raw'
    assert [c['verdict'] for c in document['checks']] == ['pass', 'fail', 'pass']
    assert document['checks'][0]['limit'] == pytest.approx(2.5 * DEG_PER_ROOT_H)
    assert document['checks'][0]['ci95'] == list(verdicts[0].ci95)


def test_junit_counts_failures_and_skips(result):
    specification = parse_model(
        'name: "<Part> & \\u0007"\ngyro: {noise_density: 2.5 deg/sqrt(h)}\n'
        'accel: {z: {rate_random_walk: 1 ug/sqrt(h)}}')
    verdicts = check(result, specification)
    suite = ElementTree.fromstring(to_junit(verdicts, result, specification)).find('testsuite')
    assert {key: suite.get(key) for key in ('tests', 'failures', 'errors', 'skipped')} == {
        'tests': '4', 'failures': '1', 'errors': '0', 'skipped': '1'}
    assert suite.get('name').startswith('<Part> & ')
    cases = {(case.get('classname'), case.get('name')): case for case in suite}
    assert cases['gyro_y', 'noise_density'].find('failure').get('message') == \
        'gyro_y N: the 95 % interval is above 2.5 deg/sqrt(h)'
    assert cases['accel_z', 'rate_random_walk'].find('skipped') is not None
    assert len(cases['gyro_x', 'noise_density']) == 1
