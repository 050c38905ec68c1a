# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The reports as files and as pages: the latter in a real browser, where there is one."""

from base64 import b64encode
from dataclasses import replace
from hashlib import sha256
from html.parser import HTMLParser
import json
import re
import time

from browser import CHROMIUM, DRIVER, running_browser
from imu_allan.result import GaussMarkov, GoodnessOfFit, Remark, Source, Spectrum, Timeline
from imu_allan.writers.filters import export
from imu_allan.writers.report import comparison_html, report_html
import pytest

needs_browser = pytest.mark.skipif(not (CHROMIUM and DRIVER),
                                   reason='chromium and chromedriver are not installed')
NASTY = '</script><script>window.evil=1</script><img src=x onerror="window.evil=2">&amp;{{7*7}}'


class Outline(HTMLParser):
    """Visible text, tags and scripts of a page."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.words, self.scripts, self.inside = [], [], [], None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag in ('script', 'style'):
            self.inside = tag
            if tag == 'script':
                self.scripts.append('')

    def handle_endtag(self, tag):
        if tag == self.inside:
            self.inside = None

    def handle_data(self, data):
        if self.inside == 'script':
            self.scripts[-1] += data
        elif self.inside is None:
            self.words.append(data)

    @property
    def text(self):
        return ' '.join(' '.join(self.words).split())


@pytest.fixture(scope='module')
def browser():
    with running_browser() as browser:
        yield browser


def written(tmp_path, text):
    (tmp_path / 'report.html').write_text(text, encoding='utf-8')
    return tmp_path / 'report.html'


def test_the_report_shows_values_intervals_bounds_and_warnings(result):
    text = Outline(report_html(result)).text
    for part in ('2.406 2.402 – 2.411', '°/√h', 'not observable, below 23.51',
                 'The IMU moved twice, 345 s in all', 'Tones: gyro z 23.4 Hz (41.25 °/h), 46.8 Hz',
                 '2,160,000 samples at 200 Hz',
                 '2 × motion or knocks, left out, 5 min 45 s in all',
                 '2 × gaps without samples, 6 s in all', 'frame imu_link'):
        assert part in text


def test_findings_of_an_axis_are_told_in_words(result):
    axis = replace(result.axes['gyro_x'], band_limit_s=0.04,
                   goodness_of_fit=GoodnessOfFit(None, None, False),
                   gauss_markov=GaussMarkov(1e-3, 300.0))
    text = Outline(report_html(replace(result, axes={'gyro_x': axis}))).text
    assert 'Low-passed before it is sampled, with an effective window of: gyro x 40 ms.' in text
    assert 'No model of the five terms describes gyro x well' in text
    assert 'with a correlation time of 5 min' in text


def test_every_filter_config_can_be_copied_from_the_report(result):
    outline = Outline(report_html(result))
    for consumer in ('kalibr', 'px4', 'basalt'):
        lines = export(result, consumer).text.split()
        assert ' '.join(lines) in outline.text


def test_the_report_names_no_address_to_load_from(result):
    outline = Outline(report_html(result))
    for tag, attributes in outline.tags:
        for name in ('src', 'href', 'srcset', 'action', 'data'):
            value = attributes.get(name)
            assert value is None or value.startswith(('data:', '#')), (tag, value)
    style = re.search(r'<style>(.*?)</style>', report_html(result), re.DOTALL)[1]
    assert 'url(' not in style
    assert '@import' not in style


def test_the_security_policy_allows_the_scripts_it_has_and_no_other(result):
    outline = Outline(report_html(result))
    policy = next(attributes['content'] for tag, attributes in outline.tags
                  if attributes.get('http-equiv') == 'Content-Security-Policy')
    assert "default-src 'none'" in policy
    allowed = re.search('script-src ([^;]*)', policy)[1].split()
    programs = [script for script in outline.scripts if not script.startswith('[')]
    assert allowed == [f"'sha256-{b64encode(sha256(script.encode()).digest()).decode()}'"
                       for script in programs]


def test_the_numbers_of_the_charts_are_those_of_the_result(result):
    outline = Outline(report_html(result))
    charts = {chart['id']: chart for chart in json.loads(outline.scripts[0])}
    assert set(charts) == {'gyro-allan', 'gyro-psd', 'accel-allan', 'accel-psd'}
    points = next(trace for trace in charts['gyro-allan']['traces']
                  if trace['kind'] == 'points' and trace['group'] == 'y')
    curve = result.axes['gyro_y'].curve
    assert tuple(points['x']) == curve.tau_s
    assert tuple(points['y']) == curve.adev
    assert tuple(map(tuple, zip(points['low'], points['high'], strict=True))) == curve.ci95


def test_text_from_a_recording_stays_text(result):
    named = replace(result, source=Source('recording', NASTY, NASTY, NASTY, NASTY, 'header'),
                    imu_allan_version=NASTY, warnings=(Remark(NASTY, NASTY),))
    tame, evil = Outline(report_html(result)), Outline(report_html(named))
    assert [tag for tag, _ in evil.tags] == [tag for tag, _ in tame.tags]
    assert NASTY in evil.text
    compared = comparison_html({NASTY: named, 'other': result})
    assert '<script>window.evil' not in compared


@needs_browser
def test_the_page_asks_for_nothing_and_complains_of_nothing(result, tmp_path, browser):
    measured = replace(result.axes['gyro_x'], spectrum=Spectrum((0.1, 1.0), (1e-6, 9e-7)))
    page = written(tmp_path, report_html(
        replace(result, axes={**result.axes, 'gyro_x': measured})))
    browser.requests()
    browser.console()
    browser.show(page)
    asked = [url for url in browser.requests() if not url.startswith(('chrome:', 'data:'))]
    assert asked == [page.as_uri()]
    assert browser.console() == []
    assert browser.run('return document.querySelectorAll(".plot .main-svg").length') >= 4


@needs_browser
def test_axes_components_and_units_can_be_switched(result, tmp_path, browser):
    browser.show(written(tmp_path, report_html(result)))
    shown = ('return document.querySelector("#gyro-allan .plot").data'
             '.filter(trace => trace.visible).length')
    before = browser.run(shown)
    click = ('[...document.querySelectorAll("#gyro-allan label")]'
             '.find(item => item.textContent.trim() === "{}").click();')
    browser.run(click.format('its terms'))
    # N, B, K of x and y, N and B of z
    assert browser.run(shown) == before + 8
    browser.run(click.format('y axis'))
    # gone: its points, model, two bands and three terms
    assert browser.run(shown) == before + 8 - 7
    value = 'return document.querySelector("#gyro-allan .plot").data[3].y[0]'
    engineering = browser.run(value)
    browser.run('const choice = document.getElementById("units"); choice.value = "si";'
                'choice.dispatchEvent(new Event("change"))')
    assert browser.run(value) == pytest.approx(engineering / 206264.806247, rel=1e-9)
    assert browser.run('return document.querySelector("span.si b").offsetParent !== null')
    assert browser.run('return document.querySelector("span.engineering b").offsetParent === null')
    assert browser.console() == []


@needs_browser
def test_a_point_tells_its_value_and_interval_under_the_pointer(result, tmp_path, browser):
    browser.show(written(tmp_path, report_html(result)), height=1800)
    text = browser.run("""
        const place = document.querySelector('#gyro-allan .plot');
        const number = place.data.findIndex(trace => trace.customdata);
        Plotly.Fx.hover(place, [{curveNumber: number, pointNumber: 0}]);
        return place.querySelector('.hoverlayer').textContent;""")
    assert 'x axis' in text
    assert 'τ = 0.005 s' in text
    assert '95 %: 2040 – 2044' in text


@needs_browser
def test_a_config_is_copied_by_its_button(result, tmp_path, browser):
    browser.show(written(tmp_path, report_html(result)))
    browser.run("""
        const config = document.querySelector('.config');
        config.open = true;
        document.addEventListener('copy', event => {
            window.copied = document.getSelection().toString(); });
        navigator.clipboard.writeText = async text => { window.copied = text; };
        config.querySelector('.copy').click();""")
    time.sleep(0.2)
    assert browser.run('return window.copied') == export(result, 'kalibr').text
    assert browser.run('return document.querySelector(".config .copy").textContent') == 'Copied'


@needs_browser
@pytest.mark.parametrize('dark', [False, True])
def test_the_page_fits_a_phone_and_follows_dark_mode(result, tmp_path, browser, dark):
    browser.show(written(tmp_path, report_html(result)), width=390, height=844, phone=True,
                 dark=dark)
    assert browser.run('return document.documentElement.scrollWidth') <= 390
    assert browser.run('return getComputedStyle(document.body).backgroundColor') == (
        'rgb(22, 24, 28)' if dark else 'rgb(255, 255, 255)')
    paper = browser.run('return document.querySelector("#gyro-allan .plot")'
                        '._fullLayout.paper_bgcolor')
    assert paper == ('#16181c' if dark else '#ffffff')
    width = browser.run('return document.querySelector("#gyro-allan .main-svg").clientWidth')
    assert 300 < width <= 390


@needs_browser
def test_no_script_from_a_recording_runs(result, tmp_path, browser):
    named = replace(result, source=Source('recording', NASTY, NASTY, NASTY, NASTY, 'header'),
                    warnings=(Remark(NASTY, NASTY),))
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
    labels = browser.run('return [...document.querySelectorAll("#gyro_x .group")]'
                         '.map(item => item.textContent.trim())')
    assert labels == ['monday', 'friday']
    assert browser.run('return document.querySelectorAll(".chart").length') == 6
    assert '+138.68' in browser.run('return document.body.innerText')


@needs_browser
def test_a_result_of_nothing_gives_a_page(result, tmp_path, browser):
    empty = replace(result, axes={}, warnings=(), timeline=Timeline(None, 0, 0.0),
                    source=Source('topic', None, None, None, None, None))
    browser.show(written(tmp_path, report_html(empty)))
    assert 'No gap and no motion' in browser.run('return document.body.innerText')
    assert browser.console() == []
