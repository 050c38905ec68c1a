# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace
from math import degrees
import re
import xml.etree.ElementTree as ElementTree

from exact_results import axis_result, only, with_axes
import imu_allan
from imu_allan.finding import Finding
from imu_allan.result import Curve, Inspection, Signal, Source, Span, Timeline, Total
from imu_allan.writers import charts, curves, plot
from imu_allan.writers.fleet import Fleet
from imu_allan.writers.report import report_html
from imu_allan.writers.svg import power_text
import matplotlib
from matplotlib.text import Text
from on_terminal import FLAT
from processes import python
import pytest


@pytest.mark.parametrize(('kind', 'start'), [
    ('png', b'\x89PNG'), ('svg', b'<?xml'), ('pdf', b'%PDF')])
def test_a_sheet_is_drawn_in_every_format_and_always_the_same(result, kind, start):
    before = dict(matplotlib.rcParams)
    one, other = (plot.render(plot.overview_figure(result), kind, 30) for _ in range(2))
    assert one.startswith(start)
    assert one == other
    # The caller's settings are left alone.
    assert dict(matplotlib.rcParams) == before


def texts_of(figure):
    return [text.get_text() for text in figure.findobj(Text)]


@pytest.mark.parametrize('axes', ['', 'accel', 'accel_x'])
def test_no_text_lies_over_another_or_beyond_the_edge(result, axes):
    assert result.timeline.gaps
    assert result.timeline.motion
    warm = only(replace(
        result, temperature=result.axes['gyro_x'].signal, inspection=Inspection(
            serial='IMU-2026-000123', operator='Jane Doe', station='line 3, bench 2')), axes)
    for figure in (plot.overview_figure(warm), plot.sensor_figure(warm, 'accel')):
        figure.draw_without_rendering()
        page = figure.bbox.padded(1)
        # Of the numbers at ticks, those beyond the limits are not drawn.
        boxes = [(text.get_text(), text.get_window_extent()) for text in figure.findobj(Text)
                 if re.search('[a-z]', text.get_text()) and text.get_visible()]
        for place, (text, box) in enumerate(boxes):
            assert page.x0 <= box.x0 < box.x1 <= page.x1, text
            assert not [other for other, of in boxes[place + 1:] if (
                min(box.x1, of.x1) - max(box.x0, of.x0) > 1
                and min(box.y1, of.y1) - max(box.y0, of.y0) > 1)], text


def test_picture_and_page_count_gaps_and_motion_that_are_not_listed(result):
    many = replace(result, timeline=replace(
        result.timeline, all_gaps=Total(5000, 9000.0), all_motion=Total(1200, 3600.0)))
    assert {*texts_of(plot.overview_figure(many))} >= {
        '5000 × gap (2 h 30 min)', '1200 × motion, left out (60 min)'}
    page = report_html(many)
    assert '5000 × gaps without samples, 2 h 30 min in all' in page
    assert '1200 × motion or knocks, left out, 60 min in all' in page


def test_left_is_the_unit_of_the_table_right_si_and_the_numbers_are_round(result):
    figure = plot.overview_figure(result)
    assert {'Allan deviation of angular rate [°/h]', '[rad/s]',
            'Allan deviation of acceleration [µg]', '[m/s²]'} <= {*texts_of(figure)}
    plot.render(figure, 'png', 30)
    panel = next(panel for panel in figure.axes if 'angular' in panel.get_ylabel())
    (second,) = panel.child_axes
    assert second.get_ylim() == panel.get_ylim()
    low, high = panel.get_ylim()
    for axes, factor in ((panel, 206264.806247), (second, 1.0)):
        shown = {value * factor: label.get_text() for value, label in zip(
            axes.get_yticks(), axes.get_yticklabels(), strict=True) if low <= value <= high}
        assert len(shown) >= 2
        assert shown == {value: power_text(value) for value in shown}
        assert {f'{value:.3e}'[:5] for value in shown} <= {'1.000', '2.000', '5.000'}


def test_each_coefficient_has_a_ring_where_it_is_read(result):
    figure = plot.sensor_figure(result, 'gyro')
    values = curves.coefficients_of(result.axes['gyro_x'])
    [walk, flicker, white] = sorted(
        (float(line.get_ydata()[0]), float(line.get_xdata()[0])) for line in figure.axes[0].lines
        if line.get_markerfacecolor() == 'none')
    assert walk == (pytest.approx(values['rate_random_walk']), 3.0)
    assert flicker[0] == pytest.approx(0.66428 * values['bias_instability'], rel=1e-4)
    assert white == (pytest.approx(values['noise_density']), 1.0)
    assert {*texts_of(figure)} >= {
        'N = 2.406 °/√h\nslope −½, read at 1 s', 'K = 50 °/h/√h\nslope +½, read at 3 s',
        'B = 24.8 °/h\nslope 0, at 0.664 B', 'tone 23.4 Hz'}


def test_a_spectrum_ends_at_half_the_rate_of_its_own_sensor(result):
    halves = with_axes(result, 'accel', sample_rate_hz=50.0)
    panel = plot.sensor_figure(halves, 'accel').axes[1]
    assert panel.get_xlabel() == 'frequency [Hz]'
    assert max(max(line.get_xdata()) for line in panel.lines) == pytest.approx(25.0)
    accel = {name: axis for name, axis in halves.axes.items() if name.startswith('accel')}
    svg = charts.density_chart('accel', accel, halves.timeline).svg
    assert ('>10<' in svg, '>100<' in svg) == (True, False)


def test_the_strip_shows_a_warm_up_gaps_and_motion_at_their_time(result):
    # The mean of the first of eight segments lies far from the others.
    signal = Signal(450.0, (-1.0,) * 8, (0.5, *[0.0] * 7), (1.0,) * 8)
    figure = plot.overview_figure(replace(
        with_axes(result, signal=signal),
        timeline=Timeline(100.0, 100, 10_000.0, gaps=(Span(2500.0, 100.0),),
                          motion=(Span(5000.0, 1000.0),))))
    strips = [panel for panel in figure.axes if panel.get_xlabel() == 'time [h]']
    assert len(strips) == 2
    hours = 1 / 3600
    for strip in strips:
        shown = [bar.get_window_extent().transformed(strip.transData.inverted())
                 for bar in strip.patches]
        assert sorted((box.x0, box.width) for box in shown) == [
            (pytest.approx(2500 * hours), pytest.approx(100 * hours)),
            (pytest.approx(5000 * hours), pytest.approx(1000 * hours))]
    for line in strips[0].lines:
        shown = line.get_ydata()
        assert shown[0] - shown[1] == pytest.approx(degrees(0.5))
        assert sum(shown) == pytest.approx(0, abs=1e-9)
    # A joint result has no means over time.
    joint = plot.overview_figure(replace(
        with_axes(result, signal=None), timeline=Timeline(100.0, 100, 10_000.0)))
    strips = [panel for panel in joint.axes if panel.get_xlabel() == 'time [h]']
    assert [strip.axison for strip in strips] == [False, False]


def test_odd_results_are_drawn_too_and_names_are_text_and_no_formulas(result, recwarn):
    nothing, nasty = Curve((), (), (), (), (), ()), '$\\frac{$ \x1b[0m \u4e2d \\undefined'
    odd = replace(result, axes={
        'gyro_x': axis_result('gyro_x', {}, curve=nothing),
        'gyro_z': axis_result('gyro_z', {}, curve=FLAT)},
        timeline=Timeline(None, 0, 0.0), source=Source('topic', nasty, nasty, nasty, nasty, None),
        warnings=(Finding('x', message=nasty),))
    ElementTree.fromstring(plot.render(plot.overview_figure(odd), 'svg'))
    assert not [one for one in recwarn if 'lyph' in str(one.message)]
    assert plot.render(plot.sensor_figure(odd, 'gyro'), 'png', 40)
    assert ('gyro z: every sample is the same, there is no noise to draw; gyro x: too few samples'
            in texts_of(plot.overview_figure(odd)))
    assert 'constant signal:\nAllan deviation 0' in texts_of(plot.sensor_figure(odd, 'gyro'))
    assert plot.render(plot.overview_figure(replace(odd, axes={})), 'png', 40)


def test_that_one_of_two_is_constant_is_not_written_over_the_curve_of_the_other(result):
    dead = replace(result, axes={'gyro_x': axis_result('gyro_x', {}, curve=FLAT)})
    both = {'one': result, 'dead': dead}
    figure = plot.curves_figure(both, Fleet(both).population)
    figure.draw_without_rendering()
    [said] = [text for text in figure.findobj(Text) if 'constant' in text.get_text()]
    for line in said.axes.lines:
        points = said.axes.transData.transform(line.get_xydata())
        assert not said.get_window_extent().count_contains(points)


def test_drawing_needs_no_display_and_no_pyplot():
    script = ('import sys; from imu_allan.writers import panels, plot; '
              'assert "matplotlib" not in sys.modules; panels.empty_figure(1, 1); '
              'assert "matplotlib.pyplot" not in sys.modules')
    python('-c', script, check=True)


def test_plot_gives_a_figure_of_a_result_or_one_axis_of_it(result):
    assert imu_allan.plot(result).savefig
    [panel] = imu_allan.plot(result.axes['accel_x']).axes
    drawn = {height for line in panel.lines for height in line.get_ydata()}
    assert {*result.axes['accel_x'].curve.adev} <= drawn
    with pytest.raises(TypeError) as error:
        imu_allan.plot(result.axes)
    assert error.value.args == ('expected a result, such as imu_allan.analyze gives, or one of '
                                'its axes, not dict',)
