# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace
import shutil
import subprocess

from browser import Outline
from imu_allan.result import Inspection
from imu_allan.sensor.noise_model import parse_model
from imu_allan.writers.datasheet import certificate_html, check
import pytest

EVERYTHING = parse_model(
    'name: "<b>Part</b> 7"\n'
    'gyro: {quantization_noise: 1 deg, noise_density: 2.5 deg/sqrt(h), bias_instability: 9 deg/h,'
    ' rate_random_walk: 70 deg/h/sqrt(h), rate_ramp: 1 deg/h^2, zero_bias: 0.5 deg/s,'
    ' band_limit: 10 ms, lines: 1 deg/s, temperature_drift: 1 deg/h/K, turn_on_bias: 1 deg/h}\n'
    'accel: {quantization_noise: 1 m/s, noise_density: 9 ug/sqrt(Hz), bias_instability: 9 ug,'
    ' rate_random_walk: 7 ug/sqrt(h), rate_ramp: 1 ug/h, zero_bias: 1 mg, gravity_error: 1 mg,'
    ' band_limit: 10 ms, lines: 1 mg, temperature_drift: 1 ug/K, turn_on_bias: 1 ug,'
    ' z: {mean: 1 g, noise_density: 7 ug/sqrt(Hz)}}')


def page_of(result):
    return Outline(certificate_html(check(result, EVERYTHING), result, EVERYTHING))


def test_a_certificate_says_unit_person_place_and_verdict(result):
    page = page_of(replace(result, inspection=Inspection('A-0017', 'M. Kern', 'bench 3')))
    for word in ('fail', '<b>Part</b> 7, A-0017', 'A-0017', 'M. Kern', 'bench 3', '/imu/data_raw',
                 '2,160,000 at 200 Hz, 3 h', '2.5 °/√h', 'turn-on bias', 'Reasons'):
        assert word in page.words
    assert {'b'} & {tag for tag, _ in page.tags}
    assert 'script' not in {tag for tag, _ in page.tags}


@pytest.mark.browser
@pytest.mark.skipif(shutil.which('chromium') is None or shutil.which('pdfinfo') is None,
                    reason='needs chromium and pdfinfo')
def test_a_certificate_of_every_limit_is_one_sheet_of_a4(result, tmp_path):
    (tmp_path / 'page.html').write_text(
        certificate_html(check(result, EVERYTHING), result, EVERYTHING))
    subprocess.run(
        ['chromium', '--headless=new', '--no-sandbox', '--disable-gpu', '--disable-dev-shm-usage',
         '--no-first-run', '--disable-background-networking', f'--user-data-dir={tmp_path}/data',
         '--no-pdf-header-footer', f'--print-to-pdf={tmp_path}/page.pdf',
         f'{tmp_path}/page.html'], check=True, capture_output=True, timeout=120)
    about = subprocess.run(['pdfinfo', f'{tmp_path}/page.pdf'], check=True, capture_output=True,
                           text=True).stdout
    facts = dict(line.split(':', 1) for line in about.splitlines())
    assert facts['Pages'].strip() == '1'
    assert '(A4)' in facts['Page size']
