# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A chart of the page: two drawings, one for the desk and one for the phone."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from imu_allan.result import AxisResult
from imu_allan.wording import SENSORS
from imu_allan.writers.svg import Box, Drawing, SHAPES

WIDE, NARROW = 1080.0, 380.0
"""Widths of the two drawings: the page at a desk and in print, and on a phone."""


@dataclass(frozen=True)
class Chart:
    """
    One chart of the page.

    Attributes
    ----------
    name : str
        Unique in the page.
    title, caption : str
    svg : str
        The two drawings.
    groups : tuple of (str, str, str)
        Name, class and label of what can be looked at by itself.
    focus : str
        The group that is looked at in the beginning.

    """

    name: str
    title: str
    caption: str
    svg: str
    groups: tuple[tuple[str, str, str], ...] = ()
    focus: str = ''


def both(name: str, label: str, height: float, narrow_height: float,
         draw: Callable[[Drawing, bool], None]) -> str:
    """Draw for the desk and for the phone."""
    drawings = []
    for size, width, tall in (('at-desk', WIDE, height), ('on-phone', NARROW, narrow_height)):
        drawing = Drawing(width, tall, f'{name}-{size}', label)
        draw(drawing, size == 'on-phone')
        drawings.append(drawing.svg(size))
    return ''.join(drawings)


def sensor_chart(sensor: str, kind: str, title: str, label: str, caption: str,
                 heights: tuple[float, float], draw: Callable[[Drawing, bool], None],
                 axes: Mapping[str, AxisResult], focus: str = '') -> Chart:
    """Return the chart of a kind about the axes of a sensor."""
    name = f'{sensor}-{kind}'
    return Chart(name, f'{SENSORS[sensor]}: {title}', caption,
                 both(name, f'{SENSORS[sensor]}: {label}', *heights, draw), tuple(
                     (axis[-1], f'axis-{axis[-1]}', f'{axis[-1]} axis') for axis in axes), focus)


def box_of(drawing: Drawing, narrow: bool, top: float = 26, bottom: float = 46) -> Box:
    """Return the place of the axes in a drawing."""
    return (56.0 if narrow else 64.0, top, drawing.width - (14 if narrow else 68),
            drawing.height - bottom)


def shape_of(letter: str) -> str:
    """Return the mark of an axis."""
    return SHAPES['xyz'.index(letter)]


def worst_axis(axes: Mapping[str, AxisResult]) -> str:
    """Return the letter of the axis with the largest noise density."""
    return max(axes, key=lambda name: axes[name].coefficients['noise_density'].value or 0.0)[-1]


def padded(low: float, high: float) -> tuple[float, float, bool]:
    """Return the range of a linear axis, with room at both ends."""
    room = 0.06 * (high - low) or max(abs(high), 1e-9) * 0.01
    return low - room, high + room, False
