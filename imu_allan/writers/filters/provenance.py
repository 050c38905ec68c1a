# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Heading of a configuration: the origin of its numbers, and the expected performance."""

from html import escape

from imu_allan.errors import printable
from imu_allan.finding_messages import trend_notes, why_left_out
from imu_allan.tuning.tune import assess
from imu_allan.tuning.uncertainty import known_less_than
from imu_allan.wording import duration, ranged
from imu_allan.writers.curves import axes_of
from imu_allan.writers.filters.chosen_numbers import Numbers, Sensor, SENSORS


def provenance(numbers: Numbers) -> list[str]:
    """Return lines on the origin of the numbers and their expected performance."""
    source, timeline = numbers.result.source, numbers.result.timeline
    lines = [f'IMU noise for {numbers.consumer.title}, by imu_allan '
             f'{printable(numbers.result.imu_allan_version)} from']
    if numbers.of_datasheet:
        lines += [f'the DATASHEET {printable(source.path)}: nothing of it was measured, and '
                  'sensors as mounted are often worse.']
        if any(one.of_flicker for own in numbers.coefficients.values() for one in own.values()):
            what = ('It has no K: filter K' if numbers.consumer.bias == 'random_walk' else
                    'It has no sigma and Tc: a process of sigma 1.08 B')
            lines += [f'{what} is as large as the flicker, 0.664 B, after '
                      f'{duration(numbers.coast_s)} unaided.']
        lines += _inflated(numbers)
    else:
        rate = '' if timeline.sample_rate_hz is None else f' at {timeline.sample_rate_hz:g} Hz'
        known = [text.format(printable(value)) for text, value in (
            ('{}', source.path), ('topic {}', source.topic), ('frame {}', source.frame_id),
            ('of {}', source.start_time)) if value]
        expected = _consistency(numbers)
        lines += [', '.join([*known, f'{timeline.samples} samples{rate} over '
                                     f'{timeline.duration_s:.6g} s']),
                  *_choice(numbers, bool(expected)), *expected]
    return [*lines, *(line for sensor in SENSORS for line in _dead(numbers, sensor))]


def _choice(numbers: Numbers, expected: bool) -> list[str]:
    lines = []
    if numbers.consumer.share == 'model':
        lines.append('The whole drift model, as measured: NIS and squared unaided errors '
                     'are expected to be what it predicts.')
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
    return lines + _left_out(numbers) + _inflated(numbers)


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


def _inflated(numbers: Numbers) -> list[str]:
    """Return the factors that the user applied to the numbers."""
    factors = ', '.join(f'{key} times {factor:g}' for key, factor
                        in sorted(numbers.options.inflate.items()))
    return [f'INFLATED on request: {factors}.'] if factors else []


def _consistency(numbers: Numbers) -> list[str]:
    """Return the expected performance of filters with the numbers of the file, by sensor."""
    aiding_s, coast_s = numbers.aiding_s, numbers.coast_s
    if aiding_s is None or numbers.consumer.share == 'model':
        return []
    lines = []
    for sensor in SENSORS:
        given = {name: numbers.given(sensor, name)
                 for name, axis in axes_of(numbers.result, sensor).items()
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
    if not axes_of(numbers.result, sensor):
        return [f'This result has no {SENSORS[sensor]}: its numbers are left out.']
    said = []
    for name, axis in axes_of(numbers.result, sensor).items():
        if axis.high_passed_hz is not None:
            said.append(f'{name} has come through a FILTER that takes out its slow part: it '
                        'is in none of the numbers below; take the raw topic')
        elif not numbers.of_axis[name]:
            said.append(f'{name} is DEAD in this recording '
                        f'({why_left_out(axis) or "too few samples"}): it is in none of the '
                        'numbers below')
    return said


def quoted_in_xml(text: str) -> str:
    """Escape `text` so that it cannot end an XML comment."""
    return escape(text, quote=False).replace('--', '- -')
