# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace
from itertools import combinations
from math import degrees, sqrt
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

from changed import with_axes
import imu_allan
from imu_allan.characterization.axis import characterize
from imu_allan.finding import Finding
from imu_allan.noise.fitted_model import with_model_curve
from imu_allan.noise.simulate import simulate
from imu_allan.noise.terms import allan_variance
from imu_allan.noise.uncertainty import bounded
from imu_allan.result import (
    Curve,
    DriftModel,
    GaussMarkov,
    PowerLaw,
    Signal,
    Source,
    Span,
    Spectrum,
    Timeline,
    Tone,
)
from imu_allan.writers import curves, panels, plot
from imu_allan.writers.charts import allan_chart
from imu_allan.writers.figure_style import COLOURS, DARK
from imu_allan.writers.svg import power_text
import matplotlib
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Text
import numpy as np
from on_terminal import FLAT
import pytest
from whole_lines import refused


@pytest.mark.parametrize(('kind', 'start'), [
    ('png', b'\x89PNG'), ('svg', b'<?xml'), ('pdf', b'%PDF')])
def test_a_sheet_is_drawn_in_every_format_and_always_the_same(result, kind, start):
    before = dict(matplotlib.rcParams)
    one, other = (plot.render(plot.paper_figure(result, 8.5), kind, 50) for _ in range(2))
    assert one.startswith(start)
    assert one == other
    # The caller's settings are left alone.
    assert dict(matplotlib.rcParams) == before


def test_where_no_model_describes_the_samples_none_is_drawn(result):
    axis = result.axes['gyro_x']
    axis = replace(axis, curve=replace(axis.curve, model_adev=(0.0,) * len(axis.curve.tau_s)))
    assert not len(curves.model_curve(axis, result.timeline)[0])
    assert np.isnan(curves.model_density(axis, np.array([0.1, 1.0]), 100.0)).all()
    for one, lines in ((axis, 2), (result.axes['gyro_x'], 4)):
        panel = Figure().add_subplot()
        panels.draw_curve(panel, one, 'black', timeline=result.timeline)
        assert sum(len(line.get_xdata()) > 0 for line in panel.lines) == lines
        page = allan_chart('gyro', {'gyro_x': one}, result.timeline).svg
        assert ('class="curve model"' in page) == (lines == 4)


def texts_of(figure):
    texts = [text.get_text() for text in figure.texts]
    for panel in figure.axes:
        texts += [text.get_text() for text in panel.texts]
        texts += [panel.get_xlabel(), panel.get_ylabel()]
        texts += [child.get_ylabel() for child in panel.child_axes]
    return texts


def angular(figure):
    """Give the panel of the Allan deviation of the gyroscope."""
    return next(panel for panel in figure.axes if 'angular' in panel.get_ylabel())


def test_left_is_the_unit_of_the_table_right_si_and_the_numbers_are_round(result):
    figure = plot.overview_figure(result)
    assert {'Allan deviation of angular rate [°/h]', '[rad/s]',
            'Allan deviation of acceleration [µg]', '[m/s²]'} <= {*texts_of(figure)}
    plot.render(figure, 'png', 30)
    panel = angular(figure)
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
    panel = figure.axes[0]
    rings = [(float(line.get_xdata()[0]), float(line.get_ydata()[0])) for line in panel.lines
             if line.get_markerfacecolor() == 'none']
    values = curves.coefficients_of(result.axes['gyro_x'])
    assert len(rings) == 3
    assert (1.0, pytest.approx(values['noise_density'])) in rings
    assert (3.0, pytest.approx(values['rate_random_walk'])) in rings
    floor = pytest.approx(0.66428 * values['bias_instability'], rel=1e-4)
    assert any(height == floor for _, height in rings)
    texts = texts_of(figure)
    assert 'N = 2.406 °/√h\nslope −½, read at 1 s' in texts
    assert 'K = 50 °/h/√h\nslope +½, read at 3 s' in texts
    assert 'B = 24.8 °/h\nslope 0, at 0.664 B' in texts
    assert 'tone 23.4 Hz' in texts


def test_the_ring_of_b_stands_where_the_curve_is_lowest_beside_a_correlated_process(result):
    process = GaussMarkov(2e-3, 3000.0)
    axis = result.axes['gyro_z']
    bumped = replace(axis, gauss_markov=process, drift_model=DriftModel(
        axis.drift_model.noise_density, 0.0, (process,), 0.1, 3600.0))
    figure = plot.sensor_figure(replace(result, axes={'gyro_z': bumped}), 'gyro')
    at = [float(line.get_xdata()[0]) for line in figure.axes[0].lines
          if line.get_markerfacecolor() == 'none']
    # N alone falls to where the process, seen from short times, rises: N/sqrt(tau) against
    # sigma sqrt(2 tau / (3 T)).
    lowest = sqrt(3 * 3000.0 / 2) * axis.drift_model.noise_density / 2e-3
    assert [round(tau / lowest, 1) for tau in at if tau != 1.0] == [1.0]
    assert not covering(figure)


def covering(figure):
    """Pairs of names in the first panel that are written over one another."""
    plot.render(figure, 'png', 60)
    texts = [text for text in figure.axes[0].texts if text.get_text()]
    boxes = [text.get_bbox_patch().get_window_extent() for text in texts]
    return [(a.get_text(), b.get_text()) for (a, one), (b, other)
            in combinations(zip(texts, boxes, strict=True), 2) if one.overlaps(other)]


def test_a_point_beyond_the_axes_leaves_an_arrow_at_their_edge(result):
    def far(axis):
        curve = axis.curve
        return replace(axis, curve=replace(
            curve, adev=(*curve.adev[:-1], curve.adev[-1] * 1e-3),
            edf=(*curve.edf[:-1], 1.0)))

    def arrows(sheet):
        panel = next(p for p in sheet.axes if 'Allan' in p.get_ylabel())
        return [text.xy for text in panel.texts if not text.get_text()], panel.get_ylim()[0]

    axis = result.axes['gyro_x']
    bent = replace(result, axes={'gyro_x': far(axis)})
    for figure in (plot.overview_figure, lambda r: plot.sensor_figure(r, 'gyro'),
                   lambda r: plot.paper_figure(r, 8.5)):
        found, bottom = arrows(figure(bent))
        assert found == [(axis.curve.tau_s[-1], bottom)]
        assert arrows(figure(result))[0] == []
    assert any('arrow: a point beyond' in text for text in texts_of(plot.overview_figure(bent)))


def test_the_temperature_stands_beside_the_signal(result):
    warmth = Signal(450.0, (20.0,) * 8, (20.0, 21.0, *[22.0] * 6), (23.0,) * 8)
    figure = plot.overview_figure(replace(result, temperature=warmth))
    shown = [line.get_ydata().tolist() for panel in figure.axes for line in panel.lines]
    assert shown.count(list(warmth.mean)) == 2
    assert '- - temperature [°C]' in plot.render(figure, 'svg').decode()


def test_a_sensor_without_any_coefficient_shows_the_bounds(result, make_axis):
    figure = plot.overview_figure(replace(result, axes={
        'gyro_x': make_axis('gyro_x', {}, {'noise_density': 2e-3},
                            curve=result.axes['gyro_x'].curve)}))
    assert 'not observable, < 6.88' in texts_of(figure)


def test_the_overview_says_in_the_place_of_b_which_axis_has_another_exponent(result, make_axis):
    axes = {name: make_axis(name, {'noise_density': 1e-3}, {'bias_instability': 1e-4})
            for name in ('gyro_x', 'gyro_y')}
    axes['gyro_x'] = replace(axes['gyro_x'], power_law=PowerLaw(0.7, (0.68, 0.72), 1e-9))
    figure = plot.overview_figure(replace(result, axes=axes))
    texts = texts_of(figure)
    assert 'B  [°/h]' in texts
    assert 'no flicker, 1/f^0.70, < 20.6' in texts
    assert 'not observable, < 20.6' in texts
    figure.draw_without_rendering()
    # With four columns, too, it stays clear of the one before it.
    [cell] = [text for panel in figure.axes for text in panel.texts
              if text.get_text().startswith('no flicker')]
    quarter = cell.axes.get_window_extent().width * 0.95 / 4
    assert cell.get_window_extent().width < quarter


def test_no_model_is_drawn_beyond_the_band_that_was_fitted(result):
    axis = replace(result.axes['gyro_x'], band_edge_hz=5.0)
    density = curves.model_density(axis, np.array([0.1, 5.0, 5.1, 50.0]), 200.0)
    assert np.isfinite(density).tolist() == [True, True, False, False]
    tau, adev, _ = curves.model_curve(axis, result.timeline)
    whole = curves.model_curve(result.axes['gyro_x'], result.timeline).tau
    # Shorter averages than a period of the edge scatter by what lies beyond it.
    assert tau[0] == pytest.approx(0.2, rel=0.1)
    assert tau[0] >= 0.2 > whole[0]
    assert len(tau) == len(adev)
    # A comparison draws the model at the averaging times of the curve.
    panel = Figure().add_subplot()
    panels.draw_curve(panel, axis, 'black')
    assert panel.lines[0].get_xdata()[0] >= 0.2
    figure = plot.sensor_figure(replace(result, axes={'gyro_x': axis}), 'gyro')
    assert 'shaded: not fitted' in texts_of(figure)
    assert 'shaded: not fitted' not in texts_of(plot.sensor_figure(result, 'gyro'))


def test_the_line_that_is_drawn_is_the_curve_of_the_result(result):
    samples = simulate({'noise_density': 1e-3, 'rate_random_walk': 1e-4}, 60_000, 100.0, seed=3)
    axis = bounded(characterize(samples, 100.0))
    curve, timeline = axis.curve, replace(result.timeline, sample_rate_hz=100.0)
    drawn = curves.model_curve(axis, timeline)
    for end in (0, -1):
        assert drawn.tau[end] == pytest.approx(curve.tau_s[end])
        assert drawn.adev[end] == pytest.approx(curve.model_adev[end])


def test_a_term_that_is_only_bounded_is_a_dashed_line_at_its_bound(result, make_axis):
    axis = make_axis('gyro_x', {'noise_density': 1e-3, 'bias_instability': 1e-5},
                     {'rate_random_walk': 1e-3})
    tau, adev, bound = curves.model_curve(axis, result.timeline)
    assert bound[-1]**2 == pytest.approx(adev[-1]**2 + 1e-3**2 * tau[-1] / 3)
    # Over short times it would lie on the line.
    assert np.isnan(bound[0])
    panel = Figure().add_subplot()
    panels.draw_curve(panel, axis, 'black', timeline=result.timeline)
    assert '--' in [line.get_linestyle() for line in panel.lines]
    assert 'class="bound"' in allan_chart('gyro', {'gyro_x': axis}, result.timeline).svg
    known = make_axis('gyro_x', {'noise_density': 1e-3, 'bias_instability': 1e-5,
                                 'rate_random_walk': 1e-3})
    assert np.isnan(curves.model_curve(known, result.timeline).bound).all()
    assert 'class="bound"' not in allan_chart('gyro', {'gyro_x': known}, result.timeline).svg


def test_an_axis_of_which_only_bounds_are_known_is_drawn_with_its_bounds(result, make_axis):
    axis = make_axis('gyro_x', {}, {'noise_density': 1e-3, 'bias_instability': 1e-5,
                                    'rate_random_walk': 1e-7})
    axis = with_model_curve(replace(axis, tones=(Tone(20.0, 1e-3),)))
    assert not any(axis.curve.model_adev)
    tau, adev, bound = curves.model_curve(axis, result.timeline)
    assert np.isnan(adev).all()
    assert bound[0] == pytest.approx(1e-3 / sqrt(tau[0]))
    measured = replace(axis.curve, adev=tuple(0.9e-3 / np.sqrt(axis.curve.tau_s)))
    axes = {'gyro_x': replace(axis, curve=measured)}
    chart = allan_chart('gyro', axes, result.timeline)
    assert 'class="bound"' in chart.svg
    assert 'class="curve model"' not in chart.svg
    plot.render(plot.overview_figure(replace(result, axes=axes)))


def test_the_integral_of_the_model_spectrum_is_the_allan_variance(make_axis):
    values = {'noise_density': 1e-3, 'bias_instability': 2e-4, 'rate_random_walk': 1e-4}
    axis = make_axis('gyro_x', values)
    rate, m = 50.0, 40
    frequency = (np.arange(400_000) + 0.5) / 400_000 * rate / 2
    density = curves.model_density(axis, frequency, rate)
    nu = frequency / rate
    kernel = 2 * np.sin(np.pi * m * nu)**4 / (m * np.sin(np.pi * nu))**2
    variance = 2 * np.sum(density * kernel) * (frequency[1] - frequency[0])
    assert variance == pytest.approx(float(allan_variance(values, [m / rate])[0]), rel=1e-3)


def test_a_measured_spectrum_is_drawn_where_it_is_given(result):
    bare, drawn = (plot.sensor_figure(one, 'gyro').axes for one in (result, with_axes(
        result, 'gyro_x', spectrum=Spectrum((0.1, 1.0), (5e-7, 4e-7)))))
    more = [len(after.lines) - len(before.lines)
            for before, after in zip(bare, drawn, strict=True)]
    assert sorted(more) == [0] * (len(more) - 1) + [1]


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


def test_odd_results_are_drawn_too(result, make_axis):
    nothing = Curve((), (), (), (), (), ())
    odd = replace(result, axes={
        'gyro_x': make_axis('gyro_x', {}, curve=nothing),
        'gyro_z': make_axis('gyro_z', {}, curve=FLAT)},
        timeline=Timeline(None, 0, 0.0), source=Source('topic', None, None, None, None, None))
    assert plot.render(plot.overview_figure(odd), 'png', 40)
    assert plot.render(plot.sensor_figure(odd, 'gyro'), 'png', 40)
    assert ('gyro z: every sample is the same, there is no noise to draw; gyro x: too few samples'
            in texts_of(plot.overview_figure(odd)))
    assert 'constant signal:\nAllan deviation 0' in texts_of(plot.sensor_figure(odd, 'gyro'))
    assert plot.render(plot.overview_figure(replace(odd, axes={})), 'png', 40)
    with refused("the result has no axis of the sensor 'accel'"):
        plot.sensor_figure(odd, 'accel')
    with refused('no axis of the result has an Allan deviation above zero to draw'):
        plot.paper_figure(odd, 8.5)


def test_names_from_a_recording_are_text_and_not_formulas(result, recwarn):
    nasty = '$\\frac{$ \x1b[0m \u4e2d \\undefined'
    named = replace(result, source=Source('recording', nasty, nasty, nasty, nasty, 'header'),
                    warnings=(Finding('x', message=nasty),))
    svg = plot.render(plot.overview_figure(named), 'svg')
    ElementTree.fromstring(svg)
    assert not [w for w in recwarn if 'lyph' in str(w.message)]


def brightness(colour):
    return float(np.dot([0.2126, 0.7152, 0.0722], linear(colour)))


ON_DARK = {name: DARK.get(colour, colour) for name, colour in COLOURS.items()}


@pytest.mark.parametrize('colours', [COLOURS, ON_DARK], ids=['light', 'dark'])
def test_every_colour_stands_out_from_its_paper(colours):
    """WCAG 2.1: 3 to 1 for graphics, 4.5 to 1 for text."""
    paper = brightness(colours['paper'])
    for name, least in (('x', 3), ('y', 3), ('z', 3), ('ink', 4.5), ('soft', 4.5)):
        ink = brightness(colours[name])
        assert (max(ink, paper) + 0.05) / (min(ink, paper) + 0.05) >= least, name


def linear(colour):
    return np.array([c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055)**2.4
                     for c in to_rgb(colour)])


def cie_lab(rgb):
    xyz = np.array([[.4124, .3576, .1805], [.2126, .7152, .0722], [.0193, .1192, .9505]]) @ \
        np.clip(rgb, 0, 1) / [0.9505, 1, 1.089]
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


# Machado, Oliveira and Fernandes 2009, severity 1.
VISION = {
    'protanopia': [[.152286, 1.052583, -.204868], [.114503, .786281, .099216],
                   [-.003882, -.048116, 1.051998]],
    'deuteranopia': [[.367322, .860646, -.227968], [.280085, .672501, .047413],
                     [-.011820, .042940, .968881]],
    'tritanopia': [[1.255528, -.076749, -.178779], [-.078411, .930809, .147602],
                   [.004733, .691367, .303900]],
    'ordinary': np.eye(3)}


@pytest.mark.parametrize('colours', [COLOURS, ON_DARK], ids=['light', 'dark'])
@pytest.mark.parametrize('vision', VISION)
def test_the_axes_stay_apart_in_colour_blind_vision(colours, vision):
    """A difference of 25 in CIE Lab is ten times what is just noticed."""
    x, y, z = (cie_lab(np.array(VISION[vision]) @ linear(colours[axis])) for axis in 'xyz')
    assert min(np.linalg.norm(x - y), np.linalg.norm(x - z), np.linalg.norm(y - z)) > 25


def test_drawing_needs_no_display_and_no_pyplot():
    script = ('import sys; from imu_allan.writers import plot; '
              'assert "matplotlib" not in sys.modules; plot.empty_figure(1, 1); '
              'assert "matplotlib.pyplot" not in sys.modules')
    subprocess.run([sys.executable, '-c', script], check=True)


@pytest.mark.parametrize('width_cm', [8.5, 17.0])
def test_a_figure_for_a_paper_has_its_column_s_width_and_text_that_survives(result, width_cm):
    figure = plot.paper_figure(result, width_cm)
    assert figure.get_figwidth() == pytest.approx(width_cm / 2.54)
    plot.render(figure, 'png', 100)
    assert [[name.get_text() for name in panel.get_legend().get_texts()]
            for panel in figure.axes] == [[*'xyz']] * 2
    paper = figure.bbox
    boxes = []
    for text in figure.findobj(Text):
        # Numbers beside an axis that lie outside of it are there and not drawn.
        box = text.get_window_extent()
        if not (text.get_visible() and text.get_text().strip()) or text in hidden_ticks(figure):
            continue
        assert text.get_fontsize() >= 7, text.get_text()
        assert paper.x0 <= box.x0 < box.x1 <= paper.x1, text.get_text()
        assert paper.y0 <= box.y0 < box.y1 <= paper.y1, text.get_text()
        boxes.append((text.get_text(), box))
    for place, (one, box) in enumerate(boxes):
        assert not [other for other, its in boxes[:place] if box.overlaps(its)], one


def hidden_ticks(figure):
    """Return the numbers that lie beyond the ends of their axis."""
    hidden = []
    beside = [child for panel in figure.axes for child in panel.child_axes]
    for panel in [*figure.axes, *beside]:
        for axis in (panel.xaxis, panel.yaxis):
            low, high = sorted(axis.get_view_interval())
            for tick in axis.get_major_ticks():
                if not low <= tick.get_loc() <= high:
                    hidden += [tick.label1, tick.label2]
    return hidden


def test_the_means_over_time_are_distinguished_without_colour(filtered):
    figure = plot.overview_figure(filtered)
    strip = figure.axes[-1]
    marks = [line for line in strip.lines if line.get_linestyle() == 'None']
    assert [line.get_marker() for line in marks] == ['o', 's', '^']
    places = [set(line.get_xdata()) for line in marks]
    assert all(len(one) == 8 for one in places)
    assert len(set.union(*places)) == 24


def test_plot_gives_a_figure_and_takes_a_result_alone(result):
    assert imu_allan.plot(result).savefig
    with pytest.raises(TypeError) as error:
        imu_allan.plot(result.axes['gyro_x'])
    assert error.value.args == (
        'expected a result, such as imu_allan.analyze gives, not AxisResult',)
