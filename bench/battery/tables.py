# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Outcomes as tables: one of what a checkout says, one of where two of them differ."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import Any

from battery.sensors import B, K, N, Q
import numpy as np

Outcome = dict[str, Any]

SYMBOL = {Q: 'Q', N: 'N', B: 'B', K: 'K'}
_OUTSTANDING = 2.0
"""Standard errors from which a difference is reported."""
_RATIOS = ('width', 'score', 'ms')
"""What is compared by its logarithm: one large score shall not hide all others."""
_LITTLE = 0.1
"""Of the logarithm of a time: processes that run beside it change it as much."""


def table(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """Yield the lines of the table of one checkout: every case, then all of its family."""
    for part in ('records', 'spectra'):
        of_part = [one for one in outcomes if one['part'] == part]
        if not of_part:
            continue
        yield (f'{part:48} {"of":>4}  {"term":4} {"reported":>8}  {"coverage":>15}  {"width":>6} '
               f'{"free":>5} {"score":>7} {"ms":>5}  false; codes')
        for family, of_family in _by(of_part, 'family'):
            cases = list(_by(of_family, 'case'))
            for case, found in cases:
                yield from _rows(f'{family}: {case}', found)
            if len(cases) > 1:
                yield from _rows(f'{family}, all', of_family)
        yield ''
    yield from _of_recordings([one for one in outcomes if one['part'] == 'recordings'])


def _by(outcomes: Iterable[Outcome], field: str) -> Iterator[tuple[str, list[Outcome]]]:
    groups: dict[str, list[Outcome]] = {}
    for one in outcomes:
        groups.setdefault(one[field], []).append(one)
    yield from groups.items()


def _rows(name: str, found: Sequence[Outcome]) -> Iterator[str]:
    """Give a line for every term that some of the records have."""
    head = f'{name:48} {len(found):4}'
    milliseconds = f'{1e3 * np.median([one["cpu_s"] for one in found]):5.0f}'
    false = {SYMBOL[key]: sum(one['terms'][key]['reported'] for one in found
                              if key in one['terms'] and not one['terms'][key]['truth'])
             for key in SYMBOL}
    codes = Counter(code for one in found for code in one['codes'])
    rest = ', '.join(f'{what} {count}' for what, count in false.items() if count)
    rest += '; ' + ', '.join(f'{code} {count}' for code, count in codes.most_common())
    for key in SYMBOL:
        true = [one['terms'][key] for one in found
                if key in one['terms'] and one['terms'][key]['truth']]
        if not true:
            continue
        inside = [one['inside'] for one in true if one['inside'] is not None]
        widths = [one['width'] for one in true if one['width'] is not None]
        free = [one['free'] for one in true if one.get('free') is not None]
        scores = [one['score'] for one in true if one['score'] is not None]
        yield (f'{head}  {SYMBOL[key]:4} {np.mean([one["reported"] for one in true]):8.2f}  '
               f'{share(inside):>15}  {_middle(widths):>6} {_middle(free):>5} '
               f'{_mean(scores):>7} {milliseconds}  {rest}').rstrip('; ')
        head, milliseconds, rest = ' ' * len(head), ' ' * 5, ''


def share(found: Sequence[bool]) -> str:
    """Write a share with its standard error, one more of each kind counted for the latter."""
    if not found:
        return '-'
    seen = (sum(found) + 1) / (len(found) + 2)
    return f'{np.mean(found):.3f} +- {np.sqrt(seen * (1 - seen) / len(found)):.3f}'


def _middle(found: Sequence[float]) -> str:
    return f'{np.median(found):.2f}' if found else '-'


def _mean(found: Sequence[float]) -> str:
    return f'{np.mean(found):.2f}' if found else '-'


def _of_recordings(found: Sequence[Outcome]) -> Iterator[str]:
    if not found:
        return
    yield 'recordings: chi-square of the quarters over degrees of freedom'
    for sensor, axes in _by(found, 'family'):
        for key in (N, B, K):
            chi_square = sum(one['terms'][key]['chi_square'] for one in axes)
            freedom = sum(one['terms'][key]['freedom'] for one in axes)
            yield (f'    {sensor:6} {SYMBOL[key]}  '
                   + (f'{chi_square / freedom:.2f} of {freedom}' if freedom else '-'))
    against = [term['contradicts'] for one in found for term in one['terms'].values()
               if term['contradicts'] is not None]
    if against:
        yield f'    the whole contradicts both halves in {sum(against)} of {len(against)}'
    for one in sorted(found, key=lambda one: one['case']):
        said = '  '.join(f'{SYMBOL[key]} {_said(term)}' for key, term in one['terms'].items())
        codes = ', '.join(one['codes'])
        yield f'    {one["case"]:24} {said}  {1e3 * one["cpu_s"]:.0f} ms  {codes}'


def _said(term: dict[str, Any]) -> str:
    if term['value'] is not None:
        return f'{term["value"]:.3g} ({term["interval"][0]:.3g} .. {term["interval"][1]:.3g})'
    return f'< {term["bound"]:.3g}' if term['bound'] is not None else 'unknown'


def differences(before: Sequence[Outcome], after: Sequence[Outcome]) -> Iterator[str]:
    """
    Yield where two checkouts differ, on the records that both have, by two standard errors.

    Records are compared in pairs, widths, scores and times by their ratio; the standard error is
    that of a mean of zero.
    """
    earlier = {_identity(one): one for one in before if one['part'] != 'recordings'}
    pairs = [(earlier[_identity(one)], one) for one in after if _identity(one) in earlier]
    yield f'{len(pairs)} records compared: where they differ by more than two standard errors'
    yield f'{"":58} {"term":4} {"what":13} {"base":>8} {"now":>8}  standard errors'
    groups: dict[str, list[tuple[Outcome, Outcome]]] = {}
    for old, new in pairs:
        for name in (f'{new["part"]} {new["family"]}: {new["case"]}',
                     f'{new["part"]} {new["family"]}, all'):
            groups.setdefault(name, []).append((old, new))
    for name, group in groups.items():
        for symbol, what, old_values, new_values in _measures(group):
            change = new_values - old_values
            size = np.sqrt((change**2).sum())
            errors = change.sum() / size if size else 0.0
            little = what == 'ms' and abs(change.mean()) < _LITTLE
            if abs(errors) > _OUTSTANDING and not little:
                back: Callable[[Any], Any] = np.exp if what in _RATIOS else np.asarray
                yield (f'{name:58} {symbol:4} {what:13} {back(old_values.mean()):8.3f} '
                       f'{back(new_values.mean()):8.3f}  {errors:+.1f}')


def _identity(one: Outcome) -> tuple[str, str, str, int]:
    return one['part'], one['family'], one['case'], one['seed']


def _measures(pairs: Sequence[tuple[Outcome, Outcome]]) -> Iterator[tuple[str, str, Any, Any]]:
    """Give, of every term, what can be compared: symbol, name, values before and after."""
    for key, symbol in SYMBOL.items():
        terms = [(old['terms'][key], new['terms'][key]) for old, new in pairs
                 if key in new['terms'] and key in old['terms']]
        true = [pair for pair in terms if pair[1]['truth']]
        absent = [pair for pair in terms if not pair[1]['truth']]
        inside = [pair for pair in true if None not in (pair[0]['inside'], pair[1]['inside'])]
        for what, some, field in (('reported', true, 'reported'), ('coverage', inside, 'inside'),
                                  ('false', absent, 'reported')):
            yield symbol, what, *_columns(some, partial(_flag, field))
        scored = [pair for pair in true if None not in (pair[0]['score'], pair[1]['score'])]
        yield symbol, 'score', *_columns(scored, lambda term: np.log(term['score']))
        wide = [pair for pair in true if pair[0]['width'] and pair[1]['width']]
        yield symbol, 'width', *_columns(wide, lambda term: np.log(term['width']))
    yield '', 'ms', *_columns(pairs, lambda one: np.log(1e3 * max(one['cpu_s'], 1e-6)))
    for code in sorted({code for pair in pairs for one in pair for code in one['codes']}):
        yield '', code, *_columns(pairs, partial(_has, code))


def _flag(field: str, term: dict[str, Any]) -> float:
    return float(term[field])


def _has(code: str, one: Outcome) -> float:
    return float(code in one['codes'])


def _columns(pairs: Sequence[Any], value: Callable[[Any], float]) -> tuple[Any, Any]:
    return (np.array([value(old) for old, _ in pairs]), np.array([value(new) for _, new in pairs]))
