# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Configurations from templates: files in the consumer's format, with formulas for numbers.

The folder templates/ has one template per consumer. Lines that begin with ``#:`` state where in
the consumer's source the meaning of its numbers was read. Other lines may contain:

- ``{gyro N sqrt(f)}``, a number of the worst axis, in the unit that follows ``in``. With
  ``of x, y, z``, ``on the diagonal`` of a matrix or ``times identity`` it is several numbers.
  ``from 0.1 to 1`` keeps it within a range that is safe to load, and ``gyro_x`` selects an axis.
  Remarks on it are inserted above it as comments.
- ``{heading}``, the origin of the numbers; ``{f}`` and ``{1/f}`` for the rate, ``{rates}`` for
  the rate of each sensor; ``{topic}``; and ``{hours}``, the correlation time of all axes.

A paragraph with a value that the result lacks is omitted. For a number of a whole sensor, a
comment says so. The heading of every file gives the origin of its numbers, and what they are
expected to reach (`provenance`).
"""

from collections.abc import Sequence
from functools import cache
from importlib.resources import files
import json
from math import inf, sqrt
import re
from typing import cast

from imu_allan.errors import printable
from imu_allan.finding_messages import trend_notes, why_left_out
from imu_allan.sensor.units import convert
from imu_allan.tuning.forecast import known_less_than
from imu_allan.tuning.tune import assess
from imu_allan.wording import amount_of, duration, is_table, names_of, origin_of, ranged
from imu_allan.writers.curves import axes_of
from imu_allan.writers.filters.chosen_numbers import Key, Numbers, Scale, Sensor, SENSORS, times

_NUMBER = re.compile(
    r'\{(?P<sensor>gyro|accel)(?:_(?P<letter>[xyz]))? (?P<key>N|K|sigma|Tc|mean)(?P<scaling>.*?)'
    r'(?: in (?P<unit>\S+?))?(?: (?P<layout>of x, y, z|on the diagonal|times identity))?'
    r'(?: from (?P<least>\S+) to (?P<most>\S+))?\}')
UNITS: dict[tuple[Sensor, Key], str] = {
    ('gyro', 'N'): 'rad/s/sqrt(Hz)', ('gyro', 'K'): 'rad/s^2/sqrt(Hz)',
    ('accel', 'N'): 'm/s^2/sqrt(Hz)', ('accel', 'K'): 'm/s^3/sqrt(Hz)',
    ('gyro', 'sigma'): 'rad/s', ('accel', 'sigma'): 'm/s^2',
    ('gyro', 'Tc'): 's', ('accel', 'Tc'): 's'}


def filled(numbers: Numbers) -> str:
    """Return the configuration of a consumer that has a template."""
    made = (expanded(numbers, paragraph) for paragraph in _paragraphs(numbers.name))
    return joined(['\n\n'.join(paragraph for paragraph in made if paragraph is not None)])


@cache
def _paragraphs(name: str) -> list[str]:
    template = files(__package__) / 'templates' / f'{name}.in'
    lines = template.read_text(encoding='utf-8').splitlines()
    return '\n'.join(line for line in lines if not line.startswith('#:')).split('\n\n')


def expanded(numbers: Numbers, paragraph: str) -> str | None:
    """Return lines of a template with the fields filled in; None if one is unknown."""
    comments = {'m': ('% ', ''), 'json': ('// ', ''), 'info': ('; ', ''),
                'xml': ('<!-- ', ' -->'), 'sdf': ('<!-- ', ' -->')}
    before, after = comments.get(numbers.consumer.file.rpartition('.')[2], ('# ', ''))
    lines, last = [], ''
    for line in paragraph.split('\n'):
        field = _NUMBER.search(line) if '{' in line else None
        if field is None:
            known = _word_filled(numbers, line)
            if known is None:
                return None
            lines += known
            continue
        # The lines of an autopilot have two numbers before the name.
        name = re.findall(r'[A-Za-z][\w./]*', line)[0]
        value, remarks = _value(numbers, name, field)
        if value is None and field['letter']:
            return None
        indent = line[:len(line) - len(line.lstrip())]
        if field[0] != last:
            # If two keys use the same number, explain it only once.
            lines += [f'{indent}{before}{quoted_in_xml(remark) if after else remark}{after}'
                      for remark in remarks]
        last = field[0]
        lines.append(f'{indent}{before}{name}:{after}' if value is None else
                     f'{line[:field.start()]}{value}{line[field.end():]}')
    return '\n'.join(lines)


def _word_filled(numbers: Numbers, line: str) -> list[str] | None:
    """Fill in a line without a number; return None if its field is unknown."""
    word = re.search(r'\{(heading|f|f:g|1/f|rates|hours|topic)(?: or ([^}]*))?\}', line)
    if word is None:
        return [line]
    before, after = line[:word.start()], line[word.end():]
    if word[1] == 'heading':
        said = provenance(numbers)
        return [f'{before}{one}' for one in (said if before else map(quoted_in_xml, said))]
    if word[1] == 'topic':
        topic = numbers.result.source.topic
        shown = word[2] if not topic or ',' in topic or is_table(topic) else json.dumps(
            printable(topic), ensure_ascii=False)
        return None if shown is None else [f'{before}{shown}{after}']
    if word[1] == 'hours':
        found = numbers.worst('gyro', 'Tc') or numbers.worst('accel', 'Tc')
        return None if found is None else [f'{before}{real(found[1].value / 3600)}{after}']
    rates = {sensor: numbers.rate(sensor) for sensor in SENSORS}
    same = len(set(rates.values())) == 1
    f = rates['gyro']
    text = {'f': real(f), '1/f': real(1 / f), 'f:g': f'{f:g}',
            'rates': f'f = {f:g} Hz' if same else 'f = ' + ', '.join(
                f'{rate:g} Hz ({sensor})' for sensor, rate in rates.items())}[word[1]]
    return [f'{before}{text}{after}']


def _value(numbers: Numbers, name: str, field: re.Match[str]) -> tuple[str | None, list[str]]:
    """Return a number as written in the file, and the remarks on it."""
    sensor = cast('Sensor', field['sensor'])
    axis = f'{sensor}_{field["letter"]}'
    if field['key'] == 'mean':
        # The mean of a dead or high-passed axis is not its bias.
        mean = numbers.result.axes[axis].mean if numbers.of_axis.get(axis) else None
        return None if mean is None else real(mean), []
    key = cast('Key', field['key'])
    scale, unit = _scale(numbers, sensor, key, field)
    largest = numbers.worst(sensor, key)
    tuned = numbers.tunings or (
        numbers.of_datasheet and largest is not None and largest[1].of_flicker)
    what = f'{"filter " if tuned else ""}{key}{field["scaling"]}'
    words = ('angle', 'gyro') if sensor == 'gyro' else ('velocity', 'accelerometer')
    terms: dict[str, str] = {
        'N': '{0} random walk', 'K': '{1} bias random walk',
        'sigma': 'standard deviation of the {1} bias', 'Tc': 'correlation time of the {1} bias'}
    term = f'[{unit}], {terms[key].format(*words)}'
    if field['letter']:
        number = numbers.of_axis.get(axis, {}).get(key)
        return (None, []) if number is None else (
            real(scale(number.value)), [f'{what} {numbers.measured(axis, key, scale)}'])
    if field['layout'] in ('of x, y, z', 'on the diagonal'):
        values, said = each(numbers, sensor, key, scale)
        remarks = [f'{what} of x, y, z {term}', *(f'{name}: {remark}' for remark in said)]
        if values is not None and field['layout'] == 'on the diagonal':
            values = [values[i] if i == j else 0.0 for i in range(3) for j in range(3)]
        return None if values is None else ', '.join(map(real, values)), remarks
    value, said = worst(numbers, sensor, key, scale)
    if value is None:
        return None, [f'{what} {term}: {numbers.no_value}']
    remarks = [f'{what} {term}', *said]
    if field['layout'] == 'times identity':
        rows = ([value if i == j else 0.0 for j in range(3)] for i in range(3))
        return ''.join(f'\n  - [{", ".join(map(real, row))}]' for row in rows), remarks
    if field['least']:
        least, most = float(field['least']), float(field['most'])
        remarks.append(f"at rest {real(value)}; {numbers.consumer.title}'s default {least:g}, "
                       f'at most {most:g}')
        value = min(max(value, least), most)
    return real(value), remarks


def _scale(numbers: Numbers, sensor: Sensor, key: Key, field: re.Match[str]) -> tuple[Scale, str]:
    """Return the scaling of a number by its formula, and the resulting unit."""
    # The power, a factor, and the power of the rate.
    scalings = {
        '': (1, 1.0, 0.0), ' sqrt(2)': (1, sqrt(2), 0.0), ' sqrt(f)': (1, 1.0, 0.5),
        ' sqrt(2 f)': (1, sqrt(2), 0.5), '^2': (2, 1.0, 0.0), '^2 f': (2, 1.0, 1.0),
        '^2/f': (2, 1.0, -1.0)}
    # Templates of autopilots write F for the prediction rate.
    power, factor, of_rate = scalings[field['scaling'].replace('F', 'f')]
    unit = UNITS[sensor, 'sigma' if of_rate < 0 else key]
    if field['unit'] is not None:
        return times(factor * convert(1.0, unit, field['unit'])), field['unit']
    if of_rate:
        # Request the rate only if it is needed.
        factor *= numbers.rate(sensor)**of_rate
        unit = unit.removesuffix('/sqrt(Hz)')
    return (lambda value: value**power * factor), f'({unit})^2' if power == 2 else unit


def worst(numbers: Numbers, sensor: Sensor, key: Key, scale: Scale = float
          ) -> tuple[float | None, list[str]]:
    """Return the largest number of the axes, scaled, with remarks on all axes."""
    found = numbers.worst(sensor, key)
    if found is None:
        return None, []
    name, chosen = found
    if chosen.bound:
        first = (f'NOT OBSERVABLE on {name} in this recording: its 95 % upper bound, the true '
                 'value is smaller')
    else:
        first = f'{name}, the worst axis; {numbers.measured(name, key, scale)}'
    others = [f'{axis} {f"{scale(other.value):.4g}; " if numbers.tunings else ""}'
              f'{numbers.measured(axis, key, scale)}'
              for axis, other in numbers.known(sensor, key).items() if axis != name]
    return scale(chosen.value), [first, *others]


def each(numbers: Numbers, sensor: Sensor, key: Key, scale: Scale = float
         ) -> tuple[list[float] | None, list[str]]:
    """Return the numbers of x, y and z, or None if one is missing, with remarks."""
    known = numbers.known(sensor, key)
    if len(known) < 3:
        return None, ['the result does not have all three axes' if known else numbers.no_value]
    remarks = [', '.join(f'{name[-1]} {numbers.measured(name, key, scale)}' for name in known)]
    bounds = [name[-1] for name, one in known.items() if one.bound]
    if bounds:
        remarks.append(f'not observable on {", ".join(bounds)}, there the 95 % upper bound')
    return [scale(one.value) for one in known.values()], remarks


def heading(numbers: Numbers, sign: str = '#') -> list[str]:
    """Return the comment at the top of a file."""
    return [f'{sign} {line}' for line in provenance(numbers)]


def real(value: float) -> str:
    """Return `value` to six digits, with the decimal point that YAML 1.1 requires in a real."""
    # A noise density is known to three digits at best.
    text = repr(float(f'{value:.5e}'))
    return text.replace('e', '.0e') if 'e' in text and '.' not in text else text


def joined(lines: Sequence[str]) -> str:
    """Join lines to the text of a file."""
    return '\n'.join(line.rstrip(' ') for line in lines) + '\n'


def provenance(numbers: Numbers) -> list[str]:
    """Return lines on the origin of the numbers and their expected performance."""
    result = numbers.result
    lines = [f'IMU noise for {numbers.consumer.title}, by imu_allan '
             f'{printable(result.imu_allan_version)} from']
    if numbers.of_datasheet:
        lines += [f'the DATASHEET {printable(result.source.path)}: nothing of it was measured, '
                  'and sensors as mounted are often worse.']
        if any(one.of_flicker for own in numbers.coefficients.values() for one in own.values()):
            what = ('Filter K is' if numbers.consumer.bias == 'random_walk' else
                    'Sigma and Tc are those of a process')
            lines += [f'{what} as large as all slow noise after {duration(numbers.coast_s)} '
                      'unaided; flicker is 0.664 B.']
    else:
        expected = _consistency(numbers)
        lines += [', '.join([*names_of(result), *origin_of(result), amount_of(result.timeline)]),
                  *_choice(numbers, bool(expected)), *expected]
    if inflate := sorted(numbers.options.inflate.items()):
        factors = ', '.join(f'{key} times {factor:g}' for key, factor in inflate)
        lines.append(f'INFLATED on request: {factors}.')
    return [*lines, *(line for sensor in SENSORS for line in _dead(numbers, sensor))]


def _choice(numbers: Numbers, expected: bool) -> list[str]:
    lines = []
    if numbers.consumer.share == 'model':
        known = known_less_than(numbers.result.axes, inf) or 0.0
        lines += ['The whole drift model, as measured: NIS and squared unaided errors are '
                  f'expected to be what it predicts, up to {duration(known)}',
                  'unaided. The recording knows no more, and unlike filter N and K the model is '
                  'not widened beyond it.']
        lines += [f'{name}: ' + ', '.join(
            f'{key} {numbers.measured(name, key)}' for key in numbers.coefficients[name])
            for name in numbers.result.axes if numbers.coefficients[name]]
        lines += trend_notes(numbers.result)
    elif numbers.aiding_s is None:
        lines.append(f'Noise densities as measured: {numbers.consumer.aiding.reason}.')
    elif numbers.options.as_measured:
        lines.append('Coefficients as measured (IEEE Std 952), not tuned.')
        lines += _beyond(numbers, 'what is expected is') if expected else []
    elif not numbers.tunings:
        lines.append('Coefficients as measured: this result has no drift model to tune from.')
    else:
        why = f' ({numbers.consumer.aiding.reason})' if numbers.options.aiding_s is None else ''
        kind = 'Conservatively tuned' if numbers.options.conservative else 'Tuned'
        lines.append(f'{kind} for a correction every {duration(numbers.aiding_s)}{why} and '
                     f'{duration(numbers.coast_s)} unaided.')
        lines += _beyond(numbers, 'the numbers are')
        lines += trend_notes(numbers.result)
    return lines + _left_out(numbers)


def _beyond(numbers: Numbers, what: str) -> list[str]:
    """Return a warning if the longest unaided time is beyond the reach of the recording."""
    known = known_less_than(numbers.result.axes, numbers.coast_s)
    return [] if known is None else [
        f'WARNING: this recording knows {duration(known)} at most; beyond it {what} widened, '
        f'and K may be', 'many times that of a recording that is longer than '
        f'{duration(numbers.coast_s)}.']


def _left_out(numbers: Numbers) -> list[str]:
    """Return which axes have noise that the coefficients do not include."""
    # If combined recordings have no common exponent, there is only a warning.
    reported = {axis for found in numbers.result.warnings if found.code == 'power_law'
                for axis in found.axes}
    laws = {name: 'not the same in all recordings' if axis.power_law is None else
            f'1/f to the power of {axis.power_law.exponent:.2f}'
            for name, axis in numbers.result.axes.items()
            if (axis.power_law is not None or name in reported) and name not in numbers.tunings}
    if not laws or numbers.consumer.share == 'model':
        return []
    each = ', '.join(f'{name} {law}' for name, law in laws.items())
    instead = '; tuned numbers have it in them' if numbers.options.as_measured else ''
    return [f'LEFT OUT: slow noise that is no flicker ({each}){instead}.']


def _consistency(numbers: Numbers) -> list[str]:
    """Return the expected performance of filters with the numbers of the file, by sensor."""
    aiding_s, coast_s = numbers.aiding_s, numbers.coast_s
    if aiding_s is None or numbers.consumer.share == 'model':
        return []
    lines = []
    for sensor in SENSORS:
        given = {name: numbers.given(sensor, name)
                 for name, axis in axes_of(numbers.result.axes, sensor).items()
                 if axis.drift_model is not None and numbers.of_axis[name]}
        met = [assess(numbers.result.axes[name], own['N'].value, own['K'].value, aiding_s,
                      coast_s, own['Tc'].value if 'Tc' in own else None)
               for name, own in given.items() if 'K' in own]
        if met:
            nis, coast = (ranged(values, '{:.2g}'.format) for values in (
                [one.nis for one in met], [one.coast_ratio for one in met]))
            lines.append(f'{sensor}: expected NIS {nis}; squared error after {duration(coast_s)} '
                         f'unaided {coast} times what the filter predicts (1 is right, above 1 '
                         'overconfident).')
    return lines


def _dead(numbers: Numbers, sensor: Sensor) -> list[str]:
    """Return which axes have no numbers, and why."""
    if not axes_of(numbers.result.axes, sensor):
        return [f'This result has no {SENSORS[sensor]}: its numbers are left out.']
    said = []
    for name, axis in axes_of(numbers.result.axes, sensor).items():
        if axis.high_passed_hz is not None:
            said.append(f'{name} has come through a FILTER that takes out its slow part: it '
                        'is in none of the numbers below; take the raw topic')
        elif not numbers.of_axis[name]:
            said.append(f'{name} is DEAD in this recording '
                        f'({why_left_out(axis) or "too few samples"}): it is in none of the '
                        'numbers below')
    return said


def quoted_in_xml(text: str) -> str:
    """Separate the hyphens of a text, as no two may stand together in an XML comment."""
    return re.sub('-(?=-)', '- ', text)
