# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The frame of a panel: scales and marks, a unit on either side, and the names of the curves.

Drawn with matplotlib's object interface, without pyplot and without a display.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from imu_allan.result import AxisResult
from imu_allan.sensor.units import engineering, typeset
from imu_allan.wording import SAMPLES
from imu_allan.writers.figure_style import COLOURS, Theme
from imu_allan.writers.svg import power_text
import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis


def frame_allan(panel: 'Axes', sensor: str, limits: tuple[float, float], *,
                left: bool = True, right: bool = True) -> None:
    """Set scales, limits and labels of an Allan deviation panel; SI left, engineering right."""
    _log_scales(panel, limits)
    panel.set_xlabel('averaging time τ [s]')
    unit = 'rad/s' if sensor == 'gyro' else 'm/s^2'
    _two_units(panel, unit, 1, f'Allan deviation of {SAMPLES[sensor]}', left, right)


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

    # From here on there are two powers of ten inside a range, wherever it begins.
    short = limits is not None and limits[1] < limits[0] * 100.0
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
