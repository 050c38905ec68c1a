# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The words of every finding, which stand in words.ini, filled with its figures.

No other module makes a sentence of a finding.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
import re
from typing import Any

from imu_allan.characterization.verdict import verdicts
from imu_allan.errors import printable
from imu_allan.finding import ACT, Finding
from imu_allan.noise.terms import TERMS
from imu_allan.result import Result
from imu_allan.sensor.units import engineering
from imu_allan.wording import about, counted, duration, listed, named, number, SENSORS


@dataclass(frozen=True)
class Words:
    """
    What is said of one code.

    Attributes
    ----------
    title : str
        In two or three words.
    means, found : str
        What it means for the numbers, and how it is found; for docs/findings.md.
    says : str
        One sentence with the figures, as words.ini explains.
    do, live : str
        One sentence of what to do with a recording, and at a running node; empty where nothing
        is to be done. `live` None: the same.

    """

    title: str
    means: str
    found: str
    says: str
    do: str = ''
    live: str | None = None


def _read() -> dict[str, Words]:
    # configparser reads the same, in ten times the time.
    text = (files(__package__) / 'words.ini').read_text(encoding='utf-8')
    sections = re.findall(r'^\[(\w+)\]\n((?:\w+ = .*\n(?: .*\n)*)+)', text, re.MULTILINE)
    return {code: Words(**{key: ' '.join(value.split()) for key, value in re.findall(
        r'^(\w+) = (.*(?:\n .*)*)', section, re.MULTILINE)}) for code, section in sections}


WORDS: Mapping[str, Words] = _read()
"""Words by code, in the order in which findings of one severity are shown."""

_RANK = {code: rank for rank, code in enumerate(WORDS)}


class _UnknownError(Exception):
    """A figure is not known, or a condition does not hold."""


_Alternatives = list[list[Any]]


@cache
def _parsed(text: str) -> _Alternatives:
    """Return alternatives of text, fields in a tuple of one, and groups with what repeats them."""
    stack: list[tuple[str, _Alternatives]] = [('', [[]])]
    for piece in re.split(r'(\[\[(?:\*[^*]*\*)?|\]\]|\||\{[^}]*\})', text):
        if piece.startswith('[['):
            stack.append((piece[2:], [[]]))
        elif piece == ']]':
            group = stack.pop()
            stack[-1][1][-1].append(group)
        elif piece == '|':
            stack[-1][1].append([])
        else:
            stack[-1][1][-1].append((piece[1:-1],) if piece.startswith('{') else piece)
    return stack[0][1]


def _filled(alternatives: _Alternatives, values: Mapping[str, Any]) -> str | None:
    """Return the first alternative whose figures are known and whose conditions hold."""
    for parts in alternatives:
        try:
            return ''.join(_part(part, values) for part in parts)
        except _UnknownError:
            continue
    return None


def _part(part: Any, values: Mapping[str, Any]) -> str:
    if isinstance(part, str):
        return part
    if len(part) == 1:
        return _field(part[0], values)
    repeated, alternatives = part
    if not repeated:
        return _filled(alternatives, values) or ''
    # What is said of each item of the lists that its fields name.
    named_in = re.findall(r'[a-z]\w+', repr(alternatives))
    lists = [values[key] for key in named_in if isinstance(values.get(key), (list, tuple))]
    if not lists:
        raise _UnknownError
    count = len(lists[0])
    items = ({key: value[i] if isinstance(value, (list, tuple)) and len(value) == count else value
              for key, value in values.items()} for i in range(count))
    said = [_filled(alternatives, item) for item in items]
    if None in said:
        raise _UnknownError
    return str(repeated[1:-1]).join(map(str, said))


def _field(field: str, values: Mapping[str, Any]) -> str:
    """Return a figure as it is said, nothing for a condition that holds."""
    condition = re.fullmatch(r'([?!]?)(\w+)(?:([=<>])([^:]+))?', field)
    if condition is not None and (condition[1] or condition[3]):
        if not _holds(values.get(condition[2]), condition[1] or condition[3], condition[4]):
            raise _UnknownError
        return ''
    key, _, spec = field.partition(':')
    value = values.get(key.removesuffix('!r'))
    if value is None:
        raise _UnknownError
    first, _, rest = spec.partition(' ')
    if first in ('min', 'max', 'first'):
        if isinstance(value, (list, tuple)):
            value = value[0] if first == 'first' else (min if first == 'min' else max)(value)
        spec = rest
    if first == 'count':
        one, _, many = rest.partition('/')
        return counted(value, one, many or None)
    if first == 'beyond':
        if value <= len(values[rest]):
            raise _UnknownError
        return f'{value - len(values[rest]):,}'
    if first == 'all':
        each = value if isinstance(value, (list, tuple)) else [value]
        return listed(list(dict.fromkeys(f'{one:g}' for one in each)))
    if key.endswith('!r'):
        return repr(value)
    unit = (' %' if spec.endswith('%') else
            f' {engineering(1.0, values["unit"])[1]}' if spec.endswith('unit') else '')
    if not isinstance(value, (list, tuple)):
        return _said(value, spec, values) + unit
    low, high = (_said(end, spec, values) for end in (min(value), max(value)))
    return low + unit if low == high else f'{low} to {high}{unit}'


def _holds(value: Any, sign: str, bound: str) -> bool:
    if sign in '?!':
        return bool(value) == (sign == '?')
    if isinstance(value, (list, tuple)):
        value = len(value) if isinstance(value[0], str) else max(value)
    return value is not None and (str(value) == bound if sign == '=' else
                                  value > float(bound) if sign == '>' else value < float(bound))


_HOW: dict[str, Callable[[Any], str]] = {
    'time': duration,
    'about': about,
    'abs time': lambda seconds: duration(abs(seconds)),
    'times': lambda count: 'once' if count == 1 else f'{count} times',
    # From a factor of two on an error is no percentage.
    'within': lambda factor: (f'within {max(100 * (factor - 1), 1):.0f} %' if factor < 2
                              else f'within a factor of {factor:.0f}'),
    'symbol': lambda key: TERMS[key].symbol,
    'sensor': lambda sensor: SENSORS[sensor].lower()}


def _said(value: Any, spec: str, values: Mapping[str, Any]) -> str:
    """Return a figure without its unit."""
    if spec in _HOW:
        return _HOW[spec](value)
    if spec.endswith('unit'):
        return number(engineering(value, values['unit'])[0], int(spec.partition(' ')[0])
                      if ' ' in spec else 3)
    if spec.endswith('%'):
        return format(100 * value, f'{spec[:-1] or ".0"}f')
    return format(value, spec)


def title_of(found: Finding) -> str:
    """Return the name of a finding, in two or three words."""
    words = WORDS.get(found.code)
    return words.title if words is not None else printable(found.code).replace('_', ' ')


def says(found: Finding) -> str:
    """Return the sentence with the figures of a finding, with what it is about before it."""
    if 'more' in found.values:
        return f'{_about(found)}{found.values["more"]} more like these'
    made = _made(WORDS[found.code].says, found) if found.code in WORDS else ''
    if made:
        return f'{_about(found)}{made}'
    return printable(found.message) or f'{_about(found)}{title_of(found)}'


def advice(found: Finding, *, live: bool = False) -> str:
    """Return what to do about a finding, with a recording or at a running node; or nothing."""
    words = WORDS.get(found.code)
    if words is None or 'more' in found.values or not _made(words.says, found):
        return ''
    return _made(words.live if live and words.live is not None else words.do, found)


def _made(text: str, found: Finding) -> str:
    """Return a sentence of the table; empty where a file of another version lacks its figures."""
    try:
        return printable((_filled(_parsed(text), found.values) or '').strip())
    except (KeyError, TypeError, ValueError, AttributeError, IndexError):
        return ''


def message_of(found: Finding, *, live: bool = False) -> str:
    """Return what was found and what to do about it, on one line."""
    return '; '.join(filter(None, (says(found), advice(found, live=live))))


def explained(code: str) -> list[str]:
    """Return what a code means in lines: title, severity, meaning, how it is found, advice."""
    words = WORDS[code]
    lines = [f'{code}: {words.title} '
             f'({"act upon it" if code in ACT else "good to know"})',
             f'What it means: {words.means}', f'How it is found: {words.found}']
    for name, do in (('With a recording', words.do), ('At a running node', words.live)):
        if do:
            lines.append(f'{name}: {do}.' if is_plain(do) else
                         f'{name}: the message says what fits the figures.')
    return lines


def is_plain(text: str) -> bool:
    """Say whether a sentence of the table is the same whatever the figures are."""
    return not re.search(r'[{|]', text)


def of_axis(found: Finding, axis: str) -> Finding:
    """Return what a finding about several axes says about one of them, which is not named."""
    place, many = found.axes.index(axis), len(found.axes)
    return replace(found, axes=(), values={
        name: value[place] if many > 1 and isinstance(value, (list, tuple)) and len(value) == many
        else value for name, value in found.values.items()})


def presented(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """
    Return findings as every front end shows them.

    Parameters
    ----------
    findings : sequence of Finding
        As they were found, each axis by itself.

    Returns
    -------
    tuple of Finding
        Those of one kind about several axes are one, with a list of each value that differs.
        Those to act upon come first. Each has its message.

    """
    ranked = sorted(_grouped(findings), key=lambda found: (
        found.severity != 'act', _RANK.get(found.code, len(_RANK))))
    return tuple(replace(found, message=message_of(found)) for found in ranked)


def with_words(result: Result) -> Result:
    """Return a result with findings and verdicts as every front end shows them."""
    shown = replace(result, warnings=presented(result.warnings))
    return replace(shown, sensors=verdicts(shown))


def _grouped(findings: Sequence[Finding]) -> list[Finding]:
    """Join what differs in the axis and in numbers alone."""
    groups: dict[object, list[Finding]] = {}
    for found in findings:
        key: object = len(groups)
        if len(found.axes) == 1 and found.values is not None:
            key = (found.code, found.severity, *(
                (name, value if not _is_number(value) else None, _is_number(value))
                for name, value in sorted(found.values.items())))
        same = groups.setdefault(repr(key), [])
        if any(one.axes == found.axes for one in same):
            groups[len(groups), 'again'] = [found]
        else:
            same.append(found)
    return [_joined(same) for same in groups.values()]


def _joined(same: Sequence[Finding]) -> Finding:
    if len(same) == 1:
        return same[0]
    axes = tuple(axis for found in same for axis in found.axes)
    values: dict[str, Any] = {}
    for name in same[0].values:
        each = [found.values[name] for found in same]
        values[name] = each[0] if all(value == each[0] for value in each) else each
    return replace(same[0], axes=axes, values=values)


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _about(found: Finding) -> str:
    """Return the recording and the axes that a finding is about, as they come before it."""
    recording = found.values.get('recording')
    where = f'{printable(str(recording))}: ' if recording else ''
    return f'{where}{named([printable(axis) for axis in found.axes])}: ' if found.axes else where
