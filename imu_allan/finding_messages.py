# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Messages of findings, from the texts in `imu_allan.finding_texts` and their values.

No other module composes such messages. Findings also decide whether the numbers of a sensor can
be used (`sensor_verdicts`).
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from math import ceil
import re
from string import Formatter
from typing import Any, get_args, get_origin, Literal

from imu_allan.errors import printable
from imu_allan.finding import CODES, Finding, is_of_kind, is_optional, known, Severity
from imu_allan.finding_texts import most, Span, Text, WORDS, Words
from imu_allan.noise.terms import TERMS
from imu_allan.result import AxisResult, Result, SensorVerdict
from imu_allan.sensor.units import engineering
from imu_allan.wording import about, counted, duration, listed, named, number, ranged, SENSORS

SHORTEST_GOOD_S = 60.0
"""With less rest no term slower than N is visible."""
FAULTS = {'constant': 'constant_axis', 'dead': 'stood_still', 'saturated': 'saturated',
          'zeroed': 'deadband'}
"""Codes of findings by `AxisResult.fault`: a file may hold the fault without the finding."""


def title_of(found: Finding) -> str:
    """Return the name of a finding, two or three words long."""
    return _words(found).title


def brief(found: Finding) -> str:
    """Return why a sensor is not good by a finding, in a few words."""
    return _made(_words(found).brief, found) or title_of(found)


def sentence_of(found: Finding) -> str:
    """Return the sentence with the values of a finding, preceded by what it is about."""
    if made := _made(_words(found).says, found):
        return f'{_about(found)}{made}'
    return printable(found.message) or f'{_about(found)}{title_of(found)}'


def advice(found: Finding, *, live: bool = False) -> str:
    """Return advice on a finding, for a recording or a running node; '' if there is none."""
    words = _words(found)
    if not _made(words.says, found):
        return ''
    return _made(words.live if live and words.live is not None else words.do, found)


def _words(found: Finding) -> Words:
    """Return the texts of a finding; of a code that only another version knows, a title."""
    return WORDS.get(found.code) or Words(printable(found.code).replace('_', ' '), '', '', says='')


def _made(text: Text, found: Finding) -> str:
    """Return a sentence; '' if a file of another version lacks values for it."""
    if not text:
        return ''
    figures = _figures(found)
    try:
        chosen = text(figures) if callable(text) else text
        template = chosen if isinstance(chosen, str) else next(
            one for one in chosen if one is chosen[-1] or figures.keys() >= {*_names_in(one)})
        # Not an index such as `covariance[0]`, which holds no value.
        whole = re.sub(r'\[([^][]*\{[^][]*)\]', lambda part: (
            part[1] if _names_in(part[1])[0] in figures else ''), template)
        return printable(_Formatter().vformat(whole, (), figures))
    except (KeyError, TypeError, ValueError, AttributeError, IndexError):
        return ''


def _names_in(template: str) -> list[str]:
    return re.findall(r'\{(\w+)', template)


class _Formatter(Formatter):
    """Formats values in the forms that the texts of findings have."""

    def format_field(self, value: Any, spec: str) -> str:
        """Return a value, or the range of those of several axes, in a form of `finding_texts`."""
        form, _, rest = spec.partition(' ')
        if form in ('least', 'most'):
            end = min if form == 'least' else max
            return self.format_field(end(value) if isinstance(value, Span) else value, rest)
        if form == 'if':
            return rest if most(value) else ''
        if form == 'one':
            # What stands before the bar is for one, what follows it for several.
            return rest.partition('|')[0 if most(value) == 1 else 2]
        if form == 'each':
            each = value if isinstance(value, Span) else (value,)
            return listed(list(dict.fromkeys(f'{one:g}' for one in each)))
        if form == 'count':
            return counted(value, rest)
        say, unit = _FORMS.get(spec, lambda one: format(one, spec)), ''
        if spec.endswith('%'):
            say, unit = lambda one: f'{100 * one:{spec[:-1] or ".0"}f}', ' %'
        elif form.isdigit():
            size, shown = engineering(1.0, rest[3:]) if rest else (1.0, '')
            say, unit = lambda one: number(size * one, int(form)), f' {shown}'.rstrip()
        return (ranged(value, say) if isinstance(value, Span) else say(value)) + unit


_FORMS: Mapping[str, Callable[[Any], str]] = {
    'time': duration, 'about': about, 'lag': lambda seconds: duration(abs(seconds)),
    'times': lambda count: 'once' if count == 1 else f'{count} times',
    # From a factor of two on, an error is not given as a percentage.
    'within': lambda factor: (f'within {max(100 * (factor - 1), 1):.0f} %' if factor < 2
                              else f'within a factor of {factor:.0f}'),
    'start': lambda seconds: (f'{ceil(seconds / 60)}min' if seconds > 600
                              else f'{ceil(seconds)}s'),
    'sensor': lambda sensor: SENSORS[sensor].lower(), 'term': lambda key: TERMS[key].symbol,
    'list': ', '.join, 'both': ' and '.join}
"""Forms of one value that the texts of findings use besides those of Python."""


def _figures(found: Finding) -> dict[str, Any]:
    """Return the values that match the types in `CODES`, as a file may hold anything."""
    figures: dict[str, Any] = {'severity': found.severity}
    for name, kind in CODES[found.code].values.items():
        value: Any = found.values.get(name)
        each = value if is_of_axes(found, name) else (value,)
        if all(one is not None and is_of_kind(one, kind) for one in each):
            figures[name] = Span(value) if each is value else value
    return figures


def is_of_axes(found: Finding, name: str) -> bool:
    """Return whether a value of a finding is a list with one entry per axis."""
    kind = CODES[found.code].values.get(name) if found.code in CODES else None
    value = found.values.get(name)
    return (isinstance(value, (list, tuple)) and len(value) == len(found.axes) > 1
            and get_origin(known(kind)) is not tuple)


def message_of(found: Finding, *, live: bool = False) -> str:
    """Return finding and advice on one line."""
    do = advice(found, live=live)
    return f'{_ended(sentence_of(found))} -> {do}' if do else sentence_of(found)


def in_full(findings: Iterable[Finding], *, together: bool, live: bool = False
            ) -> Iterator[tuple[Severity, str]]:
    """Yield severity and text of findings; `together` merges those that differ only in values."""
    for (severity, title, do), same in groupby(
            findings, key=lambda found: (found.severity, title_of(found),
                                         advice(found, live=live))):
        sentences = [sentence_of(found) for found in same]
        for said in [' '.join(map(_ended, sentences))] if together else sentences:
            yield severity, f'{title}: {_ended(said)}{f" -> {do}" if do else ""}'


def _ended(sentence: str) -> str:
    return sentence if sentence.endswith(('.', '?')) else f'{sentence}.'


def explained(code: str) -> list[str]:
    """Return the lines that explain a code: title, meaning, detection, advice and values."""
    words = WORDS[code]
    lines = [f'{code}: {words.title} '
             f'({"act upon it" if CODES[code].severity == "act" else "good to know"})',
             f'What it means: {words.means}', f'How it is found: {words.found}']
    lines += [f'{name}: {do}.' for name, do in (
        ('With a recording', words.general or words.do or 'there is nothing to do'),
        ('At a running node', words.live)) if do]
    if values := values_of(code):
        lines.append(f'Values: {", ".join(values)}')
    return lines


def values_of(code: str) -> list[str]:
    """List the values of a code with their permitted words; "?" marks optional ones."""
    return [f'{name}{"?" if is_optional(kind) else ""}'
            + (f' ({", ".join(get_args(known(kind)))})' if get_origin(known(kind)) is Literal
               else '') for name, kind in CODES[code].values.items()]


def of_axis(found: Finding, axis: str) -> Finding:
    """Return what a finding on several axes says about one of them, without naming the axis."""
    place = found.axes.index(axis)
    return replace(found, axes=(), values={
        name: value[place] if is_of_axes(found, name) else value
        for name, value in found.values.items()})


def together(same: Sequence[Finding], sensor: str) -> Finding:
    """Return what findings of one code say about a sensor, with the figures that all have."""
    each = [of_axis(found, axis).of(axis) for found in same for axis in found.axes
            if axis.startswith(sensor)]
    return _joined(each or same)


def for_display(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Return findings as all front ends show them: merged over axes, those to act upon first."""
    codes = list(CODES)
    ranked = sorted(_grouped(findings), key=lambda found: (
        found.severity != 'act', codes.index(found.code) if found.code in CODES else len(codes)))
    return tuple(replace(found, message=message_of(found)) for found in ranked)


def with_words(result: Result) -> Result:
    """Return a result whose findings and verdicts are in the form that all front ends show."""
    shown = replace(result, warnings=for_display(result.warnings))
    return replace(shown, sensors=sensor_verdicts(shown))


def trend_notes(result: Result) -> list[str]:
    """Return the findings of trends, which are in filter numbers but not in coefficients."""
    return [message_of(found) for found in for_display(result.warnings)
            if found.code in ('warm_up', 'slow_cycle', 'temperature')]


def why_left_out(axis: AxisResult) -> str:
    """Return why an axis has no numbers for a filter; empty if it measures properly."""
    code = 'high_passed' if axis.high_passed_hz is not None else FAULTS.get(axis.fault or '')
    return WORDS[code].title if code else ''


def _grouped(findings: Sequence[Finding]) -> list[Finding]:
    """Merge findings that differ only in axis and numbers, though not in their signs."""
    # A range from a negative to a positive number would hold zero, which no axis is near.
    groups: dict[str, list[Finding]] = {}
    for place, found in enumerate(findings):
        key = repr((found.code, found.severity, *(
            (name, value < 0 if is_of_kind(value, float) else value)
            for name, value in sorted(found.values.items()))))
        # A second one on the same axis stays apart.
        if len(found.axes) != 1 or any(one.axes == found.axes for one in groups.get(key, ())):
            key = str(place)
        groups.setdefault(key, []).append(found)
    return [_joined(same) for same in groups.values()]


def _joined(same: Sequence[Finding]) -> Finding:
    if len(same) == 1:
        return same[0]
    axes = tuple(axis for found in same for axis in found.axes)
    values: dict[str, Any] = {}
    for name in same[0].values:
        each = [found.values[name] for found in same if name in found.values]
        if len(each) == len(same):
            values[name] = each[0] if all(value == each[0] for value in each) else each
    return replace(same[0], axes=axes, values=values)


def _about(found: Finding) -> str:
    """Return the prefix of a message: the recording and axes that it is about."""
    recording = found.values.get('recording')
    where = f'{printable(recording)}: ' if recording and isinstance(recording, str) else ''
    return f'{where}{named([printable(axis) for axis in found.axes])}: ' if found.axes else where


def sensor_verdicts(result: Result) -> dict[str, SensorVerdict]:
    """Return the verdict on each sensor with axes in a result, with the codes behind it."""
    found = {}
    for sensor in ('gyro', 'accel'):
        axes = {name: axis for name, axis in result.axes.items() if name.startswith(sensor)}
        if axes:
            # As it is shown: a minute by stamps in microseconds may last 59.9999 s.
            found[sensor] = _verdict(axes, [one for one in result.warnings if concerns(
                one, sensor)], round(result.rest_of(sensor), 1))
    return found


def concerns(found: Finding, sensor: str) -> bool:
    """Return whether a finding is about a sensor: by its axes, or as one about the recording."""
    if found.axes:
        return any(axis.startswith(sensor) for axis in found.axes)
    return found.values.get('half') in (None, sensor) and not (
        sensor == 'gyro' and found.code == 'gravity')


def _verdict(axes: Mapping[str, AxisResult], about: list[Finding], rest_s: float) -> SensorVerdict:
    act = list(dict.fromkeys(one.code for one in about if one.severity == 'act'))
    faults = [FAULTS[axis.fault] for axis in axes.values() if axis.fault is not None]
    # Findings after which an axis has no numbers, or those of something else.
    no_sensor = {*FAULTS.values(), 'high_passed', 'unknown_rate', 'mostly_motion'}
    broken = list(dict.fromkeys([*(code for code in act if code in no_sensor), *faults]))
    unseen = [axis for axis in axes.values() if not axis.coefficients['noise_density'].observable]
    short = ['short_recording']
    # With less rest even N is known to a tenth at best. Chosen by judgment.
    too_short = rest_s < 10.0
    if broken or unseen or too_short:
        return SensorVerdict('not_usable', tuple(broken or (short if too_short else act or short)))
    if act or rest_s < SHORTEST_GOOD_S:
        return SensorVerdict('with_care', tuple(act or short))
    return SensorVerdict('good', ())


def reasons_of(result: Result, sensor: str, because: tuple[str, ...]) -> tuple[str, ...]:
    """Return the reasons with figures, and by name; the findings themselves are shown below."""
    rest_s = result.rest_of(sensor)
    found = [one for one in for_display(result.warnings) if concerns(one, sensor)]
    if (rest_s < SHORTEST_GOOD_S and because[:1] == ('short_recording',)
            and not any('samples' in one.values for one in found if one.code in because)):
        return f'{duration(rest_s)} at rest',
    said: list[tuple[str, str]] = []
    for code in because:
        same = [one for one in found if one.code == code]
        letters = {axis[-1] for one in same for axis in one.axes if axis.startswith(sensor)} | {
            name[-1] for name, axis in result.axes.items()
            if name.startswith(sensor) and FAULTS.get(axis.fault or '') == code}
        axes = f' ({listed(sorted(letters))})' if letters else ''
        if same:
            said.append((f'{brief(together(same, sensor))}{axes}', f'{title_of(same[0])}{axes}'))
        elif code in WORDS:
            said.append((f'{WORDS[code].title}{axes}',) * 2)
    return tuple(map(', '.join, zip(*said, strict=True))) or ('N does not show',)
