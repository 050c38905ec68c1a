# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace
import io
import subprocess
import sys

from imu_allan.result import GoodnessOfFit, Remark, Source
from imu_allan.writers.table import duration, number, print_result
import pytest
from rich.console import Console


def printed(result, width=120, **options):
    out = io.StringIO()
    print_result(result, Console(file=out, width=width, **options))
    return out.getvalue()


def test_values_stand_in_engineering_and_si_units_with_their_interval(result):
    text = printed(result)
    lines = [line for line in text.splitlines() if 'deg/sqrt(h)' in line]
    assert lines[0].split()[-4:] == ['deg/sqrt(h)', '2.406', '2.647', '2.286']
    assert '2.402 .. 2.411' in text
    assert next(line for line in text.splitlines() if 'rad/s/sqrt(Hz)' in line).split() == [
        'rad/s/sqrt(Hz)', '0.0007', '0.00077', '0.000665']


def test_what_is_not_observable_shows_its_bound(result):
    text = printed(result)
    assert 'K < 23.51' in text
    assert '|R| < ' in text
    assert 'below this bound' in text


@pytest.mark.parametrize('width', [60, 80, 100, 200])
def test_no_digit_is_lost_on_a_narrow_terminal(result, width):
    text = printed(result, width)
    assert '…' not in text
    for part in ('2.406', '2.402', '2.411', '407.9', '119.3', '23.51'):
        assert part in text
    assert max(map(len, text.splitlines())) <= width


def test_warnings_and_findings_are_told(result):
    bad = replace(result.axes['gyro_x'], goodness_of_fit=GoodnessOfFit(0.0, 0.5, False),
                  band_limit_s=0.012)
    text = printed(replace(result, axes={**result.axes, 'gyro_x': bad}))
    assert 'warning: The IMU moved twice' in text
    assert 'gyro_x: no model of the five terms fits this axis well' in text
    assert 'band-limited before sampling, effective window: gyro_x 12 ms' in text
    assert 'gyro_z: tones left out of the fit at 23.4 Hz, 46.8 Hz' in text
    assert '1,200 missing, 2 gaps (6 s), 2 stretches of motion (5 min 45 s)' in text


def test_text_from_a_recording_is_neither_markup_nor_control_sequence(result):
    nasty = '[red]x[/red] \x1b[31m [link=http://a]b[/link] \r\n \u202e'
    text = printed(replace(
        result, source=Source('recording', nasty, nasty, nasty, nasty, 'header'),
        warnings=(Remark('motion', nasty),)), force_terminal=True, color_system=None)
    assert '[red]x[/red]' in text
    assert '[link=http://a]' in text
    assert '\x1b' not in text
    assert '\r' not in text
    assert '\u202e' not in text


def test_a_pipe_gets_plain_text_of_one_width(result, tmp_path):
    (tmp_path / 'r.json').write_text(result.to_json())
    done = subprocess.run(
        [sys.executable, '-c', 'import sys; from imu_allan.writers.table import print_result; '
         'from imu_allan.writers.result_file import load_result; '
         'print_result(load_result(sys.argv[1]))',
         str(tmp_path / 'r.json')], capture_output=True, text=True, check=True,
        env={'PATH': '', 'PYTHONUTF8': '1', 'COLUMNS': '20'})
    assert '\x1b' not in done.stdout
    assert '2.402 .. 2.411' in done.stdout


@pytest.mark.parametrize(('seconds', 'text'), [
    (0, '0 s'), (0.012, '12 ms'), (93, '93 s'), (120, '2 min'), (345, '5 min 45 s'),
    (10_000, '2 h 47 min'), (10_800, '3 h'), (259_200, '3 days')])
def test_durations_are_said_as_a_person_says_them(seconds, text):
    assert duration(seconds) == text


@pytest.mark.parametrize(('value', 'text'), [
    (0, '0'), (2.40642, '2.406'), (101.0, '101'), (2.86e-5, '2.86e-05'), (123456.0, '123456'),
    (-12345.6, '-12346'), (1.5e9, '1.5e+09')])
def test_numbers_have_four_significant_digits(value, text):
    assert number(value) == text


def test_what_recording_on_would_bring_is_told(result):
    axis = result.axes['gyro_x']
    density = replace(axis.coefficients['noise_density'], ci_halves_in_s=7200.0)
    walk = replace(axis.coefficients['rate_random_walk'], observable=False, value=None, ci95=None,
                   upper95=1e-6, observable_in_s=600.0)
    axis = replace(axis, coefficients={**axis.coefficients, 'noise_density': density,
                                       'rate_random_walk': walk})
    text = ' '.join(printed(replace(result, axes={'gyro_x': axis})).split())
    assert 'half as wide after another 2 h' in text
    assert 'K of gyro_x after 10 min' in text
