# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The page docs/peers.md, made of the figures alone."""

from collections.abc import Iterator, Mapping
import math
from statistics import median
from typing import Any

OURS = 'ours'
SYMBOLS = {'noise_density': 'N', 'bias_instability': 'B', 'rate_random_walk': 'K',
           'quantization_noise': 'Q', 'rate_ramp': 'R'}
IDEAL = ('a', 'b', 'mems', 'white', 'walk')
_AS_GOOD = 1.1
"""An error up to so many times ours is called equal: some dozens of axes tell no better."""
_HEAD = """# Allan tools compared

Which tool's numbers are right, of sensors whose truth is known? And what does each say of
recordings that anybody can fetch? `make bench-peers` wrote this page, in an environment of its own
with pinned versions (`bench/peers/requirements.txt`); no figure here was entered by hand.
"""


def page(figures: Mapping[str, Any]) -> str:
    """Return the page as Markdown."""
    parts = [_HEAD, *better(figures), *tools(figures)]
    if 'accuracy' in figures:
        parts += [*accuracy(figures), *false_terms(figures), *intervals(figures),
                  *refusals(figures)]
    if 'published' in figures:
        parts += published(figures)
    if 'speed' in figures:
        parts += speed(figures['speed'])
    parts += missing()
    return '\n'.join(parts).rstrip() + '\n'


def table(heads: list[str], rows: list[list[str]]) -> str:
    """Return a Markdown table with an empty line behind it."""
    lines = [heads, ['---'] * len(heads), *rows]
    return '\n'.join('| ' + ' | '.join(line) + ' |' for line in lines) + '\n'


def short(value: float | None) -> str:
    """Return a number with three digits at most, a dash for none."""
    if value is None or not math.isfinite(value):
        return '–'
    return f'{value:.2f}' if value < 10 else f'{value:.0f}' if value < 1e4 else f'{value:.1e}'


def names(figures: Mapping[str, Any]) -> Mapping[str, str]:
    """Return how each tool is called."""
    return {key: tool['name'] for key, tool in figures['tools'].items()}


def better(figures: Mapping[str, Any]) -> Iterator[str]:
    """Say first where another tool is better than ours, or as good."""
    called, told = names(figures), []
    for case in figures.get('accuracy', {}).values():
        ours = case['tools'][OURS]['coefficients']
        for key, symbol in SYMBOLS.items():
            if 'reported' not in ours[key]:
                continue
            mine = ours[key].get('over_bound')
            for tool, name in called.items():
                other = case['tools'][tool]['coefficients'][key]
                if tool == OURS or 'over_bound' not in other:
                    continue
                share = (f'reported of {other["reported"]:.0%} of axes, ours '
                         f'{ours[key]["reported"]:.0%}')
                if mine is None or other['over_bound'] < mine / _AS_GOOD:
                    told.append((0, f'- **{name} is nearer** to {symbol} of *{case["title"]}*: '
                                 f'{short(other["over_bound"])} of the bound, ours {short(mine)} '
                                 f'({share}).'))
                elif other['over_bound'] <= mine * _AS_GOOD:
                    told.append((1, f'- {name} is as near to {symbol} of *{case["title"]}*: '
                                 f'{short(other["over_bound"])} of the bound, ours {short(mine)} '
                                 f'({share}).'))
    for messages, rows in figures.get('speed', {}).items():
        mine = rows['imu_allan analyze']
        for tool, row in rows.items():
            for key, word in (('wall_s', 's'), ('memory_mb', 'MB')):
                if row['status'] == 0 and row[key] < mine[key]:
                    told.append((0, f'- **{tool} takes less** for {int(messages):,} messages: '
                                 f'{row[key]:.1f} {word}, ours {mine[key]:.1f}.'))
    yield '## Where another tool is better, or as good\n'
    yield '\n'.join(line for _, line in sorted(told, key=lambda item: item[0])) + '\n' if told \
        else 'Nowhere in what was measured.\n'
    ratios = [case['tools']['wavelets']['coefficients'][key]['over_bound'] / mine
              for name in IDEAL if name in figures.get('accuracy', {})
              for case in [figures['accuracy'][name]] for key in case['bound']
              for mine in [case['tools'][OURS]['coefficients'][key].get('over_bound')]
              if mine and 'over_bound' in case['tools']['wavelets']['coefficients'][key]]
    if ratios:
        yield ('On ideal sensors with N, B and K the errors of weighted least squares on the '
               f'wavelet variance, ten lines of code, are {min(ratios):.2f} to '
               f'{max(ratios):.2f} times ours, in the median {median(ratios):.2f}. What it '
               'lacks are intervals, and a word where the sensor is not ideal.\n')


def tools(figures: Mapping[str, Any]) -> Iterator[str]:
    """List the tools."""
    yield '## Tools\n'
    rows = [[tool['name'], tool['origin']] for tool in figures['tools'].values()]
    yield table(['tool', 'what it is'], rows)
    yield ('Each is asked through an adapter of our own (`bench/peers/adapters/`), with its '
           'defaults. A recipe that is not a '
           'Python package was written anew from what its authors publish. A tool that gives '
           'one number a sensor is held '
           'against each of its axes.\n')


def accuracy(figures: Mapping[str, Any]) -> Iterator[str]:
    """Show the errors over the bound."""
    called = names(figures)
    some = next(iter(figures['accuracy'].values()))
    yield '## Accuracy\n'
    yield (f'{some["records"]} records of six axes each a case. Error: root mean square over '
           f'the axes of which a tool reports '
           'the coefficient, over the Cramér-Rao bound, which no unbiased estimate that knows '
           'the terms can beat; in '
           'brackets the share reported where it is not all. The generator draws all terms at '
           'once by circulant embedding; '
           'record *r* of the case number *c* has the seed `[20261123, c, r]` '
           '(`bench/peers/simulated.py`). An axis that a '
           'tool refuses counts as not reported. Who reports only what is clear has the easier '
           f'axes. With {6 * some["records"]} axes an error is itself known to about '
           f'{100 / math.sqrt(12 * some["records"]):.0f} %. Behind a low-pass the bound is '
           'that of one who knows the filter.\n')
    for case in figures['accuracy'].values():
        keys = list(case['bound'])
        yield f'**{case["title"][0].upper()}{case["title"][1:]}**\n'
        rows = [['*bound*', *(f'{100 * case["bound"][key]:.2g} %' for key in keys)]]
        for tool, name in called.items():
            found = case['tools'][tool]['coefficients']
            rows.append([name, *(
                short(found[key].get('over_bound')) + ('' if found[key]['reported'] == 1
                                                       else f' ({found[key]["reported"]:.0%})')
                for key in keys)])
        yield table(['tool', *(SYMBOLS[key] for key in keys)], rows)


def false_terms(figures: Mapping[str, Any]) -> Iterator[str]:
    """Show how often a term is reported that is not there."""
    called = names(figures)
    yield '## Terms that are not there\n'
    yield ('Share of axes of which a tool reports a coefficient whose term the sensor does not '
           'have. Reading lines off a '
           'curve always gives all of its numbers.\n')
    rows = []
    for case in figures['accuracy'].values():
        absent = [key for key in SYMBOLS if 'false' in case['tools'][OURS]['coefficients'][key]]
        rows += [[case['title'], SYMBOLS[key], *(
            f'{case["tools"][tool]["coefficients"][key]["false"]:.0%}' for tool in called)]
            for key in absent if any(case['tools'][tool]['coefficients'][key]['false']
                                     for tool in called)]
    yield table(['case', 'term', *called.values()], rows)


def intervals(figures: Mapping[str, Any]) -> Iterator[str]:
    """Show coverage and interval score of the tools that have intervals."""
    called = names(figures)
    yield '## Intervals\n'
    yield ('Share of 95 % intervals that hold the truth, and the mean interval score (width '
           'plus 40 times the miss, over the '
           'truth; less is better) in units of 3.92 bounds, the width of the best interval. '
           'Bounds of what is not observable '
           'count as intervals from zero. Tools without a row give no interval of a '
           'coefficient.\n')
    rows = []
    for case in figures['accuracy'].values():
        for tool, name in called.items():
            found = case['tools'][tool]['coefficients']
            rows += [[case['title'], name, SYMBOLS[key], f'{found[key]["coverage"]:.0%}',
                      short(found[key]['score'] / (3.92 * case['bound'][key]))]
                     for key in case['bound'] if 'coverage' in found[key]]
    yield table(['case', 'tool', 'term', 'holds', 'score'], rows)


def refusals(figures: Mapping[str, Any]) -> Iterator[str]:
    """Show who refuses what, in the words of the tool."""
    called = names(figures)
    rows = [[case['title'], name, f'{case["tools"][tool]["refused"]:.0%}',
             str(case['tools'][tool]['reason']).replace('|', '\\|')]
            for case in figures['accuracy'].values() for tool, name in called.items()
            if case['tools'][tool]['refused']]
    if rows:
        yield '## Refusals\n'
        yield table(['case', 'tool', 'records', 'the first reason'], rows)


def published(figures: Mapping[str, Any]) -> Iterator[str]:
    """Show what the tools say of the telephone and the tag."""
    found, called = figures['published'], names(figures)
    yield '## Two recordings that anybody can fetch\n'
    yield ('The wheel of scikit-diveMove 0.4.0 on PyPI holds six hours of a Galaxy S5 at 10 Hz, '
           'used in a published Allan '
           'demonstration, and 74.5 hours of a whale tag at 1 Hz with its temperature. Its '
           'licence is the GNU Affero General '
           'Public License: the benchmark fetches it when it runs, and nothing of it is passed '
           'on here. Nobody knows the truth '
           'of these sensors. What can be seen is whether two halves agree, and whether a '
           'filter fed with the numbers of one '
           'half believes the other. The temperature is given to no tool.\n')
    yield '**Telephone, x axes**: rad/s and m/s² based SI units, 95 % intervals in brackets.\n'
    rows = []
    for tool, name in called.items():
        answer = found['tools'][tool]['answers']['telephone']
        rows.append([name, *cells(answer, ('gyro_x', 'accel_x'))])
    yield table(['tool', 'gyro N', 'gyro B', 'gyro K', 'accel N', 'accel B', 'accel K'], rows)
    yield ('**Halves of the telephone**: median over the axes of the ratio of both halves, the '
           'larger over the smaller; and mean '
           'normalised innovation squared, least to greatest of six axes both ways, of a filter '
           'that is corrected every ten '
           'seconds (1 is right, above 1 it trusts itself too much; unreported coefficients at '
           'their bound).\n')
    rows = []
    for tool, name in called.items():
        of = found['tools'][tool]['filter']
        ratios = {key: [abs(axis[key]) for axis in of['log_ratio'].values()
                        if axis[key] is not None]
                  for key in ('noise_density', 'bias_instability', 'rate_random_walk')}
        nis = [value for axis in of['nis'].values() for value in axis if value is not None]
        rows.append([name, *(f'{math.exp(median(values)):.2f} ({len(values)} of 6)' if values
                             else '–' for values in ratios.values()),
                     f'{short(min(nis))} to {short(max(nis))}, median {short(median(nis))}'
                     if nis else '–'])
    yield table(['tool', 'N', 'B', 'K', 'innovations'], rows)
    rests = ', '.join(f'{rest["hours"]:.1f} h at {rest["coldest_c"]:.1f} to '
                      f'{rest["warmest_c"]:.1f} °C' for rest in found['rests'])
    yield f'**Whale tag, x axes**, {len(found["rests"])} rests: {rests}.\n'
    rows = [[str(number), name, *cells(found['tools'][tool]['answers'][f'rest {number}'],
                                       ('gyro_x', 'accel_x'))]
            for number in range(1, len(found['rests']) + 1) for tool, name in called.items()]
    yield table(['rest', 'tool', 'gyro N', 'gyro B', 'gyro K', 'accel N', 'accel B', 'accel K'],
                rows)
    yield 'What `imu_allan` says beside its numbers:\n'
    for part, lines in found['findings'].items():
        yield f'*{part}*\n'
        yield '\n'.join(f'- {line}' for line in lines) + '\n' if lines else '- nothing\n'


def cells(answer: Mapping[str, Any], axes: tuple[str, ...]) -> list[str]:
    """Return N, B and K of the axes with intervals, bounds, or the word of refusal."""
    if 'refused' in answer:
        return ['refused'] * 3 * len(axes)
    return [written(answer['axes'].get(axis, {}).get(key, [None, None, None])) for axis in axes
            for key in ('noise_density', 'bias_instability', 'rate_random_walk')]


def written(numbers: list[float | None]) -> str:
    """Return a coefficient as a cell."""
    value, low, high = numbers
    if value is None:
        return '–' if high is None else f'< {high:.2g}'
    return f'{value:.3g}' + ('' if low is None else f' ({low:.3g}, {high:.3g})')


def speed(rows: Mapping[str, Any]) -> Iterator[str]:
    """Show time and memory."""
    yield '## Speed and memory\n'
    yield ('Every tool that reads recordings, on an MCAP with zstd chunks at 1 kHz; the whole '
           'process, medians. Processor time is '
           'that of all threads and processes, and says more on a machine that is shared.\n')
    yield table(['messages', 'tool', 'wall', 'processor', 'memory'], [
        [f'{int(messages):,}', tool,
         *((f'{row["wall_s"]:.1f} s', f'{row["cpu_s"]:.1f} s', f'{row["memory_mb"]:.0f} MB')
           if row['status'] == 0 else
           (f'{row["wall_s"]:.1f} s, then refused', f'{row["cpu_s"]:.1f} s',
            f'{row["memory_mb"]:.0f} MB'))]
        for messages, found in rows.items() for tool, row in found.items()])


def missing() -> Iterator[str]:
    """Say what is not here."""
    yield '## What is not here\n'
    yield ('GMWM itself, which needs R: where this page was made there was none, and its idea '
           'stands in as weighted least '
           'squares on the wavelet variance. MATLAB, whose example is written anew. Tools that '
           'need a ROS 1 installation.\n')
    yield '## Repeating it\n'
    yield ('`make bench-peers` makes everything anew, an hour or two of a processor. One row, '
           'which comes out the same to the '
           'digit wherever the same versions run:\n')
    yield ('```text\nmake .venv-peers/.installed\n.venv-peers/bin/python bench/peers/run.py '
           '--row b wavelets --records 1\n```\n')
    yield ('A tool that is missing or asked wrongly: an adapter has some thirty lines, and a '
           'correction is welcome.\n')
