# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0

from dataclasses import replace
import json
import re
import xml.etree.ElementTree as ElementTree

from browser import needs_browser, Outline, pages_in_print
from imu_allan import result as schema
from imu_allan.datasheet import check
from imu_allan.sensor.noise_model import parse_model
from imu_allan.writers.datasheet import certificate_html, to_json, to_junit
import numpy as np
import pytest


def test_json_and_junit_have_every_verdict_with_its_numbers(result):
    specification = parse_model(
        'name: "<Part> & \\u0007"\ngyro: {noise_density: 2.5 deg/sqrt(h)}\n'
        'accel: {z: {rate_random_walk: 1 ug/sqrt(h)}}')
    verdicts = check(result, specification)
    document = json.loads(to_json(verdicts, result, specification))
    assert [document[key] for key in ('schema', 'specification', 'verdict')] == [
        'imu_allan.check/1', '<Part> & \x07', 'fail']
    assert [(document[key], key) for key in ('source', 'warnings')] == [
        (result.to_dict()[key], key) for key in ('source', 'warnings')]
    assert [one['verdict'] for one in document['checks']] == [
        'pass', 'fail', 'pass', 'cannot tell']
    first = document['checks'][0]
    assert first['limit'] == pytest.approx(np.radians(2.5) / 60)
    assert first['ci95'] == list(verdicts[0].ci95)
    suite = ElementTree.fromstring(to_junit(verdicts, result, specification)).find('testsuite')
    assert suite.attrib.items() >= {
        'tests': '4', 'failures': '1', 'errors': '0', 'skipped': '1'}.items()
    assert suite.get('name').startswith('<Part> & ')
    cases = {(case.get('classname'), case.get('name')): case for case in suite.iter('testcase')}
    assert cases['gyro_y', 'noise_density'].find('failure').get('message') == \
        'gyro_y N: the 95 % interval is above 2.5 deg/sqrt(h)'
    assert cases['accel_z', 'rate_random_walk'].find('skipped') is not None
    assert len(cases['gyro_x', 'noise_density']) == 1


EVERYTHING = parse_model(
    'name: "<b>Part</b> 7"\n'
    'gyro: {quantization_noise: 1 deg, noise_density: 2.5 deg/sqrt(h), bias_instability: 9 deg/h,'
    ' rate_random_walk: 70 deg/h/sqrt(h), rate_ramp: 1 deg/h^2, zero_bias: 0.5 deg/s,'
    ' temperature_drift: 1 deg/h/K, turn_on_bias: 1 deg/h}\n'
    'accel: {quantization_noise: 1 m/s, noise_density: 9 ug/sqrt(Hz), bias_instability: 9 ug,'
    ' rate_random_walk: 7 ug/sqrt(h), rate_ramp: 1 ug/h, zero_bias: 1 mg,'
    ' temperature_drift: 1 ug/K, turn_on_bias: 1 ug,'
    ' z: {mean: 1 g, noise_density: 7 ug/sqrt(Hz)}}')


def certificate(result):
    return certificate_html(check(result, EVERYTHING), result, EVERYTHING)


def test_a_certificate_says_what_was_judged_with_a_numbered_reason_for_each_failure(result):
    text = certificate(replace(result, inspection=schema.Inspection('A-0017')))
    page = Outline(text)
    for word in ('fail', '<b>Part</b> 7, A-0017', '/imu/data_raw', '2,160,000 at 200 Hz, 3 h',
                 '2.5 °/√h', 'turn-on bias', 'Reasons'):
        assert word in page.words
    assert {'b', 'script'} & {tag for tag, _ in page.tags} == {'b'}
    # On the line of the interval, which is not broken: below it would be a number by itself.
    numbers = re.findall(r'<small>[^<]* <sup>(\d+)</sup></small>', text)
    assert {*map(int, numbers)} == {*range(1, text.count('<li>') + 1)}


@needs_browser
def test_a_certificate_of_every_limit_is_one_sheet_of_a4(result, tmp_path, browser):
    (tmp_path / 'page.html').write_text(certificate(result))
    [sheet] = pages_in_print(tmp_path / 'page.html', browser)
    # In 72ths of an inch.
    assert sheet == pytest.approx((210 / 25.4 * 72, 297 / 25.4 * 72), abs=1)
