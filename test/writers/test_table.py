# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace
import io
import os
from pathlib import Path
import re
import subprocess
import sys

from imu_allan.finding import Finding, finding
from imu_allan.result import Curve, Saturation, Source, Span
from imu_allan.writers.table import print_result, result_text
import pytest
from rich.console import Console


def printed(result, width=120, units='datasheet', verbose=False, **options):
    out = io.StringIO()
    print_result(result, Console(file=out, width=width, **options), units=units, verbose=verbose)
    return out.getvalue()


def lines_of(text, begin):
    return [line for line in text.splitlines() if line.strip().startswith(begin)]


@pytest.mark.parametrize('width', [60, 80, 140])
def test_a_result_looks_on_the_terminal_as_it_did(filtered, width):
    """After a wanted change: IMU_ALLAN_SNAPSHOTS=write pytest test/writers/test_table.py."""
    text = '\n'.join(line.rstrip() for line in printed(filtered, width).splitlines()) + '\n'
    snapshot = Path(__file__).with_name('snapshots') / f'terminal_{width}.txt'
    if os.environ.get('IMU_ALLAN_SNAPSHOTS') == 'write':
        snapshot.write_text(text)
    assert text == snapshot.read_text()


def test_an_ordinary_result_is_one_screen_of_eighty_columns(filtered):
    assert len(printed(filtered, 80).splitlines()) <= 40


def test_values_stand_above_their_interval_in_the_unit_of_datasheets(result):
    lines = printed(result, 80).splitlines()
    place = next(i for i, line in enumerate(lines) if line.startswith('N angle random walk'))
    assert lines[place].split() == ['N', 'angle', 'random', 'walk', '2.406', '2.647', '2.286']
    assert lines[place + 1].split() == ['deg/sqrt(h)', '2.402', '..', '2.411', '2.642', '..',
                                        '2.652', '2.282', '..', '2.291']
    assert lines_of(printed(result), 'mean')[0].split() == [
        'mean', 'deg/s', '0.573', '0.573', '0.573']


def test_si_units_hold_for_the_mean_too(result):
    text = printed(result, units='si')
    assert lines_of(text, 'rad/s/sqrt(Hz)')[0].split()[:4] == [
        'rad/s/sqrt(Hz)', '0.0006986', '..', '0.0007014']
    assert lines_of(text, 'mean')[0].split() == [
        'mean', 'rad/s', '0.0100', '0.0100', '0.01000']


def test_what_is_not_observable_shows_its_bound(result):
    text = printed(result, 200)
    assert lines_of(text, 'K rate random walk')[0].split()[-2:] == ['<', '23.5']
    assert '|R| < ' not in text
    assert '|R| < ' in printed(result, verbose=True)
    assert '"<": below it with 95 % confidence.' in text


def test_the_answer_says_what_to_give_a_filter_and_how_far_off_the_sensor_is_alone(filtered):
    lines = printed(filtered).splitlines()
    place = lines.index('Gyroscope: steady')
    assert lines[place + 1].startswith('  filter N 0.000')
    assert lines[place + 1].endswith(' rad/s^2/sqrt(Hz)')
    assert any(line.startswith('  unaided drift after 60 s: ')
               for line in lines[place + 2:place + 4])


def test_a_forecast_longer_than_the_recording_says_so(filtered):
    short = replace(filtered, axes={
        name: replace(axis, drift_model=replace(axis.drift_model, to_s=30.0))
        for name, axis in filtered.axes.items()})
    assert re.search(r'  unaided drift after 60 s: [\d.]+ deg rms \([\d.]+ to [\d.]+ deg\)\n'
                     r'  beyond what this recording knows\n', printed(short))
    assert 'beyond what this recording knows' not in printed(filtered)


def test_a_forecast_that_nothing_is_known_of_has_no_interval(filtered, with_edf):
    # Of a second of recording: 5.2e-05 .. 5.1e+06 deg.
    text = printed(with_edf(filtered, 0.01))
    assert len(re.findall(r'drift after .* rms, not known to a factor of 10\n', text)) == 2
    assert '95 %: ' not in text


@pytest.mark.parametrize('edf', [2.0, 5.0, 20.0, 100.0])
def test_each_bound_of_a_forecast_has_two_digits(filtered, with_edf, edf):
    steady = replace(filtered, axes={name: replace(axis, stationarity=None)
                                     for name, axis in filtered.axes.items()})
    bounds = re.findall(r' rms \(([\d.]+) to ([\d.]+) ', printed(with_edf(steady, edf)))
    assert [len(re.sub(r'^[0.]+|\.', '', bound)) for pair in bounds for bound in pair] == [2] * 4


def test_a_constant_sensor_says_so_and_has_no_empty_rows(make_axis, make_result):
    flat = Curve((0.01, 0.02), (0.0, 0.0), (5.0, 2.0), ((0.0, 0.0),) * 2, ((0.0, 0.0),) * 2,
                 (0.0, 0.0))
    axis = make_axis('gyro_x', {}, curve=flat)
    axis = replace(axis, coefficients={key: replace(value, upper95=None)
                                       for key, value in axis.coefficients.items()})
    text = printed(make_result(axes={'gyro_x': axis}, warnings=()))
    lines = text.splitlines()
    assert lines[0] == 'Gyroscope: not usable: constant (x).'
    assert lines[5:8] == ['Gyroscope: constant', '                 x', 'mean  deg/s  0.573']


def test_an_axis_that_does_not_measure_is_named_in_the_answer(filtered):
    axes = dict(filtered.axes)
    flat = replace(axes['gyro_z'].curve, adev=(0.0,) * len(axes['gyro_z'].curve.adev))
    axes['gyro_z'] = replace(axes['gyro_z'], curve=flat)
    axes['accel_x'] = replace(axes['accel_x'], stood_still=Span(100.0, 50.0))
    text = printed(replace(filtered, axes=axes))
    assert lines_of(text, 'Gyroscope') == ['Gyroscope: not usable: constant (z).',
                                           'Gyroscope: z constant']
    assert lines_of(text, 'Accelerometer') == ['Accelerometer: not usable: stood still (x).',
                                               'Accelerometer: x dead']


def test_every_kind_of_fault_is_named_in_the_answer(filtered):
    axes = dict(filtered.axes)
    axes['gyro_x'] = replace(axes['gyro_x'], stood_still=Span(100.0, 50.0))
    for name in ('gyro_y', 'gyro_z'):
        axes[name] = replace(axes[name], saturated=Saturation(34.9, 0.2))
    text = printed(replace(filtered, axes=axes))
    assert lines_of(text, 'Gyroscope') == [
        'Gyroscope: not usable: stood still (x), saturated (y and z).',
        'Gyroscope: x dead, y and z saturated']


def test_the_mean_has_the_digits_that_its_error_leaves(result):
    # The Allan deviation at three hours is 2.5e-4 rad/s with K, 0.8e-4 without.
    axes = {name: replace(result.axes[name], mean=1.23456789) for name in ('gyro_x', 'gyro_z')}
    text = printed(replace(result, axes=axes), units='si')
    assert lines_of(text, 'mean')[0].split() == ['mean', 'rad/s', '1.2346', '1.23457']


@pytest.mark.parametrize('width', [60, 80, 100, 200])
def test_no_digit_is_lost_on_a_narrow_terminal(result, width):
    text = printed(result, width)
    assert '…' not in text
    for part in ('2.406', '2.402', '2.411', '408', '119', '23.5'):
        assert part in text
    assert max(map(len, text.splitlines())) <= width


def test_what_to_act_upon_is_in_full_and_the_rest_is_named(result):
    told = replace(result, axes={'gyro_x': result.axes['gyro_x']}, warnings=(
        finding('gauss_markov', ('gyro_x',), sigma=0.01, unit='rad/s', correlation_time_s=9.0),
        finding('poor_fit', ('gyro_x',), misfit_share=0.12)))
    assert ' '.join(printed(told, 80).split()).endswith(
        'poor fit: gyro x: no sum of noise terms describes this spectrum: its worst half-octave '
        'is off by 12 %. -> the intervals are widened; look for vibration, or a filter in the '
        'sensor or driver Good to know: correlated noise (imu_allan explain NAME, or --verbose).')
    assert 'with a correlation time of 9 s' in ' '.join(
        printed(told, 80, verbose=True).split())


def test_the_first_lines_are_the_verdict_on_each_sensor(result):
    good, careful = (printed(replace(result, warnings=found, sensors={}), 80).splitlines()
                     for found in ((), (finding('gravity', mean=1.0),)))
    assert good[0].startswith('Gyroscope: N is good (+-0.')
    assert careful[0] == good[0]
    assert careful[careful.index('') - 1] == 'Accelerometer: use with care: gravity.'
    short = replace(result, sensors={}, timeline=replace(
        result.timeline, samples=1120, duration_s=5.6, gaps=(), motion=()))
    assert printed(short, 80).splitlines()[:2] == [
        'Gyroscope: not usable: 5.6 s at rest.', 'Accelerometer: not usable: 5.6 s at rest.']


def test_findings_of_one_kind_are_one_sentence(result):
    text = printed(replace(result, warnings=(
        *(finding('band_limited', (name,), window_s=window)
          for name, window in zip(result.axes, (0.0148, 0.015, 0.0152, 0.02, 0.02, 0.02),
                                  strict=True)),
        finding('gravity', mean=1.001))), 200)
    assert text.splitlines()[-3:] == [
        'gravity: the mean acceleration is 1.001 m/s^2, not about 9.81; is it in units of g?',
        '  -> check the unit and the topic; --accel :g converts',
        'Good to know: low-pass (imu_allan explain NAME, or --verbose).']
    assert '1,200 missing, 2 gaps (6 s), 2 stretches of motion (5 min 45 s)' in text


def test_text_from_a_recording_is_neither_markup_nor_control_sequence(result):
    nasty = '[red]x[/red] \x1b[31m [link=http://a]b[/link] \r\n \u202e'
    text = printed(replace(
        result, source=Source('recording', nasty, nasty, nasty, nasty, 'header'),
        warnings=(Finding('motion', message=nasty),)), force_terminal=True, color_system=None)
    assert '[red]x[/red]' in text
    assert '[link=http://a]' in text
    assert '\x1b' not in text
    assert '\r' not in text
    assert '\u202e' not in text


LONG = 'the noise of this axis is not what it was ' * 5


def test_a_pipe_gets_plain_text_unbroken_or_of_the_width_that_is_stated(result, tmp_path):
    told = replace(result, warnings=(Finding('poor_fit', 'act', message=LONG),))
    (tmp_path / 'r.json').write_text(told.to_json())
    done = subprocess.run(
        [sys.executable, '-c', """
import os, sys
from imu_allan.writers.result_file import load_result
from imu_allan.writers.table import print_result
for columns in sys.argv[2:]:
    if columns:
        os.environ['COLUMNS'] = columns
    print_result(load_result(sys.argv[1]))
    print(flush=True, end='\\f')
""", str(tmp_path / 'r.json'), '', '60', '120'], capture_output=True, text=True, check=True,
        env={'PATH': '', 'PYTHONUTF8': '1'})
    assert '\x1b' not in done.stdout
    plain, *broken, _ = done.stdout.split('\f')
    assert LONG.strip() in plain
    for columns, text in zip((60, 120), broken, strict=True):
        assert '2.402 .. 2.411' in text
        assert LONG.strip() not in text
        assert max(map(len, text.splitlines())) <= columns


def test_what_recording_on_would_bring_is_told(result):
    axis = result.axes['gyro_x']
    density = replace(axis.coefficients['noise_density'], ci_halves_in_s=7200.0)
    walk = replace(axis.coefficients['rate_random_walk'], observable=False, value=None, ci95=None,
                   upper95=1e-6, observable_in_s=600.0)
    axis = replace(axis, coefficients={**axis.coefficients, 'noise_density': density,
                                       'rate_random_walk': walk})
    text = ' '.join(printed(replace(result, axes={'gyro_x': axis})).split())
    assert 'half as wide after another 2 h' in text
    assert 'K of gyro x after 10 min at the earliest' in text


def test_print_of_a_result_is_the_table_and_its_repr_one_line(result):
    assert str(result) == result_text(result)
    assert 'Gyroscope' in str(result)
    assert '\x1b' not in str(result)
    assert all(len(line) <= 80 for line in str(result).splitlines())
    for one in (result, *result.axes.values()):
        assert '\n' not in repr(one)
        assert len(repr(one)) < 400
