# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The panels of all figures: their style and frame, Allan deviation with its terms, spectrum, signal.

The colours of the three axes are distinguishable with colour-blind vision, their markers and
dashes also in greyscale print. Figures use matplotlib's object interface and its built-in
defaults, without pyplot or a display, and independently of files in the current folder.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import inf
from typing import Any, TYPE_CHECKING
import warnings

from imu_allan.arrays import Array
from imu_allan.noise.fitted_model import FittedModel
from imu_allan.noise.terms import AXES, FLICKER_FLOOR, TERMS
from imu_allan.result import AxisResult, Result, Timeline
from imu_allan.sensor.units import convert, engineering, MEAN_UNITS, typeset
from imu_allan.wording import duration, SAMPLES
from imu_allan.writers import curves
from imu_allan.writers.svg import best_place, Box, FONT, LETTER, power_text
import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

# After Okabe and Ito's palette for colour-blind readers. The blue is deeper, as theirs resembles
# the green to tritanopes.
COLOURS = {'x': '#d55e00', 'y': '#009e73', 'z': '#2340a0', 'ink': '#1a1a1a', 'soft': '#6b6b6b',
           'grid': '#e3e3e3', 'paper': '#ffffff', 'gap': '#8c8c8c', 'motion': '#e69f00',
           'good': '#eef3f7'}
SERIES = (COLOURS['z'], COLOURS['x'], COLOURS['y'], '#cc79a7', '#b8860b', '#56b4e9', '#6b6b6b')
"""Colours of results that are compared; no more than seven can be distinguished."""
MARKERS = {'x': 'o', 'y': 's', 'z': '^'}
DASHES: dict[str, str | tuple[int, tuple[float, ...]]] = {
    'x': '-', 'y': (0, (5.0, 1.3)), 'z': (0, (8.0, 1.3, 1.6, 1.3))}
"""Dashes of the model lines if several axes share a panel: x and y look the same in greyscale."""
_TERM_DASHES: dict[str, Any] = {'quantization_noise': (0, (1, 1.5)), 'noise_density': (0, (5, 2)),
                                'bias_instability': (0, (8, 2, 1, 2)),
                                'rate_random_walk': (0, (3, 2)), 'rate_ramp': (0, (1, 3))}


def empty_figure(width: float, height: float) -> Figure:
    """Return a figure of the given size in inches that needs no display."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    return figure


@contextmanager
def plot_style() -> Iterator[None]:
    """Apply the fonts, lines and colours of all figures within the context."""
    import matplotlib

    with matplotlib.rc_context(), warnings.catch_warnings():
        # Characters of a frame_id that the font lacks are drawn as boxes; do not warn about them.
        warnings.filterwarnings('ignore', message='.*[Gg]lyph.*')
        matplotlib.rcdefaults()
        matplotlib.rcParams.update({
            'font.family': 'DejaVu Sans', 'font.size': 9, 'axes.labelsize': 9,
            'axes.titlesize': 10, 'axes.titleweight': 'bold',
            'xtick.labelsize': 8, 'ytick.labelsize': 8,
            'figure.facecolor': COLOURS['paper'], 'axes.facecolor': COLOURS['paper'],
            'text.color': COLOURS['ink'],
            'axes.labelcolor': COLOURS['ink'], 'xtick.color': COLOURS['soft'],
            'ytick.color': COLOURS['soft'], 'axes.edgecolor': COLOURS['soft'],
            'axes.linewidth': 0.7, 'grid.color': COLOURS['grid'], 'grid.linewidth': 0.7,
            'axes.axisbelow': True, 'pdf.fonttype': 42, 'svg.fonttype': 'none',
            'svg.hashsalt': 'imu_allan', 'path.simplify': True})
        yield


def frame(panel: Axes, sensor: str, limits: tuple[float, float], *, of_spectrum: bool = False,
          left: bool = True, right: bool = True) -> None:
    """Set scales, limits and labels of a panel of Allan deviation or spectrum; SI is right."""
    x_title, y_title = ('frequency [Hz]', 'PSD (two-sided)') if of_spectrum else (
        'averaging time τ [s]', f'Allan deviation of {SAMPLES[sensor]}')
    panel.set_xscale('log')
    panel.set_yscale('log')
    panel.set_ylim(*limits)
    panel.grid(True)
    unit = 'rad/s' if sensor == 'gyro' else 'm/s^2'
    factor, other = engineering(1.0, unit)
    factor **= 2 if of_spectrum else 1
    _mark_powers(panel.xaxis)
    _mark_powers(panel.yaxis, limits, factor)
    panel.set_xlabel(x_title)
    si, shown = (f'({typeset(text)})²/Hz' if of_spectrum else typeset(text)
                 for text in (unit, other))
    if left:
        panel.set_ylabel(f'{y_title} [{shown}]')
    else:
        panel.tick_params(labelleft=False)
    if right:
        # The data are in SI units; grid and labels on the left use the units of the tables.
        second = panel.secondary_yaxis('right')
        second.set_ylabel(f'[{si}]')
        _mark_powers(second.yaxis, limits)


def _mark_powers(axis: Axis, limits: tuple[float, float] | None = None,
                 factor: float = 1.0) -> None:
    """Place ticks at powers of ten of value times `factor`, over short `limits` at 2 and 5 too."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    # A longer range contains two powers of ten wherever it begins.
    short = limits is not None and limits[1] < limits[0] * 100.0
    subs = np.array((1.0, 2.0, 5.0) if short else (1.0,)) * 10.0**(-np.log10(factor) % 1)
    axis.set_major_locator(LogLocator(subs=subs, numticks=9))
    # Minor ticks and labels set as formulas would take two thirds of the time of a figure.
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _: power_text(value * factor)))


def draw_curve(panel: Axes, axis: AxisResult, colour: str, marker: str = 'o',
               timeline: Timeline | None = None, dashes: Any = '-') -> None:
    """
    Draw the Allan deviation and the fitted model.

    The limits of the panel must be set. Points with few degrees of freedom are hollow, and arrows
    mark points beyond the limits. With `timeline`, the model is drawn on a fine grid, with the
    band in which 95 % of the points should fall. Without it, the intervals of the points are
    drawn.
    """
    curve = axis.curve
    tau, adev = np.array(curve.tau_s), np.array(curve.adev)
    seen = adev > 0
    if not seen.any():
        # Where the curves of others never are.
        panel.text(0.04, 0.05, 'constant signal:\nAllan deviation 0', va='bottom',
                   transform=panel.transAxes, color=colour)
        return
    fine, model = tau, np.array(curve.model_adev)
    low, high = np.array(curve.ci95)[seen].T
    band = tau[seen], np.maximum(low, adev[seen] * 1e-3), high
    if timeline is not None:
        drawn = curves.model_curve(axis, timeline)
        # Short dashes, since the dashes of the models of three axes are longer.
        panel.plot(drawn.tau, drawn.bound, color=colour, linewidth=0.9, linestyle=(0, (2, 2)),
                   zorder=2.8)
        if model.any():
            fine, model, _ = drawn
            band = fine, *curves.expected_band(axis, fine, model)
    panel.fill_between(*band, color=colour, alpha=0.17, linewidth=0, zorder=2)
    fitted = (model > 0) & (fine >= curves.shortest_fitted_s(axis))
    panel.plot(fine[fitted], model[fitted], color=colour, linewidth=1.3, linestyle=dashes,
               zorder=3)
    few = np.array(curves.few_degrees(axis))
    for chosen, face in ((seen & ~few, colour), (seen & few, panel.get_facecolor())):
        panel.plot(tau[chosen], adev[chosen], marker, color=colour, markersize=4.4, zorder=4,
                   markerfacecolor=face, markeredgewidth=0.8,
                   markeredgecolor=colour if face != colour else panel.get_facecolor())
    low, high = panel.get_ylim()
    for chosen, edge, inwards in ((seen & (adev > high), high, -9), (seen & (adev < low), low, 9)):
        for at in tau[chosen]:
            panel.annotate('', (at, edge), xytext=(0, inwards), textcoords='offset points',
                           zorder=5, arrowprops={'arrowstyle': '->', 'color': colour,
                                                 'linewidth': 1.1, 'shrinkA': 0, 'shrinkB': 0})


def draw_terms(panel: Axes, axis: AxisResult) -> None:
    """Draw the line of each term, its slope, and a ring where it is read."""
    curve = axis.curve
    if not curve.tau_s:
        return
    tau = np.geomspace(curve.tau_s[0], curve.tau_s[-1], 121)
    low, high = panel.get_ylim()
    panel.set_xlim(*panel.get_xlim())
    taken: list[Box] = []

    def draw(line: Array, dashes: Any) -> NDArray[np.intp]:
        """Draw the part of a line within the panel, and return its places."""
        seen = np.flatnonzero((line > low) & (line < high))
        if len(seen):
            _draw_soft(panel, tau[seen], line[seen], dashes)
        return seen

    for line, place, name in curves.other_noise(axis, tau):
        if len(seen := draw(line, (0, (6, 1)))):
            place = seen[np.argmin(np.abs(seen - place))]
            _name(panel, axis, (tau[place], line[place]), name, taken)
    slopes = {-1.0: '−1', -0.5: '−½', 0.0: '0', 0.5: '+½', 1.0: '+1'}
    read_at = {'quantization_noise': '√3 s', 'noise_density': '1 s', 'rate_random_walk': '3 s',
               'rate_ramp': '√2 s'}
    for key, value in curves.coefficients_of(axis).items():
        term = TERMS[key]
        line = term.adev(value, tau)
        if not len(seen := draw(line, _TERM_DASHES[key])):
            continue
        at = curves.reading_point(term, axis, tau)
        height = float(term.adev(value, at))
        slope = f'slope {slopes[term.slope]}'
        if tau[0] <= at <= tau[-1] and low < height < high:
            slope += f', read at {read_at[key]}' if term.read_at else f', at {FLICKER_FLOOR:.3f} B'
            panel.plot([at], [height], 'o', markersize=7.5, markerfacecolor='none',
                       markeredgecolor=COLOURS['ink'], markeredgewidth=1.2, zorder=8)
        else:
            place = seen[len(seen) * 2 // 5]
            at, height = tau[place], line[place]
        _name(panel, axis, (at, height), [curves.labelled(axis.coefficients[key]), slope], taken)


def _draw_soft(panel: Axes, x: Array, y: Array, dashes: Any) -> None:
    """Draw a line that the measured ones are compared with."""
    panel.plot(x, y, color=COLOURS['soft'], linewidth=0.9, linestyle=dashes, zorder=2.5)


def _name(panel: Axes, axis: AxisResult, at: tuple[float, float], lines: Sequence[str],
          taken: list[Box]) -> None:
    """Label a point, with a connecting line, where the text hides least."""
    scale = 72 / panel.figure.dpi
    width, tall = panel.bbox.width * scale, panel.bbox.height * scale

    def points(x: ArrayLike, y: ArrayLike) -> Array:
        pixels = panel.transData.transform(np.column_stack([x, y])) - panel.bbox.min
        return np.asarray(np.column_stack([pixels[:, 0] * scale, tall - pixels[:, 1] * scale]))

    curve = axis.curve
    seen = [(t, v) for values in (curve.adev, curve.model_adev)
            for t, v in zip(curve.tau_s, values, strict=True) if v > 0]
    [(x, y)] = points(*at)
    name_size = 7.5   # in points; superscripts then have 6, the smallest readable print
    # DejaVu Sans is a tenth wider than the font of a browser.
    size = (max(map(len, lines)) * LETTER * 1.1 * name_size + 4, len(lines) * 1.25 * name_size + 3)
    box = best_place((x, y), size, (0, 0, width, tall), points(*zip(*seen, strict=True)), taken,
                     name_size / FONT)
    taken.append(box)
    panel.annotate(
        '\n'.join(lines), at, xytext=(box[0] + 2 - x, y - (box[1] + box[3]) / 2),
        textcoords='offset points', fontsize=name_size, color=COLOURS['ink'], va='center',
        ha='left', zorder=7, bbox={'boxstyle': 'round,pad=0.15', 'facecolor': COLOURS['paper'],
                                   'edgecolor': 'none', 'alpha': 0.85},
        arrowprops={'arrowstyle': '-', 'color': COLOURS['ink'], 'linewidth': 0.6, 'shrinkA': 0,
                    'shrinkB': 4, 'relpos': (0 if box[0] > x else 1, 0.5)})


def draw_density(panel: Axes, axis: AxisResult, timeline: Timeline, colour: str) -> None:
    """Draw the two-sided spectrum: measured, if there is one, and modelled, with the tones."""
    frequency, model = curves.model_density(axis, timeline, 300)
    if not len(frequency):
        return
    if axis.band_edge_hz is not None:
        panel.axvspan(axis.band_edge_hz, frequency[-1], color=COLOURS['good'], linewidth=0,
                      zorder=0)
        panel.text(0.99, 0.02, 'shaded: not fitted', transform=panel.transAxes, ha='right',
                   va='bottom', fontsize=7, color=COLOURS['soft'])
    if axis.spectrum is not None:
        bands, power = curves.in_bands(axis.spectrum)
        seen = power > 0
        panel.plot(bands[seen], power[seen], color=colour, linewidth=1.0, alpha=0.75,
                   drawstyle='steps-mid', zorder=2)
    fitted = model > 0
    panel.plot(frequency[fitted], model[fitted],
               color=COLOURS['ink'] if axis.spectrum is not None else colour,
               linewidth=1.3, zorder=3)
    soft = COLOURS['soft']
    for key, value in curves.coefficients_of(axis).items():
        own = FittedModel({key: value}).density(frequency, 0.5 / frequency[-1])
        inside = own > model[fitted].min(initial=inf) * 0.3
        _draw_soft(panel, frequency[inside], own[inside], _TERM_DASHES[key])
    named: list[float] = []
    for tone in sorted(axis.tones, key=lambda tone: -tone.amplitude)[:8]:
        panel.axvline(tone.frequency_hz, color=soft, linewidth=0.8, alpha=0.7, zorder=1)
        # Labels of neighbouring tones would overlap; label only the strongest.
        if len(named) < 3 and all(abs(np.log(tone.frequency_hz / one)) > 0.35 for one in named):
            named.append(tone.frequency_hz)
            panel.annotate(f'tone {tone.frequency_hz:.4g} Hz', (tone.frequency_hz, 1),
                           xycoords=('data', 'axes fraction'), xytext=(-2, -3),
                           textcoords='offset points', rotation=90, ha='right', va='top',
                           fontsize=7, color=soft)


def draw_signal(panel: Axes, axes: Mapping[str, AxisResult], result: Result) -> None:
    """Draw the means over time, gaps and excluded motion, and a known temperature."""
    from matplotlib.artist import Artist
    from matplotlib.patches import Patch

    colours, timeline = COLOURS, result.timeline
    scale, unit = curves.time_unit(timeline.duration_s)
    length = max(timeline.duration_s, 1e-9) / scale
    panel.set_xlim(0, length)
    panel.set_xlabel(f'time [{unit}]', labelpad=1)
    notes: list[Artist] = []
    gaps, motion = timeline.totals
    for spans, all_spans, name in ((timeline.motion, motion, 'motion'),
                                   (timeline.gaps, gaps, 'gap')):
        for span in spans[:2000]:
            # Keep short gaps visible, such as a second in a day.
            width = max(span.duration_s / scale, length * 1.5e-3)
            panel.axvspan(span.start_s / scale, span.start_s / scale + width,
                          color=colours[name], linewidth=0)
        if spans:
            what = 'motion, left out' if name == 'motion' else name
            notes.append(Patch(color=colours[name], label=(
                f'{all_spans.count} × {what} ({duration(all_spans.duration_s)})')))
    moved = {name: curves.mean_over_time(axis) for name, axis in axes.items()}
    if any(len(time) for time, _ in moved.values()):
        quantity = AXES[next(iter(axes))].unit
        shown = MEAN_UNITS[quantity]
        for name, (time, mean) in moved.items():
            panel.plot(time / scale, mean * convert(1.0, quantity, shown), linewidth=0.8,
                       color=colours[name[-1]])
        panel.grid(True)
        panel.locator_params(axis='y', nbins=4)
        heading = f'mean of each segment less the mean of all [{typeset(shown)}]'
        colour = colours['ink']
    elif not notes and result.temperature is None:
        # A joint result knows nothing over time but gaps and motion.
        panel.set_axis_off()
        return
    else:
        panel.set_yticks([])
        panel.set_facecolor(colours['good'])
        for side in ('top', 'left', 'right'):
            panel.spines[side].set_visible(False)
        heading, colour = f'recording of {duration(timeline.duration_s)}', colours['soft']
    time, (_, warmth, _) = curves.over_time(result.temperature)
    if len(time):
        right = panel.twinx()
        notes += right.plot(time / scale, warmth, linewidth=1.2, linestyle=(0, (4, 2)),
                            color=colours['soft'], label='temperature [°C]')
        right.locator_params(axis='y', nbins=4)
    panel.set_title(heading, loc='left', fontsize=8, fontweight='normal', color=colour,
                    pad=15 if notes else 4)
    if notes:
        panel.legend(handles=notes, loc='lower left', bbox_to_anchor=(0, 1), ncol=len(notes),
                     frameon=False, fontsize=8, borderpad=0, borderaxespad=0.2, handlelength=1.0,
                     handletextpad=0.5, columnspacing=1.2)
