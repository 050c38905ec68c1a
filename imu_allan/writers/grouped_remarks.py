# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The remarks of a result, each told once.

A finding that holds for several axes comes as so many remarks of one code, which differ in the
name of the axis and in numbers. Here they become one sentence: "gyro x, y and z: the noise rolls
off ...: its effective window is 0.0148 to 0.0152 s".
"""

from collections.abc import Sequence
from dataclasses import dataclass
import re

from imu_allan.errors import printable
from imu_allan.noise.terms import AXES
from imu_allan.result import AxisResult, Result
from imu_allan.sensor.units import engineering
from imu_allan.wording import about, counted, listed, named, number, spoken

TITLES = {
    'axis_absent_in_part': 'absent in part', 'axis_late_start': 'late axis',
    'band_limited': 'low-pass', 'bias_step': 'bias step',
    'coarse_resolution': 'coarse steps', 'constant_axis': 'constant',
    'copied_axis': 'copied axis', 'deadband': 'deadband',
    'gauss_markov': 'correlated noise', 'gravity': 'gravity', 'interpolated': 'interpolated',
    'motion': 'motion', 'motion_kept': 'motion kept', 'mostly_motion': 'motion',
    'noise_level_changed': 'noise level changes',
    'not_steady': 'not steady', 'poor_fit': 'poor fit', 'rate_changed': 'rate changed',
    'recordings_disagree': 'recordings disagree', 'several_publishers': 'several publishers',
    'perhaps_high_passed': 'perhaps filtered', 'power_law': 'no flicker',
    'short_part': 'short part', 'short_recording': 'short recording',
    'temperature': 'temperature', 'tones': 'tones',
    'clock_speed': 'speed of clocks', 'field_absent': 'absent field', 'frozen': 'frozen sensor',
    'held_values': 'held values', 'high_passed': 'slow part removed', 'late_start': 'late start',
    'rest_within_motion': 'rest within motion',
    'saturated': 'saturated',
    'slow_cycle': 'slow cycle', 'slow_motion': 'slow motion', 'spikes': 'wild values',
    'start_auto': 'start', 'stood_still': 'stood still',
    'trend_or_walk': 'trend or walk', 'turn_on_bias': 'turn-on bias',
    'uneven_rate': 'uneven rate', 'uneven_stamps': 'uneven stamps',
    'unit_g': 'unit g', 'unknown_rate': 'no rate', 'warm_up': 'warming up'}
_AXIS = re.compile(r'(\w+): (.*)', re.DOTALL)
# A number that stands by itself: "0.0148", "-3", "12.5 %", "44," but not the 3 of "m/s^3".
# A length of time is one, too, with its unit or two of them: "81 min", "32 min 4 s".
_NUMBER = re.compile(
    r'(?<![\w.^/-])(?:\d+ h \d+ min|\d+ min \d+ s|[\d.]+ (?:days|h|min|s|ms)(?![\w^/*])|'
    r'-?\d[\d,]*(?:\.\d+)?(?:e[+-]?\d+)?(?![\w^/]))')
_UNITS = {'days': 86_400.0, 'h': 3600.0, 'min': 60.0, 's': 1.0, 'ms': 1e-3}
MANY_TONES = 4
"""As many as a line of the terminal holds; the result file has all."""


@dataclass(frozen=True)
class Group:
    """
    What is worth knowing of one kind.

    Attributes
    ----------
    code, title : str
        As in the result, and in two words.
    sentences : tuple of str
        Printable.

    """

    code: str
    title: str
    sentences: tuple[str, ...]


def grouped(result: Result, tones: int = MANY_TONES) -> list[Group]:
    """
    Return the remarks of a result by kind, in the order in which the kinds first come.

    Parameters
    ----------
    result : Result
        Its warnings, and the lines in the spectra of its axes.
    tones : int, optional
        So many lines of each axis are named, the strongest first.

    """
    kinds: dict[str, list[tuple[str | None, str]]] = {}
    for warning in result.warnings:
        kinds.setdefault(warning.code, []).append(_split(printable(warning.message)))
    groups = [Group(code, TITLES.get(code, printable(code).replace('_', ' ')),
                    told_once(found, listing=code == 'constant_axis'))
              for code, found in kinds.items()]
    if lines := _tones(result, tones):
        groups.append(Group('tones', TITLES['tones'], (lines,)))
    return groups


def told_once(found: Sequence[tuple[str | None, str]], *, listing: bool = False
              ) -> tuple[str, ...]:
    """
    Make one of sentences that differ in the axis and in numbers alone.

    Parameters
    ----------
    found : sequence of (str or None, str)
        Axis and sentence about it; what is about none stays as it is.
    listing : bool, optional
        Every number is named, not what they reach over.

    Examples
    --------
    >>> told_once([('gyro_x', 'twice 0.3 deg'), ('gyro_z', 'twice 0.4 deg')])
    ('gyro x and z: twice 0.3 to 0.4 deg',)

    """
    shapes: dict[tuple[str, ...], list[tuple[str | None, str]]] = {}
    for axis, text in found:
        # An interval is of one axis: what two of them reach over would be "a to b to c to d".
        alone = axis is None or '% interval' in text
        shapes.setdefault((text,) if alone else tuple(_NUMBER.split(text)), []).append(
            (axis, text))
    return tuple(_sentence(shape, those, listing=listing) for shape, those in shapes.items())


def count_of(groups: Sequence[Group]) -> str:
    """Return ``6 remarks: low-pass, poor fit, ...``."""
    titles = dict.fromkeys(group.title for group in groups)
    return f'{counted(sum(len(g.sentences) for g in groups), "remark")}: {", ".join(titles)}'


def outlook_of(result: Result) -> str:
    """Say what a longer recording would bring, by the Fisher information of the fitted model."""
    halves = [c.ci_halves_in_s for axis in result.axes.values()
              for c in axis.coefficients.values() if c.ci_halves_in_s]
    waiting: dict[str, list[tuple[float, str]]] = {}
    for name, axis in result.axes.items():
        for coefficient in axis.coefficients.values():
            if coefficient.observable_in_s:
                waiting.setdefault(coefficient.symbol, []).append(
                    (coefficient.observable_in_s, name))
    parts = [f'all intervals half as wide after another {about(max(halves))}'] if halves else []
    if waiting:
        first = {symbol: min(times) for symbol, times in waiting.items()}
        parts.append(listed([f'{symbol} of {named([name])} after {about(wait)}'
                             for symbol, (wait, name) in first.items()]) + ' at the earliest')
    return f'Recording on: {"; ".join(parts)}.' if parts else ''


def _split(message: str) -> tuple[str | None, str]:
    match = _AXIS.fullmatch(message)
    if match is not None and match[1] in AXES:
        return match[1], match[2]
    return None, message


def _sentence(shape: tuple[str, ...], found: Sequence[tuple[str | None, str]], *,
              listing: bool) -> str:
    axes = [axis for axis, _ in found if axis is not None]
    if not axes:
        return found[0][1]
    if len(shape) == 1:
        return f'{named(axes)}: {shape[0]}'
    numbers = zip(*(_NUMBER.findall(text) for _, text in found), strict=True)
    text = shape[0] + ''.join(
        (listed(list(dict.fromkeys(values))) if listing else _range(values)) + between
        for values, between in zip(numbers, shape[1:], strict=True))
    return f'{named(axes)}: {text}'


def _range(values: Sequence[str]) -> str:
    """Return what the numbers reach over, as they are written."""
    order = sorted(values, key=_size)
    low, high = order[0], order[-1]
    if low == high:
        return low
    units = [text.split(' ')[1::2] for text in (low, high)]
    # "0.0148 to 0.0152 s", but "32 min 4 s to 81 min 58 s".
    return f'{low.split(" ")[0] if units[0] == units[1] and len(units[0]) == 1 else low} to {high}'


def _size(text: str) -> float:
    """Return a number, or the seconds of a length of time."""
    first, *rest = text.split(' ')
    if not rest:
        return float(first.replace(',', ''))
    parts = [first, *rest]
    return sum(float(value) * _UNITS[unit]
               for value, unit in zip(parts[::2], parts[1::2], strict=True))


def _tones(result: Result, shown: int) -> str:
    """Return the sentence about the lines that were left out of the fit."""
    with_tones = {name: axis for name, axis in result.axes.items() if axis.tones}
    if not with_tones:
        return ''
    parts = [f'{spoken(name)} {_frequencies(axis, shown)}' for name, axis in with_tones.items()]
    return (f'{"; ".join(parts)}: vibration, mains or an idle tone of a converter, not noise; '
            'left out of the fit')


def _frequencies(axis: AxisResult, shown: int) -> str:
    unit = engineering(1.0, axis.unit)[1]
    texts = [f'{tone.frequency_hz:.4g} Hz '
             f'({number(engineering(tone.amplitude, axis.unit)[0], 3)} {unit})'
             for tone in sorted(axis.tones, key=lambda tone: -tone.amplitude)[:shown]]
    weaker = len(axis.tones) - shown + sum(tone.lines for tone in axis.weaker_tones)
    if weaker > 0:
        texts.append(f'{weaker} weaker')
    return listed(texts)
