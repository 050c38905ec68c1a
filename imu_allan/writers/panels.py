# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The parts of a figure, in one module because all figures are made of the same.

An Allan deviation, a spectrum, a timeline, and their style.

Drawn with matplotlib's object interface, without pyplot and without a display. The three axes have
colours that stay apart in colour-blind vision and markers that stay apart in print; every curve
is labelled where it ends.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import inf
from typing import Any, Literal, TYPE_CHECKING

from imu_allan.noise import chi_square
from imu_allan.noise.fitted_model import FittedModel
from imu_allan.noise.terms import AXES, FLICKER_FLOOR, gauss_markov_avar, Term, TERMS
from imu_allan.result import AxisResult, Coefficient, GaussMarkov, Result, Spectrum, Timeline
from imu_allan.sensor.units import convert, engineering, MEAN_UNITS, typeset
from imu_allan.wording import duration, measured, number, SAMPLES, SENSORS
from imu_allan.writers.own_style import matplotlib_alone, own_style
from imu_allan.writers.svg import power_text
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
Theme = Literal['light', 'dark']

# After Okabe and Ito's palette for colour-blind readers, with a deeper blue: to tritanopes theirs
# is close to the green.
COLOURS: dict[Theme, dict[str, str]] = {
    'light': {'x': '#d55e00', 'y': '#009e73', 'z': '#2340a0', 'ink': '#1a1a1a', 'soft': '#6b6b6b',
              'grid': '#e3e3e3', 'paper': '#ffffff', 'gap': '#8c8c8c', 'motion': '#e69f00',
              'good': '#eef3f7'},
    'dark': {'x': '#ff8c42', 'y': '#4fe3b4', 'z': '#5a8cf0', 'ink': '#ececec', 'soft': '#a5a5a5',
             'grid': '#333840', 'paper': '#16181c', 'gap': '#8c8c8c', 'motion': '#e69f00',
             'good': '#232a33'},
}
FEWEST_DEGREES = 3.0
"""Below, the 95 % interval of a deviation reaches over more than a factor of five."""
_FINE, _BETWEEN = 161, 8
_LONGEST_CLUSTER = 1e6     # samples in the shortest average: no curve of ours begins later
_BAND = 0.25
"""Octaves: 80 points in all; half as wide scatters 1.4 times as much, twice hides a hump."""
_SHORT_RANGE = 100.0
"""From here on there are two powers of ten inside a range, wherever it begins."""
MARKERS = {'x': 'o', 'y': 's', 'z': '^'}
_DASHES: dict[str, Any] = {'quantization_noise': (0, (1, 1.5)), 'noise_density': (0, (5, 2)),
                           'bias_instability': (0, (8, 2, 1, 2)),
                           'rate_random_walk': (0, (3, 2)), 'rate_ramp': (0, (1, 3))}
_SLOPES = {-1.0: '−1', -0.5: '−½', 0.0: '0', 0.5: '+½', 1.0: '+1'}
READ_AT = {'quantization_noise': '√3 s', 'noise_density': '1 s', 'rate_random_walk': '3 s',
           'rate_ramp': '√2 s'}
_LABEL_PLACES = {'quantization_noise': (-12, -22), 'noise_density': (18, 26),
                 'bias_instability': (12, -26), 'rate_random_walk': (14, -16),
                 'rate_ramp': (14, -10)}


def draw_curve(panel: 'Axes', axis: AxisResult, colour: str, marker: str = 'o',
               timeline: Timeline | None = None) -> None:
    """
    Draw the Allan deviation and the fitted model.

    Parameters
    ----------
    panel : matplotlib.axes.Axes
        Where to draw.
    axis : AxisResult
        Whose deviation. Points of few degrees of freedom are hollow.
    colour, marker : str
        Of the axis.
    timeline : Timeline, optional
        With the sample rate: the model is drawn on a fine grid, and shaded where 95 % of the
        points should fall if it is right. Without, with the intervals of the points.

    """
    curve = axis.curve
    tau, adev = np.array(curve.tau_s), np.array(curve.adev)
    seen = adev > 0
    if not seen.any():
        panel.text(0.5, 0.5, 'constant signal:\nAllan deviation 0', ha='center', va='center',
                   transform=panel.transAxes, color=colour)
        return
    fine, model = np.array(curve.tau_s), np.array(curve.model_adev)
    if timeline is not None and model.any():
        fine, model = model_curve(axis, timeline)
        dof = np.exp(np.interp(np.log(fine), np.log(tau), np.log(np.maximum(curve.edf, 1e-3))))
        panel.fill_between(fine, np.sqrt(chi_square.lower(0.025, dof) / dof) * model,
                           np.sqrt(chi_square.upper(0.025, dof) / dof) * model, color=colour,
                           alpha=0.17, linewidth=0, zorder=2)
    else:
        low, high = np.array(curve.ci95).T
        panel.fill_between(tau[seen], np.maximum(low, adev * 1e-3)[seen], high[seen],
                           color=colour, alpha=0.17, linewidth=0, zorder=2)
    fitted = (model > 0) & (fine >= shortest_fitted_s(axis))
    panel.plot(fine[fitted], model[fitted], color=colour, linewidth=1.3, zorder=3)
    few = np.array(few_degrees(axis))
    for chosen, face in ((seen & ~few, colour), (seen & few, panel.get_facecolor())):
        panel.plot(tau[chosen], adev[chosen], marker, color=colour, markersize=4.4, zorder=4,
                   markerfacecolor=face, markeredgewidth=0.8,
                   markeredgecolor=colour if face != colour else panel.get_facecolor())


def draw_terms(panel: 'Axes', axis: AxisResult, theme: Theme = 'light',
               truth: Mapping[str, float] | None = None) -> None:
    """
    Draw each observable term's own line, its slope, and a ring where its coefficient is read.

    Parameters
    ----------
    panel : matplotlib.axes.Axes
        With its limits set.
    axis : AxisResult
        Whose terms.
    theme : 'light' or 'dark'
        Colours of the paper.
    truth : mapping of term key to float, optional
        Draw these coefficients (SI) instead of the estimated ones.

    """
    ink, paper = COLOURS[theme]['ink'], COLOURS[theme]['paper']
    curve = axis.curve
    if not curve.tau_s:
        return
    tau = np.geomspace(curve.tau_s[0], curve.tau_s[-1], 121)
    shown = coefficients_of(axis) if truth is None else dict(truth)
    low, high = panel.get_ylim()
    places = dict(_LABEL_PLACES)
    if {'quantization_noise', 'noise_density'} <= set(shown):
        # Their rings are neighbours: Q, the steeper, gets the room above the curve.
        places.update(quantization_noise=(18, 26), noise_density=(-14, -24))
    if axis.gauss_markov is not None and truth is None:
        _draw_gauss_markov(panel, axis, axis.gauss_markov, tau, theme)
    for key, value in shown.items():
        term = TERMS[key]
        line = term.adev(value, tau)
        inside = (line > low) & (line < high)
        if value == 0 or not inside.any():
            continue
        panel.plot(tau[inside], line[inside], color=COLOURS[theme]['soft'], linewidth=0.9,
                   linestyle=_DASHES[key], zorder=2.5)
        label = f'{term.symbol} = {written(axis.coefficients[key], abs(value))}\n'
        at = reading_point(term, shown, tau)
        height = float(term.adev(value, at))
        ringed = tau[0] <= at <= tau[-1] and low < height < high
        if ringed:
            label += f'slope {_SLOPES[term.slope]}, '
            label += f'read at {READ_AT[key]}' if term.read_at else f'at {FLICKER_FLOOR:.3f} B'
            panel.plot([at], [height], 'o', markersize=7.5, markerfacecolor='none',
                       markeredgecolor=ink, markeredgewidth=1.2, zorder=8)
        else:
            label += f'slope {_SLOPES[term.slope]}'
            place = int(inside.sum()) * 2 // 5
            at, height = float(tau[inside][place]), float(line[inside][place])
        share = float(np.log(at / tau[0]) / np.log(tau[-1] / tau[0]))
        turned = share > (0.6 if ringed else 0.8)
        right, up = places[key] if ringed else (16, -10)
        panel.annotate(
            label, (at, height), xytext=(-abs(right) if turned else right, up),
            textcoords='offset points', fontsize=7.5, color=ink, va='center', zorder=7,
            ha='right' if right < 0 or turned else 'left',
            bbox={'boxstyle': 'round,pad=0.15', 'facecolor': paper, 'edgecolor': 'none',
                  'alpha': 0.85},
            arrowprops={'arrowstyle': '-', 'color': ink, 'linewidth': 0.6, 'shrinkA': 0,
                        'shrinkB': 4})


def written(coefficient: Coefficient, value: float) -> str:
    """Return a value of `coefficient` with the digits of its interval, and its unit."""
    shown, unit = engineering(value, coefficient.unit)
    if coefficient.ci95 is None:
        return f'{number(shown)} {typeset(unit)}'
    bounds = (engineering(abs(bound), coefficient.unit)[0] for bound in coefficient.ci95)
    return f'{measured(shown, *bounds)[0]} {typeset(unit)}'


def _draw_gauss_markov(panel: 'Axes', axis: AxisResult, process: GaussMarkov, tau: Array,
                       theme: Theme) -> None:
    """Draw the bump of a correlated process and name it at its top."""
    line = np.sqrt(gauss_markov_avar(process.sigma, process.correlation_time_s, tau))
    low, high = panel.get_ylim()
    inside = (line > low) & (line < high)
    if not inside.any():
        return
    panel.plot(tau[inside], line[inside], color=COLOURS[theme]['soft'], linewidth=0.9,
               linestyle=(0, (6, 1)), zorder=2.5)
    sigma, unit = engineering(process.sigma, axis.unit)
    top = int(np.argmax(np.where(inside, line, 0.0)))
    panel.annotate(
        f'Gauss-Markov, {number(sigma)} {typeset(unit)}\n'
        f'correlated over {duration(process.correlation_time_s)}', (tau[top], line[top]),
        # Above the curve: the labels of the terms stand below it.
        xytext=(-14, 44), textcoords='offset points', fontsize=7.5, ha='right', va='center',
        color=COLOURS[theme]['ink'], zorder=7,
        bbox={'boxstyle': 'round,pad=0.15', 'edgecolor': 'none', 'alpha': 0.85,
              'facecolor': COLOURS[theme]['paper']},
        arrowprops={'arrowstyle': '-', 'color': COLOURS[theme]['ink'], 'linewidth': 0.6,
                    'shrinkA': 0, 'shrinkB': 2})


def draw_density(panel: 'Axes', axis: AxisResult, timeline: Timeline, colour: str,
                 theme: Theme = 'light') -> None:
    """
    Draw the two-sided power spectral density: measured where given, the model's, and the tones.

    Parameters
    ----------
    panel : matplotlib.axes.Axes
        Where to draw.
    axis : AxisResult
        Whose density.
    timeline : Timeline
        Gives the sample rate and the lowest frequency.
    colour : str
        Colour of the axis.
    theme : 'light' or 'dark'
        Colours of the paper.

    """
    rate = timeline.sample_rate_hz
    if rate is None or timeline.duration_s <= 0:
        return
    if axis.band_edge_hz is not None:
        panel.axvspan(axis.band_edge_hz, rate / 2, color=COLOURS[theme]['good'], linewidth=0,
                      zorder=0)
        panel.text(0.99, 0.02, 'shaded: not fitted', transform=panel.transAxes, ha='right',
                   va='bottom', fontsize=7, color=COLOURS[theme]['soft'])
    if axis.spectrum is not None:
        frequency, power = in_bands(axis.spectrum)
        seen = power > 0
        panel.plot(frequency[seen], power[seen], color=colour, linewidth=1.0, alpha=0.75,
                   drawstyle='steps-mid', zorder=2)
    frequency = np.geomspace(min(1 / timeline.duration_s, rate / 4), rate / 2, 300)
    model = model_density(axis, frequency, rate)
    fitted = model > 0
    panel.plot(frequency[fitted], model[fitted],
               color=COLOURS[theme]['ink'] if axis.spectrum is not None else colour,
               linewidth=1.3, zorder=3)
    soft = COLOURS[theme]['soft']
    for key, value in coefficients_of(axis).items():
        own = model_density(axis, frequency, rate, {key: value})
        inside = own > model[fitted].min(initial=inf) * 0.3
        panel.plot(frequency[inside], own[inside], color=soft, linewidth=0.9,
                   linestyle=_DASHES[key], zorder=2.5)
    named: list[float] = []
    for tone in sorted(axis.tones, key=lambda tone: -tone.amplitude)[:8]:
        panel.axvline(tone.frequency_hz, color=soft, linewidth=0.8, alpha=0.7, zorder=1)
        # Names of neighbours would be printed over one another: the strongest has it.
        if len(named) < 3 and all(abs(np.log(tone.frequency_hz / other)) > 0.35
                                  for other in named):
            named.append(tone.frequency_hz)
            panel.annotate(f'tone {tone.frequency_hz:.4g} Hz', (tone.frequency_hz, 1),
                           xycoords=('data', 'axes fraction'), xytext=(-2, -3),
                           textcoords='offset points', rotation=90, ha='right', va='top',
                           fontsize=7, color=soft)


def model_density(axis: AxisResult, frequency_hz: Array, sample_rate_hz: float,
                  coefficients: Mapping[str, float] | None = None) -> Array:
    """
    Two-sided power spectral density of the samples under the fitted model.

    Parameters
    ----------
    axis : AxisResult
        Whose model.
    frequency_hz : ndarray, shape (n,)
        Above zero, up to half of `sample_rate_hz`.
    sample_rate_hz : float
        Of the samples.
    coefficients : mapping of term key to float, optional
        These terms alone (SI) instead of the fitted ones.

    Returns
    -------
    ndarray, shape (n,)
        In squared sample units per Hz; NaN above the band that was fitted, of which the model
        says nothing. The ramp is deterministic and has no spectrum.

    """
    if coefficients is not None:
        return FittedModel(coefficients).density(frequency_hz, 1 / sample_rate_hz)
    density = describe(axis).density(frequency_hz, 1 / sample_rate_hz)
    return np.where(frequency_hz > (axis.band_edge_hz or inf), np.nan, density)


def describe(axis: AxisResult) -> FittedModel:
    """Return the model of an axis: the drift model where there is one, low-pass and lines."""
    values = coefficients_of(axis)
    process, drift = axis.gauss_markov, axis.drift_model
    processes: tuple[tuple[float, float], ...] = ()
    if process is not None:
        processes = ((process.sigma, process.correlation_time_s),)
    if drift is not None:
        values = {'quantization_noise': values.get('quantization_noise', 0.0),
                  'noise_density': drift.noise_density,
                  'rate_random_walk': drift.rate_random_walk}
        processes = tuple((p.sigma, p.correlation_time_s) for p in drift.processes)
    return FittedModel(values, axis.band_limit_s, processes,
                       tuple((tone.frequency_hz, tone.amplitude) for tone in axis.tones))


def model_curve(axis: AxisResult, timeline: Timeline) -> tuple[Array, Array]:
    """
    Return the Allan deviation of the model between the averaging times, too.

    Parameters
    ----------
    axis : AxisResult
        Whose model it is.
    timeline : Timeline
        Gives the sample rate; without one the averaging times of the curve have to do.

    Returns
    -------
    tau, adev : ndarray, shape (n,)
        In seconds, from the shortest time of which the model was fitted, and in the unit of a
        sample.

    """
    rate = axis.sample_rate_hz or timeline.sample_rate_hz
    tau = np.array(axis.curve.tau_s)
    if (rate is None or len(tau) < 2 or not any(axis.curve.model_adev)
            or not 0.5 < tau[0] * rate < _LONGEST_CLUSTER):
        return tau, np.array(axis.curve.model_adev)
    model = describe(axis)
    # Whole samples; the lobes of a line are averaged over, where they are finer than the grid.
    size = np.unique(np.rint(np.geomspace(tau[0], tau[-1], _FINE * _BETWEEN) * rate))
    avar = model.allan_variance(size, 1 / rate)
    if axis.tones:
        window = min(_BETWEEN, len(avar))
        smooth = np.convolve(avar, np.ones(window) / window, 'same')
        avar = np.where(size > size[0] * 64, smooth, avar)
        avar[-window:] = model.allan_variance(size[-window:], 1 / rate)
    keep = np.unique(np.linspace(0, len(size) - 1, _FINE).astype(int))
    keep = keep[size[keep] / rate >= shortest_fitted_s(axis)]
    return size[keep] / rate, np.sqrt(avar[keep])


def shortest_fitted_s(axis: AxisResult) -> float:
    """Return a period of the band's edge: shorter averages scatter by what lies beyond it."""
    return 1 / (axis.band_edge_hz or inf)


def in_bands(spectrum: Spectrum) -> tuple[Array, Array]:
    """
    Return the mean density of a spectrum in equal bands of a logarithmic axis.

    The lowest frequencies come one by one, where a single bin may be a hundred times too high or
    too low; a band is no wider than `_BAND` octaves, and a bin that is wider stays by itself.

    Parameters
    ----------
    spectrum : Spectrum
        Of one axis.

    Returns
    -------
    frequency_hz, psd : ndarray, shape (n,)

    """
    frequency, power = np.array(spectrum.frequency_hz), np.array(spectrum.psd)
    if not len(frequency):
        return frequency, power
    bands = np.floor(np.log2(frequency) / _BAND)
    _, starts, counts = np.unique(bands, return_index=True, return_counts=True)
    return (np.exp(np.add.reduceat(np.log(frequency), starts) / counts),
            np.add.reduceat(power, starts) / counts)


def few_degrees(axis: AxisResult) -> list[bool]:
    """Say of each point of the curve whether too little stands behind it to trust its place."""
    return [dof < FEWEST_DEGREES for dof in axis.curve.edf]


def coefficients_of(axis: AxisResult) -> dict[str, float]:
    """Return the observable coefficients of an axis by key, in SI units."""
    return {key: axis.coefficients[key].value or 0.0 for key in TERMS
            if axis.coefficients[key].observable}


def time_unit(length_s: float) -> tuple[float, str]:
    """Return the unit, in seconds and by name, in which a length of time is two or more."""
    return next(((size, name) for size, name in ((86_400.0, 'days'), (3600.0, 'h'), (60.0, 'min'))
                 if length_s >= 2 * size), (1.0, 's'))


def wander(axis: AxisResult) -> tuple[Array, Array]:
    """
    Return how the mean of an axis wandered: that of each stretch less that of all.

    Parameters
    ----------
    axis : AxisResult
        Whose signal.

    Returns
    -------
    time_s, mean : ndarray, shape (n,)
        Middle of each stretch, and in the unit of a sample; NaN where there were no samples, and
        nothing where the result does not have the signal.

    """
    if axis.signal is None:
        return np.zeros(0), np.zeros(0)
    mean: Array = np.array([np.nan if v is None else v for v in axis.signal.mean])
    time = np.asarray((np.arange(len(mean)) + 0.5) * axis.signal.step_s, np.float64)
    if not np.isfinite(mean).any():
        return np.zeros(0), np.zeros(0)
    return time, np.asarray(mean - np.nanmean(mean))


def draw_signal(panel: 'Axes', axes: Mapping[str, AxisResult], timeline: Timeline,
                theme: Theme = 'light') -> None:
    """
    Draw how the means wandered over the recording, its gaps, and the motion that was left out.

    Parameters
    ----------
    panel : matplotlib.axes.Axes
        Where to draw; a strip without curves where no axis has the signal.
    axes : mapping of name to AxisResult
        Of one sensor.
    timeline : Timeline
        Of the same result.
    theme : 'light' or 'dark'
        Colours of the paper.

    """
    colours = COLOURS[theme]
    scale, unit = time_unit(timeline.duration_s)
    length = max(timeline.duration_s, 1e-9) / scale
    panel.set_xlim(0, length)
    panel.set_xlabel(f'time [{unit}]', labelpad=1)
    for spans, colour in ((timeline.motion, colours['motion']), (timeline.gaps, colours['gap'])):
        for span in spans[:2000]:
            # A gap of a second in a day is still one visible line.
            width = max(span.duration_s / scale, length * 1.5e-3)
            panel.axvspan(span.start_s / scale, span.start_s / scale + width, color=colour,
                          linewidth=0)
    moved = {name: wander(axis) for name, axis in axes.items()}
    if any(len(time) for time, _ in moved.values()):
        quantity = AXES[next(iter(axes))].unit
        shown = MEAN_UNITS[quantity]
        for name, (time, mean) in moved.items():
            panel.plot(time / scale, mean * convert(1.0, quantity, shown), linewidth=0.8,
                       color=colours[name[-1]])
        panel.grid(True)
        panel.locator_params(axis='y', nbins=4)
        parts = [(f'mean of each stretch less the mean of all [{typeset(shown)}]',
                  colours['ink'])]
    else:
        panel.set_yticks([])
        panel.set_facecolor(colours['good'])
        for side in ('top', 'left', 'right'):
            panel.spines[side].set_visible(False)
        parts = [(f'recording of {duration(timeline.duration_s)}', colours['soft'])]
    for spans, name, colour in ((timeline.motion, 'motion, left out', colours['motion']),
                                (timeline.gaps, 'gap', colours['gap'])):
        if spans:
            total = duration(sum(span.duration_s for span in spans))
            parts.append((f'■ {len(spans)} × {name} ({total})', colour))
    write_in_a_row(panel, parts)


def write_in_a_row(panel: 'Axes', parts: Sequence[tuple[str, str]]) -> None:
    """Write coloured texts one after the other above `panel`."""
    from matplotlib.artist import Artist
    from matplotlib.offsetbox import AnchoredOffsetbox, HPacker, TextArea

    areas: list[Artist] = [TextArea(text, textprops={'color': colour, 'fontsize': 8,
                                                     'parse_math': False})
                           for text, colour in parts]
    panel.add_artist(AnchoredOffsetbox(
        'lower left', child=HPacker(children=areas, pad=0, sep=14), frameon=False, pad=0,
        borderpad=0.2, bbox_to_anchor=(0, 1), bbox_transform=panel.transAxes))


def reading_point(term: Term, shown: Mapping[str, float], tau: Array) -> float:
    """Return the averaging time at which a coefficient is read off its line."""
    if term.read_at is not None:
        return term.read_at
    total = sum((TERMS[key].adev(value, tau) ** 2 for key, value in shown.items()),
                np.zeros(tau.shape))
    if np.ptp(total) == 0:
        return float(np.sqrt(tau[0] * tau[-1]))
    return float(tau[np.argmin(total)])


def limits_of(axes: Iterable[AxisResult], *, rings: bool = False) -> tuple[float, float]:
    """
    Lowest and highest Allan deviation to show.

    Points that stand on few degrees of freedom may lie anywhere: where there are better ones they
    have no say, and the model has one. With `rings` also the points where the coefficients are
    read, unless that would make the curve a small thing at the top.
    """
    low, high = inf, 0.0
    reading = []
    for axis in axes:
        few = few_degrees(axis)
        sure = not all(few)
        for value, model, band, unsure in zip(axis.curve.adev, axis.curve.model_adev,
                                              axis.curve.ci95, few, strict=True):
            if value > 0 and not (sure and unsure):
                low = min(low, max(band[0], value / 2))
                high = max(high, min(band[1], value * 2))
            if model > 0:
                low, high = min(low, model / 1.3), max(high, model * 1.3)
        reading += [abs(value) for key, value in coefficients_of(axis).items()
                    if TERMS[key].read_at and value]
    if high == 0:
        return 0.1, 10.0
    if rings:
        low = min([low, *(value / 1.8 for value in reading if value > low / 60)])
    return low / 1.3, high * 1.3


def frame_allan(panel: 'Axes', sensor: str, limits: tuple[float, float], *,
                left: bool = True, right: bool = True) -> None:
    """Set scales, limits and labels of an Allan deviation panel; SI left, engineering right."""
    _log_scales(panel, limits)
    panel.set_xlabel('averaging time τ [s]')
    unit = 'rad/s' if sensor == 'gyro' else 'm/s^2'
    _two_units(panel, unit, 1, f'Allan deviation of {SAMPLES[sensor]}', left, right)


def density_limits(axes: Iterable[AxisResult], timeline: Timeline) -> tuple[float, float]:
    """Lowest and highest density to show: a decade about the model, lines cut off above it."""
    low, high = inf, 0.0
    for axis in axes:
        rate = axis.sample_rate_hz or timeline.sample_rate_hz
        if rate is not None and timeline.duration_s > 0:
            frequency = np.geomspace(min(1 / timeline.duration_s, rate / 4), rate / 2, 60)
            model = model_density(axis, frequency, rate)
            model = model[model > 0]
            if len(model):
                low, high = min(low, float(model.min())), max(high, float(model.max()))
        if axis.spectrum is not None:
            measured = np.array([value for value in axis.spectrum.psd if value > 0])
            if len(measured):
                low = min(low, float(np.quantile(measured, 0.1)))
                high = max(high, float(np.quantile(measured, 0.95)))
    return (low / 4, high * 8) if high > 0 else (0.1, 10.0)


def frame_density(panel: 'Axes', sensor: str, limits: tuple[float, float], *,
                  left: bool = True, right: bool = True) -> None:
    """Set scales, limits and labels of a spectrum panel; SI left, engineering right."""
    _log_scales(panel, limits)
    panel.set_xlabel('frequency [Hz]')
    unit = 'rad/s' if sensor == 'gyro' else 'm/s^2'
    _two_units(panel, unit, 2, 'PSD (two-sided)', left, right)


def _log_scales(panel: 'Axes', limits: tuple[float, float]) -> None:
    panel.set_xscale('log')
    panel.set_yscale('log')
    panel.set_ylim(*limits)
    panel.grid(True)
    _mark_powers(panel.xaxis)
    _mark_powers(panel.yaxis, limits)


def _mark_powers(axis: 'Axis', limits: tuple[float, float] | None = None) -> None:
    """Mark powers of ten; over a short range of `limits` also twice and five times as much."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    short = limits is not None and limits[1] < limits[0] * _SHORT_RANGE
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if short else (1.0,), numticks=9))
    # Small marks in between, and numbers set as formulas, are two thirds of the time of a figure.
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _: power_text(value)))


def _two_units(panel: 'Axes', unit: str, power: int, title: str, left: bool, right: bool) -> None:
    factor, other = engineering(1.0, unit)
    factor **= power

    def written(text: str) -> str:
        return f'({typeset(text)})²/Hz' if power == 2 else typeset(text)

    if left:
        panel.set_ylabel(f'{title} [{written(unit)}]')
    else:
        panel.tick_params(labelleft=False)
    if right:
        second = panel.secondary_yaxis(
            'right', functions=(lambda v: np.asarray(v) * factor,
                                lambda v: np.asarray(v) / factor))
        second.set_ylabel(f'[{written(other)}]')
        low, high = panel.get_ylim()
        _mark_powers(second.yaxis, (low * factor, high * factor))


def label_ends(panel: 'Axes', axes: Mapping[str, AxisResult], theme: Theme) -> None:
    """Name each curve at its right end, moved apart where two would overlap."""
    # A point beyond the limits is not drawn: the last one that is carries the name.
    bottom, top = panel.get_ylim()
    ends = []
    for name, axis in axes.items():
        seen = [(t, v) for t, v in zip(axis.curve.tau_s, axis.curve.adev, strict=True)
                if bottom < v < top]
        if seen:
            ends.append((*seen[-1], name))
    if not ends:
        return
    low, high = np.log((bottom, top))
    tall = 72 * panel.bbox.height / panel.figure.dpi
    apart = max(0.055, 1.3 * float(panel.yaxis.label.get_fontsize()) / tall) * (high - low)
    heights = _spread([float(np.log(value)) for _, value, _ in ends], apart)
    # The outermost stay clear of the frame, all by the same shift.
    shift = max(0.0, low + apart - min(heights)) - max(0.0, max(heights) - (high - apart))
    edge = max(axis.curve.tau_s[-1] for axis in axes.values())
    start = min(axis.curve.tau_s[0] for axis in axes.values())
    panel.set_xlim(start / 1.6, edge * 4.0)
    for (tau, value, name), height in zip(ends, heights, strict=True):
        panel.annotate(name[-1], (tau, value), xytext=(edge * 2.1, float(np.exp(height + shift))),
                       color=COLOURS[theme][name[-1]], fontweight='bold', va='center', zorder=8,
                       arrowprops={'arrowstyle': '-', 'color': COLOURS[theme][name[-1]],
                                   'linewidth': 0.7, 'shrinkA': 1, 'shrinkB': 3})


def _spread(values: list[float], apart: float) -> list[float]:
    """Return `values` moved so that neighbours in order are at least `apart`."""
    order = sorted(range(len(values)), key=values.__getitem__)
    moved = [values[i] for i in order]
    for _ in range(50):
        for i in range(len(moved) - 1):
            lack = apart - (moved[i + 1] - moved[i])
            if lack > 1e-9:
                moved[i] -= lack / 2
                moved[i + 1] += lack / 2
    result = list(values)
    for place, i in enumerate(order):
        result[i] = moved[place]
    return result


def sensors_of(result: Result) -> list[str]:
    """Return which of gyro and accel the result has."""
    return [sensor for sensor in SENSORS if axes_of(result, sensor)]


def axes_of(result: Result, sensor: str) -> dict[str, AxisResult]:
    """Return the axes of gyro or accel by name, in order."""
    return {name: result.axes[name] for name in AXES
            if name.startswith(sensor) and name in result.axes}


def empty_figure(width: float, height: float) -> 'Figure':
    """Return a figure of this size in inches that needs no display."""
    matplotlib_alone()
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    return figure


@contextmanager
def plot_style(theme: Theme = 'light', size: float = 9.0) -> Iterator[None]:
    """
    Fonts, lines and colours of every figure, for as long as the context lasts.

    Parameters
    ----------
    theme : 'light' or 'dark'
        Colours of the paper.
    size : float, optional
        Of the text, in points; the numbers beside the axes are a point smaller, 7 at least.

    """
    colours = COLOURS[theme]
    with own_style({
            'font.family': 'DejaVu Sans', 'font.size': size, 'axes.labelsize': size,
            'axes.titlesize': size + 1, 'axes.titleweight': 'bold',
            'xtick.labelsize': max(7.0, size - 1), 'ytick.labelsize': max(7.0, size - 1),
            'figure.facecolor': colours['paper'], 'axes.facecolor': colours['paper'],
            'text.color': colours['ink'],
            'axes.labelcolor': colours['ink'], 'xtick.color': colours['soft'],
            'ytick.color': colours['soft'], 'axes.edgecolor': colours['soft'],
            'axes.linewidth': 0.7, 'grid.color': colours['grid'], 'grid.linewidth': 0.7,
            'axes.axisbelow': True, 'pdf.fonttype': 42, 'svg.fonttype': 'none',
            'svg.hashsalt': 'imu_allan', 'path.simplify': True}):
        yield
