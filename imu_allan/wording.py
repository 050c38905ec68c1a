# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Wording of numbers, durations, sensors, units and recordings, shared by all outputs.

Terminal, report, figures, topics and messages of one result use the same words for the same thing.
Units and colours are not handled here.
"""

from collections.abc import Callable, Iterable, Sequence
from math import floor, isfinite, log10
import os
from pathlib import Path
import re

from imu_allan.errors import printable
from imu_allan.result import Inspection, Result, Timeline

SENSORS = {'gyro': 'Gyroscope', 'accel': 'Accelerometer'}
SAMPLES = {'gyro': 'angular rate', 'accel': 'acceleration'}

NO_TOPIC = 'csv'
"""Used as the topic of a table, which has none."""

_PLAIN = (-4, 6)
"""Powers of ten between which numbers are written without an exponent."""


def number(value: float, digits: int = 4) -> str:
    """
    Return a number that has no interval, to significant digits without trailing zeros.

    Examples
    --------
    >>> number(2.40642), number(12345.6), number(2.86e-5), number(99.6, 2)
    ('2.406', '12346', '2.86e-05', '100')

    """
    # Rounding may carry: 99.6 to two digits is 100, not 1e+02.
    if 10.0**digits - 0.5 <= abs(value) < 10.0**_PLAIN[1]:
        return f'{value:.0f}'
    return f'{value:.{digits}g}'


def bounded(bound: float, symbol: str = '') -> str:
    """
    Return the text of an upper bound; the ramp R has a sign, so its bound is of the magnitude.

    Examples
    --------
    >>> bounded(52071.3, 'R'), bounded(0.0372, 'K'), bounded(47.96, 'K')
    ('|R| < 52100', '< 0.0372', '< 48.0')

    """
    return f'{"|R| " if symbol == "R" else ""}< {rounded(bound)}'


def rounded(value: float, digits: int = 3) -> str:
    """
    Return a number to two to six significant digits, trailing zeros included.

    Examples
    --------
    >>> rounded(0.53), rounded(149.96), rounded(99.96), rounded(5.3e-7)
    ('0.530', '150', '100', '5.30e-07')

    """
    # Rounding may carry: 99.96 to three digits is 100.
    shown = float(f'{value:.{digits - 1}e}')
    if shown == 0 or not isfinite(shown):
        return number(shown)
    return _rounded(shown, floor(log10(abs(shown))) - digits + 1)


def measured(value: float, low: float, high: float) -> tuple[str, str, str]:
    """
    Return a value and its interval with the digits that the width of the interval supports.

    The nearer bound decides, by the rule of the Particle Data Group: one digit of the distance is
    written, or two if it begins with less than 3.55. Trailing zeros are kept, as they are
    significant. A bound that is many times nearer to zero keeps two digits of its own. The rule
    is in "Review of Particle Physics", Introduction, section 5.3.

    Examples
    --------
    >>> measured(2.40642, 2.40161, 2.41123)
    ('2.406', '2.402', '2.411')
    >>> measured(150.02, 149.97, 150.07)
    ('150.02', '149.97', '150.07')
    >>> measured(49.5, 1.23, 310.4)
    ('50', '1.2', '310')

    """
    distance = min((abs(bound - value) for bound in (low, high) if bound != value), default=0.0)
    if not (distance > 0 and isfinite(distance)):
        return number(value), number(low), number(high)
    place = floor(log10(distance))
    last = place if distance / 10.0**place >= 3.55 else place - 1
    return _rounded(value, last), _rounded(low, last), _rounded(high, last)


def _rounded(value: float, last: int) -> str:
    """Return `value` down to the digit at 10^`last`, with two to six digits."""
    if value == 0:
        return '0'
    digits = min(max(floor(log10(abs(value))) - last + 1, 2), 6)
    # Rounding may carry: 9.99 to two digits is 10.
    shown = float(f'{value:.{digits - 1}e}')
    first = floor(log10(abs(shown)))
    digits = min(max(first - last + 1, 2), 6)
    if not _PLAIN[0] <= first < _PLAIN[1]:
        return f'{value:.{digits - 1}e}'
    return f'{shown:.{max(0, digits - 1 - first)}f}'


def duration(seconds: float) -> str:
    """
    Return a length of time as a person would say it.

    Examples
    --------
    >>> [duration(seconds) for seconds in (0.04, 9.34, 87.1, 119.99, 345, 10_000, 259_200)]
    ['40 ms', '9.34 s', '87 s', '2 min', '5 min 45 s', '2 h 47 min', '3 days']
    >>> [duration(seconds) for seconds in (0.9994, 0.9999999)]
    ['999 ms', '1 s']

    """
    if seconds >= 172_800:
        return f'{seconds / 86_400:.3g} days'
    if round(seconds) >= 7200:
        hours, minutes = divmod(round(seconds / 60), 60)
        return f'{hours} h {minutes} min' if minutes else f'{hours} h'
    if round(seconds) >= 120:
        minutes, rest = divmod(round(seconds), 60)
        return f'{minutes} min {rest} s' if rest else f'{minutes} min'
    if seconds >= 60:
        return f'{seconds:.0f} s'
    return f'{seconds:.3g} s' if seconds >= 0.9995 or seconds == 0 else f'{seconds * 1e3:.3g} ms'


def about(seconds: float) -> str:
    """
    Return a length of time rounded to two digits of its unit.

    Examples
    --------
    >>> [about(seconds) for seconds in (0.123, 191.0, 1215.0, 7900.0, 156_300.0)]
    ['120 ms', '3 min 10 s', '20 min', '2 h 12 min', '43 h']

    """
    size = 3600.0 if round(seconds) >= 7200 else 60.0 if seconds >= 600 else 1.0
    return duration(float(f'{seconds / size:.2g}') * size)


def counted(count: int, one: str, many: str | None = None) -> str:
    """
    Return a count with its noun.

    Examples
    --------
    >>> counted(1, 'gap'), counted(1200, 'gap'), counted(2, 'axis', 'axes')
    ('1 gap', '1,200 gaps', '2 axes')

    """
    return f'{count:,} {one if count == 1 else many or one + "s"}'


def listed(words: Sequence[str]) -> str:
    """
    Return words as a list in a sentence.

    Examples
    --------
    >>> listed(['x', 'y', 'z']), listed(['x'])
    ('x, y and z', 'x')

    """
    if len(words) < 2:
        return ''.join(words)
    return f'{", ".join(words[:-1])} and {words[-1]}'


def ranged(values: Iterable[float], say: Callable[[float], str]) -> str:
    """
    Return the lowest and the highest of some numbers, or only one if both read the same.

    Examples
    --------
    >>> ranged([3.0, 1.0, 2.0], '{:g}'.format), ranged([0.11, 0.12], '{:.1f}'.format)
    ('1 to 3', '0.1')

    """
    known = list(values)
    return ' to '.join(dict.fromkeys(say(end) for end in (min(known), max(known))))


def spoken(axis: str) -> str:
    """Return the name of an axis or a term in a sentence: ``gyro x`` for ``gyro_x``."""
    return axis.replace('_', ' ')


def named(axes: Sequence[str]) -> str:
    """
    Name axes in a sentence.

    Examples
    --------
    >>> named(['gyro_x', 'gyro_z', 'accel_x', 'accel_y', 'accel_z'])
    'gyro x and z, accel x, y and z'
    >>> named(['gyro_x', 'gyro_y', 'gyro_z', 'accel_x', 'accel_y', 'accel_z'])
    'all axes'

    """
    if len(set(axes)) == 6:
        return 'all axes'
    sensors: dict[str, list[str]] = {}
    for axis in axes:
        sensor, _, letter = axis.partition('_')
        sensors.setdefault(sensor, []).append(letter)
    return ', '.join(f'{sensor} {listed(sorted(letters))}' for sensor, letters in sensors.items())


def names_of(result: Result) -> list[str]:
    """Return where the samples came from: path and topic as far as known, printable."""
    source = result.source
    names = (source.path, source.topic if source.topic != NO_TOPIC else None)
    return [printable(name) for name in names if name] or ['samples']


def amount_of(timeline: Timeline) -> str:
    """Return how much was recorded: ``2,160,000 samples at 200 Hz, 3 h, 2 h 55 min at rest``."""
    rate = '' if timeline.sample_rate_hz is None else f' at {timeline.sample_rate_hz:.6g} Hz'
    whole, still = duration(timeline.duration_s), duration(timeline.rest_s)
    rest = f', {still} at rest' if timeline.motion and still != whole else ''
    return f'{counted(timeline.samples, "sample")}{rate}, {whole}{rest}'


def origin_of(result: Result) -> list[str]:
    """Return unit, frame, start time and clock as far as known, printable."""
    source, unit = result.source, result.inspection or Inspection()
    found = (('serial number {}', unit.serial), ('operator {}', unit.operator),
             ('station {}', unit.station), ('frame {}', source.frame_id),
             ('from {}', source.start_time),
             ('{}', source.clock and clock_of(source.clock, source.topic)))
    return [text.format(printable(value)) for text, value in found if value]


def clock_of(clock: str, topic: str | None) -> str:
    """
    Name the clock of the stamps.

    Examples
    --------
    >>> clock_of('header', '/imu'), clock_of('header', 'csv'), clock_of('header', 'Gyroscope.csv')
    ('header stamps', 'time column', 'time column')

    """
    return 'time column' if is_table(topic) else f'{clock} stamps'


def is_table(topic: str | None) -> bool:
    """Return whether a topic is a CSV file, one of a folder or columns, not a topic of ROS."""
    return topic == NO_TOPIC or (topic or '').lower().endswith(('.csv', ' columns'))


def faults_of(timeline: Timeline) -> list[str]:
    """Return the faults of the samples with their counts; empty if there are none."""
    counts = {'missing': timeline.missing, 'duplicate': timeline.duplicates,
              'out of order': timeline.out_of_order, 'rejected': timeline.rejected}
    faults = [f'{count:,} {name}' for name, count in counts.items() if count]
    names = ('gap', 'gaps'), ('segment of motion', 'segments of motion')
    faults += [f'{counted(spans.count, *name)} ({duration(spans.duration_s)})'
               for spans, name in zip(timeline.totals, names, strict=True) if spans.count]
    return faults


def unit_names(paths: Sequence[str | os.PathLike[str]], *, by_folder: bool = False) -> list[str]:
    """
    Name units after their files, or the folders of these, below the folder that they share.

    Examples
    --------
    >>> unit_names(['bench/sn1.mcap', 'bench/sn2.mcap'])
    ['sn1', 'sn2']
    >>> unit_names(['monday/sn1/result.json', 'tuesday/sn1/result.json'])
    ['monday_sn1', 'tuesday_sn1']

    """
    # A link names its unit, whatever the recording is called.
    whole = [Path(os.path.abspath(path)) for path in paths]  # noqa: PTH100
    whole = [path.parent if by_folder or path.name == 'result.json' else
             path if path.is_dir() else path.with_suffix('') for path in whole]
    shared = os.path.commonpath([path.parent for path in whole]) if whole else ''
    return distinct_names(str(path.relative_to(shared)) for path in whole)


def distinct_names(names: Iterable[str]) -> list[str]:
    """
    Turn names into names of folders, and number those that occur again.

    No name leads out of the parent folder, and no name is too long for a file system.
    """
    taken: dict[str, str] = {}
    for name in names:
        safe = re.sub(r'[^\w.-]+', '_', name).lstrip('.')
        # In bytes: file systems allow 255, and a number may have to be added.
        own = first = safe.encode()[:200].decode(errors='ignore') or 'recording'
        number = 1
        # On a file system that ignores case, names that differ only in case are one folder.
        while own.casefold() in taken:
            number += 1
            own = f'{first}-{number}'
        taken[own.casefold()] = own
    return list(taken.values())


def natural(name: str) -> tuple[tuple[object, ...], str]:
    """Return a key that sorts ``unit2`` before ``unit10``, and ``bag_2`` before ``bag_10``."""
    # Text and numbers alternate, so that compared parts of two names always have the same type.
    return tuple(int(part) if place % 2 else part.casefold()
                 for place, part in enumerate(re.split(r'(\d+)', name))), name
