# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The reports as files and as pages: the latter in a real browser, where there is one."""

from base64 import b64encode
from dataclasses import replace
from hashlib import sha256
import re
import time

from browser import faults_of, needs_browser, Outline, pages_in_print
from exact_results import with_axes
from imu_allan import analyze
from imu_allan.finding import Finding
from imu_allan.result import Signal, Source, Spectrum
from imu_allan.writers.filters import export
from imu_allan.writers.report import comparison_html, report_html
import numpy as np
import pytest

NASTY = '</script><script>window.evil=1</script><img src=x onerror="window.evil=2">&amp;{{7*7}}'


def written(tmp_path, text):
    (tmp_path / 'report.html').write_text(text, encoding='utf-8')
    return tmp_path / 'report.html'


@pytest.fixture(scope='module')
def page(result):
    return report_html(result)


def test_the_report_shows_the_answer_before_it_explains_it(page, result):
    text = Outline(page).text
    for part in ('Gyroscope good N angle random walk, worst axis: y 2.647 °/√h '
                 '95 %: 2.642 – 2.652 0.0007700 rad/s/√Hz',
                 'K rate random walk, worst axis: y 54 °/h/√h 95 %: 38 – 71',
                 'tuned for corrections every 0.1 s and up to 60 s unaided',
                 'Unaided drift after 60 s: 0.53° rms 95 %: 0.37 – 0.75°',
                 '2,160,000 samples at 200 Hz, 3 h', 'frame imu_link', 'N is good (±',
                 '2.406 2.402 – 2.411', '< 23.5', 'motion or knocks were cut out 2 times, 5 min',
                 'gyro z: 2 lines, the strongest at 23.4 Hz (41.3 °/h), left out of the fit',
                 '2 × motion or knocks, left out, 5 min 45 s in all',
                 '2 × gaps without samples, 6 s in all'):
        assert part in text
    assert (text.index('Unaided drift') < text.index('Signal, spectrum')
            < text.index('How it was computed'))
    for part in ('+-', 'extrapolated', 'serial number', '>°C<', '"beyond-band"'):
        assert part not in text
    for consumer in ('kalibr', 'px4', 'basalt'):
        assert ' '.join(export(result, consumer).split()) in text


def test_a_signal_without_a_value_is_not_drawn(result):
    unseen = Signal(10.0, *[(None,) * 5] * 3)
    one, all_of_them = (replace(with_axes(result, begin, signal=unseen), temperature=unseen)
                        for begin in ('gyro_x', ''))
    page = report_html(one)
    assert '>°C<' not in page
    assert 'gyro-signal' in page
    assert '-signal' not in report_html(all_of_them)


def test_the_report_names_no_address_and_allows_the_script_it_has_and_no_other(page):
    outline = Outline(page)
    for tag, attributes in outline.tags:
        for name in ('src', 'href', 'srcset', 'action', 'data'):
            value = attributes.get(name)
            assert value is None or value.startswith(('data:', '#')), (tag, value)
    assert not re.search(r'url\(|@import', re.search('<style>(.*?)</style>', page, re.DOTALL)[1])
    policy = next(attributes['content'] for tag, attributes in outline.tags
                  if attributes.get('http-equiv') == 'Content-Security-Policy')
    assert "default-src 'none'" in policy
    allowed = re.search('script-src ([^;]*)', policy)[1].split()
    assert allowed == [f"'sha256-{b64encode(sha256(script.encode()).digest()).decode()}'"
                       for script in outline.scripts]


def test_text_from_a_recording_stays_text(result):
    # Every name of this recording is a script.
    evil = replace(result, source=Source('recording', NASTY, NASTY, NASTY, NASTY, 'header'),
                   imu_allan_version=NASTY, warnings=tuple(
                       Finding(NASTY, message=f'{NASTY}{i}') for i in range(len(result.warnings))))
    tame, named = Outline(report_html(result)), Outline(report_html(evil))
    assert [tag for tag, _ in named.tags] == [tag for tag, _ in tame.tags]
    assert NASTY in named.text
    tame, named = (Outline(comparison_html({name: one, 'other': result}))
                   for name, one in (('tame', result), (NASTY, evil)))
    assert [tag for tag, _ in named.tags] == [tag for tag, _ in tame.tags]


@needs_browser
def test_a_page_asks_for_nothing_shows_an_axis_and_switches_units(result, tmp_path, browser):
    page = written(tmp_path, report_html(
        with_axes(result, 'gyro_x', spectrum=Spectrum((0.1, 1.0), (1e-6, 9e-7)))))
    browser.requests()
    browser.console()
    browser.show(page)
    assert [url for url in browser.requests()
            if not url.startswith(('chrome:', 'data:'))] == [page.as_uri()]
    assert browser.run('return document.querySelectorAll("svg.chart").length') >= 8
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
def test_the_first_screen_has_both_answers_and_buttons_copy(result, tmp_path, browser):
    browser.show(written(tmp_path, report_html(result)), width=1400, height=900)
    ends = browser.run('return [...document.querySelectorAll(".forecast, .copy-for, .remarks")]'
                       '.map(item => item.getBoundingClientRect().bottom)')
    assert [end < 900 for end in ends] == [True] * 4
    browser.run('navigator.clipboard.writeText = async text => { window.copied = text; };')
    for click, consumer in (
            ('document.getElementById("consumer").value = "px4";'
             'document.getElementById("copy-for").click();', 'px4'),
            ('document.querySelector(".config").open = true;'
             'document.querySelector(".config .copy").click();', 'kalibr')):
        browser.run(click)
        time.sleep(0.2)
        assert browser.run('return window.copied') == export(result, consumer)
    assert browser.run('return document.querySelector(".config .copy").textContent') == 'Copied'


@needs_browser
@pytest.mark.parametrize('dark', [False, True])
@pytest.mark.parametrize('width', [400, 1400])
def test_nothing_overlaps_overflows_or_is_too_faint(result, tmp_path, browser, width, dark):
    assert faults_of(written(tmp_path, report_html(result)), browser, width, dark) == []
    assert browser.run('return getComputedStyle(document.body).backgroundColor') == (
        'rgb(22, 24, 28)' if dark else 'rgb(255, 255, 255)')
    shown = browser.run('return [...document.querySelectorAll("#gyro-allan svg")]'
                        '.filter(item => item.clientWidth).map(item => item.classList[1])')
    assert shown == ['on-phone' if width < 600 else 'at-desk']


@needs_browser
def test_print_is_two_light_pages_whatever_the_scheme(result, tmp_path, browser):
    assert len(pages_in_print(written(tmp_path, report_html(result)), browser)) == 2
    browser.cdp('Emulation.setEmulatedMedia', media='print', features=[
        {'name': 'prefers-color-scheme', 'value': 'dark'}])
    assert browser.run('return getComputedStyle(document.body).backgroundColor') == (
        'rgb(255, 255, 255)')
    assert browser.run('return document.querySelector(".configs").offsetParent === null')
    browser.cdp('Emulation.setEmulatedMedia', media='')


@needs_browser
def test_space_below_the_last_line_of_a_printed_page_takes_no_page(page, tmp_path, browser):
    # In pixels, within the margins of A4.
    width, height = (round(size / 25.4 * 96) for size in (188, 275))
    browser.show(written(tmp_path, page), width=width)
    browser.cdp('Emulation.setEmulatedMedia', media='print')
    end = browser.run('return document.querySelector(".terms").getBoundingClientRect().bottom')
    browser.cdp('Emulation.setEmulatedMedia', media='')
    filled = page.replace(
        '</head>', f'<style>@media print {{ header {{ padding-bottom: {height - end - 100}px; }} '
        '.terms::after { content: "end"; display: block; margin-bottom: 200px; } }</style></head>')
    assert len(pages_in_print(written(tmp_path, filled), browser)) == 2


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
