# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The reports as files and as pages: the latter in a real browser, where there is one."""

from base64 import b64encode
from dataclasses import replace
from hashlib import sha256
from math import degrees
import os
from pathlib import Path
import re
import time

from browser import faults_of, needs_browser, Outline, pages_in_print
from changed import known_for, with_axes, with_edf
from imu_allan import analyze
from imu_allan.characterization.mean import error_of_mean
from imu_allan.finding import Finding, finding
from imu_allan.result import (
    GaussMarkov,
    Inspection,
    PowerLaw,
    Signal,
    Source,
    Spectrum,
    Timeline,
)
from imu_allan.sensor.units import engineering
from imu_allan.wording import measured
from imu_allan.writers.filters import export
from imu_allan.writers.plot import overview_figure, render
from imu_allan.writers.report import comparison_html, report_html
from imu_allan.writers.svg import Scale
import numpy as np
from on_terminal import FLAT, printed
import pytest

NASTY = '</script><script>window.evil=1</script><img src=x onerror="window.evil=2">&amp;{{7*7}}'


def written(tmp_path, text):
    (tmp_path / 'report.html').write_text(text, encoding='utf-8')
    return tmp_path / 'report.html'


@pytest.fixture(scope='module')
def page(filtered):
    """Return the report of a whole characterization."""
    return report_html(filtered)


@pytest.fixture(scope='module')
def outline(page):
    return Outline(page)


def test_the_report_shows_the_answer_before_it_explains_it(outline):
    text = outline.text
    for part in ('Gyroscope good N angle random walk, worst axis: y 2.647 °/√h '
                 '95 %: 2.642 – 2.652 0.0007700 rad/s/√Hz',
                 'K rate random walk, worst axis: y 54 °/h/√h 95 %: 38 – 71',
                 'tuned for corrections every 0.1 s and up to 60 s unaided',
                 'Unaided drift after 60 s: 0.53° rms 95 %: 0.15 – 1.8°',
                 '2,160,000 samples at 200 Hz, 3 h', 'frame imu_link', 'N is good (±',
                 '2.406 2.402 – 2.411', '< 23.5', 'motion or knocks were cut out 2 times, 345 s',
                 'gyro z: 2 lines, the strongest at 23.4 Hz (41.3 °/h), left out of the fit',
                 '2 × motion or knocks, left out, 5 min 45 s in all',
                 '2 × gaps without samples, 6 s in all'):
        assert part in text
    assert (text.index('Unaided drift') < text.index('Signal, spectrum')
            < text.index('How it was computed'))
    for part in ('+-', 'extrapolated', 'serial number', '>°C<', '"beyond-band"'):
        assert part not in text


def test_a_forecast_says_how_far_it_is_known(filtered):
    assert Outline(report_html(known_for(filtered, 30.0))).text.count(
        'extrapolated: longer than this recording knows.') == 2
    assert ('0.53° rms, not known to a factor of 10 The bias averaged '
            in Outline(report_html(with_edf(filtered, 0.01))).text)


def test_the_drift_has_a_line_and_points_and_the_shade_of_one_axis(page):
    chart = page[page.index('id="gyro-drift"'):].partition('</figure>')[0]
    assert {*re.findall('<path class="([^"]*)"', chart)} <= {
        'grid', 'tickmark', 'curve model', 'expected', 'mark'}
    assert 'data-focus="y"' in chart


def test_what_to_act_upon_is_in_full_the_rest_a_line_and_the_verdict_behind_each_sensor(result):
    poor = [finding('poor_fit', (name,), misfit_share=(3 + place) / 100)
            for place, name in enumerate(result.axes) if name.startswith('gyro')]
    html = report_html(replace(result, warnings=(*poor, *result.warnings),
                               inspection=Inspection('A-17 <b>', 'mk', 'bench 3')))
    assert '<p>3 findings: poor fit, tones, motion</p>\n<dl>\n<dt class="act">poor fit' in html
    assert '<summary>Good to know (2) <small>imu_allan explain NAME</small></summary>' in html
    shown, _, folded = html.partition('<details><summary>Good to know')
    assert 'class="act"' not in folded
    assert 'class="know"' not in shown
    assert '<summary>2 findings: tones, motion <small>' in report_html(result)
    text = Outline(html).text
    for part in ('the best is off by 3 to 5 %', 'Gyroscope use with care N angle',
                 'Accelerometer good N velocity', 'serial number A-17 <b>', 'operator mk',
                 'station bench 3'):
        assert part in text


def test_a_constant_sensor_says_so_instead_of_blank_charts(result, make_axis):
    axes = {f'gyro_{letter}': make_axis(f'gyro_{letter}', {}, curve=FLAT) for letter in 'xyz'}
    html = report_html(replace(result, axes=axes, warnings=()))
    text = Outline(html).text
    assert 'Constant: gyro x, y and z. Every sample is the same' in text
    assert 'no term of the noise can show' in text
    # No rows that say five times that nothing shows.
    assert [part for part in ('<svg', '<small>not observable</small>') if part in html] == []


def test_the_temperature_and_frequencies_that_were_left_out_are_shown(filtered):
    warm = replace(with_axes(filtered, band_edge_hz=12.5), temperature=Signal(
        100.0, *((low,) * 40 + (low + 9.0,) * 40 for low in (20.0, 20.1, 20.2))))
    page = report_html(warm)
    # A strip under each sensor, at the desk and on the phone.
    assert page.count('>°C<') == 4
    assert 'of the thermometer beside the sensor' in page
    # Each axis in both drawings of both sensors.
    assert page.count('class="beyond-band"') == 2 * len(warm.axes)
    assert 'not fitted above 12.5 Hz' in page


@pytest.mark.parametrize('nothing', [(), (None,) * 5])
def test_a_signal_without_a_value_is_not_drawn(filtered, nothing):
    unseen = Signal(10.0, nothing, nothing, nothing)
    one, all_of_them = (replace(with_axes(filtered, begin, signal=unseen), temperature=unseen)
                        for begin in ('gyro_x', ''))
    page = report_html(one)
    assert '>°C<' not in page
    assert 'gyro-signal' in page
    assert '-signal' not in report_html(all_of_them)
    assert b'temperature' not in render(overview_figure(all_of_them), 'svg', 30)


def test_curves_without_a_number_are_pages_without_a_point(filtered):
    blind = with_axes(filtered, curve=lambda axis: replace(
        axis.curve, adev=(np.nan,) * len(axis.curve.adev)))
    assert 'axis, τ =' in report_html(filtered)
    assert 'axis, τ =' not in report_html(blind)
    page = comparison_html({'seen': filtered, 'blind': blind})
    assert 'seen, τ =' in page
    assert 'blind, τ =' not in page


@pytest.mark.parametrize(('low', 'high'), [
    (-0.49, 0.49), (-10.4, -9.6), (-1.9, 1.4), (131.0, 131.5), (0.0, 1.0), (-3e-7, 4e-7)])
def test_a_strip_has_two_or_three_numbers_beside_it(low, high):
    ticks = Scale(low, high, False, 0.0, 1.0).ticks(3)
    assert 2 <= len(ticks) <= 3
    assert len({text for _, text in ticks}) == len(ticks)
    assert all(low - 1e-9 <= value <= high + 1e-9 for value, _ in ticks)


def test_every_filter_config_can_be_copied_from_the_report(filtered, outline):
    for consumer in ('kalibr', 'px4', 'basalt'):
        assert ' '.join(export(filtered, consumer).text.split()) in outline.text


def test_the_report_names_no_address_and_allows_the_script_it_has_and_no_other(page, outline):
    for tag, attributes in outline.tags:
        for name in ('src', 'href', 'srcset', 'action', 'data'):
            value = attributes.get(name)
            assert value is None or value.startswith(('data:', '#')), (tag, value)
    style = re.search(r'<style>(.*?)</style>', page, re.DOTALL)[1]
    assert 'url(' not in style
    assert '@import' not in style
    policy = next(attributes['content'] for tag, attributes in outline.tags
                  if attributes.get('http-equiv') == 'Content-Security-Policy')
    assert "default-src 'none'" in policy
    allowed = re.search('script-src ([^;]*)', policy)[1].split()
    assert allowed == [f"'sha256-{b64encode(sha256(script.encode()).digest()).decode()}'"
                       for script in outline.scripts]


def test_every_picture_is_there_without_a_script_and_tells_its_numbers(filtered, outline):
    names = [attributes['id'] for tag, attributes in outline.tags if tag == 'figure']
    assert names == [f'{sensor}-{what}' for what in ('allan', 'signal', 'psd', 'drift', 'segments')
                     for sensor in ('gyro', 'accel')]
    curve = filtered.axes['gyro_y'].curve
    shown, *bounds = measured(*(engineering(v, 'rad/s')[0]
                                for v in (curve.adev[0], *curve.ci95[0])))
    assert f'y axis, τ = 0.005 s: {shown} °/h, 95 % {" – ".join(bounds)}' in outline.text


def test_every_part_has_its_mean_with_an_interval(filtered, outline):
    axis = filtered.axes['gyro_x']
    part = axis.stationarity.segments[1]
    half = 1.96 * error_of_mean(axis, part.duration_s)
    mean, low, high = measured(*(degrees(v) for v in (part.mean, part.mean - half,
                                                      part.mean + half)))
    assert f' 22 min 30 s {mean} {low} – {high} ' in outline.text


@pytest.mark.parametrize(('beside', 'names'), [
    ({'gauss_markov': GaussMarkov(2e-3, 300.0)}, ('Gauss-Markov, 413 °/h',
                                                  'correlated over 5 min')),
    ({'power_law': PowerLaw(0.7, (0.68, 0.72), 1e-9)}, ('1/f^0.70',))])
def test_noise_that_no_term_describes_is_named_in_the_picture(filtered, beside, names):
    axis = replace(filtered.axes['gyro_x'], **beside)
    page = report_html(replace(filtered, axes={'gyro_x': axis}))
    assert all(name in page for name in names)
    assert page.count('class="ring"') == 2 * 3


def evil(result):
    """Give a result of a recording whose every name is a script."""
    return replace(result, source=Source('recording', NASTY, NASTY, NASTY, NASTY, 'header'),
                   imu_allan_version=NASTY, warnings=tuple(
                       Finding(NASTY, message=f'{NASTY}{i}') for i in range(len(result.warnings))))


def test_text_from_a_recording_stays_text(result):
    tame, named = Outline(report_html(result)), Outline(report_html(evil(result)))
    assert [tag for tag, _ in named.tags] == [tag for tag, _ in tame.tags]
    assert NASTY in named.text
    assert '<script>window.evil' not in comparison_html({NASTY: evil(result), 'other': result})


@needs_browser
def test_the_page_asks_for_nothing_and_complains_of_nothing(result, tmp_path, browser):
    page = written(tmp_path, report_html(
        with_axes(result, 'gyro_x', spectrum=Spectrum((0.1, 1.0), (1e-6, 9e-7)))))
    browser.requests()
    browser.console()
    browser.show(page)
    asked = [url for url in browser.requests() if not url.startswith(('chrome:', 'data:'))]
    assert asked == [page.as_uri()]
    assert browser.console() == []
    assert browser.run('return document.querySelectorAll("svg.chart").length') >= 8


@needs_browser
def test_one_axis_is_brought_forward_and_units_are_switched(filtered, tmp_path, browser):
    browser.show(written(tmp_path, report_html(filtered)))
    seen = ('return [...document.querySelectorAll("#gyro-allan .at-desk .detail")]'
            '.filter(item => getComputedStyle(item).display !== "none")'
            '.map(item => item.dataset.group).join("")')
    assert browser.run(seen) == 'yy'
    browser.run('document.querySelector("#gyro-allan button[data-group=x]").click()')
    assert browser.run(seen) == 'xx'
    browser.run('const choice = document.getElementById("units"); choice.value = "si";'
                'choice.dispatchEvent(new Event("change"))')
    assert browser.run('return document.querySelector("span.si b").offsetParent !== null')
    assert browser.run('return document.querySelector("span.engineering b").offsetParent === null')
    assert '0.0007700' in browser.run('return document.querySelector(".coefficients").innerText')
    assert browser.console() == []


@needs_browser
def test_the_first_screen_has_both_answers_and_configurations_are_copied_by_their_buttons(
        filtered, tmp_path, browser):
    browser.show(written(tmp_path, report_html(filtered)), width=1400, height=900)
    ends = browser.run('return [...document.querySelectorAll(".forecast, .copy-for, .remarks")]'
                       '.map(item => item.getBoundingClientRect().bottom)')
    assert len(ends) == 4
    assert max(ends) < 900
    browser.run('navigator.clipboard.writeText = async text => { window.copied = text; };')
    for click, consumer in (
            ('document.getElementById("consumer").value = "px4";'
             'document.getElementById("copy-for").click();', 'px4'),
            ('document.querySelector(".config").open = true;'
             'document.querySelector(".config .copy").click();', 'kalibr')):
        browser.run(click)
        time.sleep(0.2)
        assert browser.run('return window.copied') == export(filtered, consumer).text
    assert browser.run('return document.querySelector(".config .copy").textContent') == 'Copied'


@needs_browser
@pytest.mark.parametrize('dark', [False, True])
@pytest.mark.parametrize('width', [400, 1400])
def test_nothing_overlaps_overflows_or_is_too_faint(filtered, tmp_path, browser, width, dark):
    assert faults_of(written(tmp_path, report_html(filtered)), browser, width, dark) == []
    assert browser.run('return getComputedStyle(document.body).backgroundColor') == (
        'rgb(22, 24, 28)' if dark else 'rgb(255, 255, 255)')
    shown = browser.run('return [...document.querySelectorAll("#gyro-allan svg")]'
                        '.filter(item => item.clientWidth).map(item => item.classList[1])')
    assert shown == ['on-phone' if width < 600 else 'at-desk']


@needs_browser
@pytest.mark.skipif('IMU_ALLAN_DATA' not in os.environ, reason='IMU_ALLAN_DATA is not set')
@pytest.mark.parametrize('name', ['adis16405_imu2', 'adis16405_imu5',
                                  'plotjuggler_v2_constant_imu/rosbag2_test'])
def test_page_and_screen_of_real_sensors_can_be_read(tmp_path, browser, name):
    result = analyze(Path(os.environ['IMU_ALLAN_DATA'], name))
    assert len(printed(result).splitlines()) <= 23
    page = written(tmp_path, report_html(result))
    assert [faults for width in (400, 1400) for dark in (False, True)
            if (faults := faults_of(page, browser, width, dark))] == []


@needs_browser
def test_print_is_two_light_pages_whatever_the_scheme(filtered, tmp_path, browser):
    assert pages_in_print(written(tmp_path, report_html(filtered)), browser) == 2
    browser.cdp('Emulation.setEmulatedMedia', media='print', features=[
        {'name': 'prefers-color-scheme', 'value': 'dark'}])
    assert browser.run('return getComputedStyle(document.body).backgroundColor') == (
        'rgb(255, 255, 255)')
    assert browser.run('return document.querySelector(".configs").offsetParent === null')
    browser.cdp('Emulation.setEmulatedMedia', media='')


@needs_browser
def test_no_script_from_a_recording_runs(result, tmp_path, browser):
    named = evil(result)
    browser.show(written(tmp_path, report_html(named)))
    assert browser.run('return window.evil === undefined')
    browser.show(written(tmp_path, comparison_html({NASTY: named, '<b>x</b>': result})))
    assert browser.run('return window.evil === undefined')
    assert browser.run('return document.querySelectorAll("main img, main b b").length') == 0
    assert browser.console() == []


@needs_browser
def test_the_comparison_page_overlays_the_results(result, make_result, tmp_path, browser):
    page = written(tmp_path, comparison_html({'monday': result, 'friday': make_result(1.5)}))
    browser.show(page)
    labels = browser.run('return [...document.querySelectorAll("#gyro_x .legend button")]'
                         '.map(item => item.textContent.trim())')
    assert labels == ['monday', 'friday']
    assert browser.run('return document.querySelectorAll("figure").length') == 6
    assert '+138.68' in browser.run('return document.body.innerText')
    assert pages_in_print(page, browser) == 2


@needs_browser
def test_a_result_of_nothing_gives_a_page(result, tmp_path, browser):
    empty = replace(result, axes={}, warnings=(), timeline=Timeline(None, 0, 0.0),
                    source=Source('topic', None, None, None, None, None))
    browser.show(written(tmp_path, report_html(empty)))
    assert 'No gap and no motion' in browser.run('return document.body.innerText')
    assert browser.console() == []


@needs_browser
@pytest.mark.parametrize('dead', [[], range(6), [2]], ids=['30 s', 'constant', 'one dead'])
def test_pages_of_odd_sensors_can_be_read(dead, tmp_path, browser):
    samples = np.random.default_rng(1).normal(size=(3000, 6)) * 1e-3
    samples[:, [*dead]] = 0.25
    stamps = np.arange(len(samples)) / 100
    recording = tmp_path / 'recording.csv'
    np.savetxt(recording, np.column_stack([stamps, samples]), '%.9g', ',', comments='',
               header='time_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z')
    page = written(tmp_path, report_html(analyze(recording)))
    assert [faults for width in (400, 1400) for dark in (False, True)
            if (faults := faults_of(page, browser, width, dark))] == []
