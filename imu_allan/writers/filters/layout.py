# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Lines of a configuration: heading, numbers with their remarks, names that cannot add lines."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
import json
from typing import Any

from imu_allan.errors import printable
from imu_allan.wording import is_table
from imu_allan.writers.filters.chosen_numbers import Key, Numbers, Scale, Sensor

Pair = tuple[Sensor, Key]

DIGITS = 6
"""Significant digits: a noise density is known to three at best."""

LETTERS: dict[Key, str] = {'N': 'N', 'K': 'K', 'sigma': 'sigma', 'time': 'Tc'}
_TERMS: dict[Pair, str] = {
    ('gyro', 'N'): 'angle random walk', ('gyro', 'K'): 'gyro bias random walk',
    ('accel', 'N'): 'velocity random walk', ('accel', 'K'): 'accelerometer bias random walk',
    ('gyro', 'sigma'): 'standard deviation of the gyro bias',
    ('accel', 'sigma'): 'standard deviation of the accelerometer bias',
    ('gyro', 'time'): 'correlation time of the gyro bias',
    ('accel', 'time'): 'correlation time of the accelerometer bias'}
UNITS: dict[Pair, str] = {
    ('gyro', 'N'): 'rad/s/sqrt(Hz)', ('gyro', 'K'): 'rad/s^2/sqrt(Hz)',
    ('accel', 'N'): 'm/s^2/sqrt(Hz)', ('accel', 'K'): 'm/s^3/sqrt(Hz)',
    ('gyro', 'sigma'): 'rad/s', ('accel', 'sigma'): 'm/s^2', ('gyro', 'time'): 's',
    ('accel', 'time'): 's'}
SAMPLE_UNITS: dict[Pair, str] = {
    ('gyro', 'N'): 'rad/s', ('gyro', 'K'): 'rad/s^2',
    ('accel', 'N'): 'm/s^2', ('accel', 'K'): 'm/s^3'}


@dataclass(frozen=True)
class Entry:
    """A number for a configuration, or why there is none, with what to say about it."""

    value: float | None
    remarks: tuple[str, ...]


def unscaled(value: float) -> float:
    """Return the number as it is."""
    return value


def times(factor: float) -> Scale:
    """Return what multiplies by a factor."""
    return lambda value: value * factor


def heading(numbers: Numbers, sign: str = '#') -> list[str]:
    """Return the comment at the top of a file."""
    return [f'{sign} {line}' for line in numbers.provenance()]


def pairs(numbers: Numbers, names: Mapping[Pair, str], scale: Scale = unscaled, scaling: str = '',
          units: Mapping[Pair, str] = UNITS, line: str = '{name}: {value}',
          sign: str = '#') -> list[str]:
    """Return lines ``name: worst axis``, each below its remarks."""
    lines = []
    for (sensor, key), name in names.items():
        entry = worst(numbers, sensor, key, scale, scaling, units[sensor, key])
        lines += ['', *(f'{sign} {remark}' for remark in entry.remarks)]
        lines += [f'{sign} {name}:' if entry.value is None
                  else line.format(name=name, value=real(entry.value))]
    return lines


def worst(numbers: Numbers, sensor: Sensor, key: Key, scale: Scale, scaling: str, unit: str
          ) -> Entry:
    """Return the largest of the axes' numbers, scaled, and what to say about it."""
    what = f'{_letter(numbers, key, scaling)} [{unit}], {_TERMS[sensor, key]}'
    found = numbers.worst(sensor, key)
    if found is None:
        return Entry(None, (f'{what}: this result has no value for it',))
    name, chosen = found
    if chosen.bound:
        bound = ('the most that its Allan deviation allows' if chosen.by_curve
                 else 'its 95 % upper bound')
        first = f'NOT OBSERVABLE on {name} in this recording: {bound}, the true value is smaller'
    else:
        first = f'{name}, the worst axis; {numbers.measured(name, key, scale)}'
    others = [f'{axis} {f"{scale(other.value):.4g}; " if numbers.tunings else ""}'
              f'{numbers.measured(axis, key, scale)}'
              for axis, other in numbers.known(sensor, key).items() if axis != name]
    return Entry(scale(chosen.value), (what, first, *others))


def measured(numbers: Numbers, sensor: Sensor, key: Key, scale: Scale = unscaled) -> str:
    """Say what was measured of each axis that has a number."""
    return ', '.join(f'{name[-1]} {numbers.measured(name, key, scale)}'
                     for name in numbers.known(sensor, key))


def each(numbers: Numbers, sensor: Sensor, key: Key, scale: Scale = unscaled
         ) -> tuple[list[float] | None, list[str]]:
    """Return the numbers of x, y, z, or None where one lacks, and what to say about them."""
    known = numbers.known(sensor, key)
    remarks = [measured(numbers, sensor, key, scale)] if known else []
    bounds = [name[-1] for name, one in known.items() if one.bound]
    if bounds:
        remarks.append(f'not observable on {", ".join(bounds)}, there the 95 % upper bound')
    allowed = [name[-1] for name, one in known.items() if one.by_curve]
    if allowed:
        remarks.append(f'on {", ".join(allowed)} the bound is the most that the Allan deviation '
                       'allows')
    if len(known) < 3:
        return None, ['the result does not have all three axes']
    return [scale(one.value) for one in known.values()], remarks


def triples(numbers: Numbers, names: Mapping[Pair, str], scale: Scale = unscaled,
            scaling: str = '', units: Mapping[Pair, str] = UNITS,
            line: str = '{name}: [{value}]', sign: str = '#') -> list[str]:
    """Return lines ``name: [x, y, z]``, each below its remarks."""
    lines = []
    for (sensor, key), name in names.items():
        values, remarks = each(numbers, sensor, key, scale)
        what = (f'{_letter(numbers, key, scaling)} of x, y, z [{units[sensor, key]}], '
                f'{_TERMS[sensor, key]}')
        lines += ['', f'{sign} {what}', *(f'{sign} {name}: {remark}' for remark in remarks)]
        lines += [f'{sign} {name}:' if values is None else
                  line.format(name=name, value=', '.join(real(value) for value in values))]
    return lines


def _letter(numbers: Numbers, key: Key, scaling: str) -> str:
    letter = f'filter {LETTERS[key]}' if numbers.tunings else LETTERS[key]
    return letter + ('' if not scaling else scaling if scaling[0] == '^' else f' {scaling}')


def document(numbers: Numbers, names: Mapping[Pair, str], *, notes: Sequence[str] = (),
             opens: Sequence[str] = (), indent: int = 0, ends: Sequence[str] = (),
             begin: Sequence[str] = (), **how: Any) -> str:
    """
    Return a file of one section: heading, notes, what opens the section, its numbers and ends.

    `begin` stands before the heading; `notes` are comments; `how` is for `pairs`.
    """
    return joined([*begin, *heading(numbers), *(f'# {note}' for note in notes), *opens,
                   *indented([*pairs(numbers, names, **how), *ends], indent)])


def with_topic(numbers: Numbers, key: str) -> list[str]:
    """Return the line of the topic after an empty one; nothing where none is known."""
    topic = topic_of(numbers)
    return ['', f'{key}: {topic}'] if topic else []


def topic_of(numbers: Numbers) -> str | None:
    """Return the topic, quoted, or None."""
    topic = numbers.result.source.topic
    return quoted(topic) if topic and not is_table(topic) else None


def indented(lines: Sequence[str], by: int) -> list[str]:
    """Return lines further to the right; empty ones stay empty."""
    return [f'{" " * by}{line}' if line else '' for line in lines]


def real(value: float) -> str:
    """`value` in six digits, so that YAML 1.1 reads it, where a real must have a point."""
    text = repr(float(f'{value:.{DIGITS - 1}e}'))
    return text.replace('e', '.0e') if 'e' in text and '.' not in text else text


def quoted(text: str) -> str:
    """`text` as a string in YAML and JSON."""
    return json.dumps(printable(text), ensure_ascii=False)


def joined(lines: Sequence[str]) -> str:
    """Return the text of a file."""
    return '\n'.join(line.rstrip(' ') for line in lines) + '\n'
