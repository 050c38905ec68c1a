# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The page docs/peers.md, made of the figures alone."""

from collections.abc import Iterator, Mapping, Sequence
import math
from statistics import fmean, median
from typing import Any

OURS = 'ours'
SYMBOLS = {'noise_density': 'N', 'bias_instability': 'B', 'rate_random_walk': 'K',
           'quantization_noise': 'Q', 'rate_ramp': 'R'}
IDEAL = ('a', 'b', 'mems', 'white', 'walk')
_AS_GOOD = 1.1
"""An error up to so many times ours is called equal: some dozens of axes resolve no better."""
_ENGINEERING = {'noise_density': 60 * 180 / math.pi, 'bias_instability': 3600 * 180 / math.pi,
                'rate_random_walk': 60 * 3600 * 180 / math.pi}
"""From rad/s/sqrt(Hz), rad/s and rad/s^2/sqrt(Hz) to what datasheets have."""
HOW = ('nearer', 'as near')
_MARKS = {'nearer': '**', 'as near': '*', '': ''}
_HEAD = """# Allan tools compared

How other Allan tools do on the same data. `make bench-peers` writes this page, with pinned
versions, in about an hour; `bench/peers/figures.json` has all figures.
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
    parts += repeating()
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
    called = names(figures)
    rows: dict[str, dict[str, dict[str, list[str]]]] = {}
    for title, case in figures.get('accuracy', {}).items():
        for key in case['bound']:
            for tool, name in called.items():
                how = compared(case, key, tool)
                if how:
                    rows.setdefault(name, {}).setdefault(how, {}).setdefault(
                        title, []).append(SYMBOLS[key])
    yield '## Where another tool is better, or as good\n'
    if rows:
        yield ('Terms by case; below in bold and italic. "Nearer" means an error more than '
               f'{_AS_GOOD - 1:.0%} smaller than ours, "as near" at most {_AS_GOOD - 1:.0%} '
               'larger.\n')
        yield table(['tool', *HOW], [
            [name, *('; '.join(f'{", ".join(terms)} of `{title}`' for title, terms in found.get(
                how, {}).items()) or '–' for how in HOW)] for name, found in rows.items()])
    else:
        yield 'Nowhere in what was measured.\n'
    others = {
        'share of axes, if near': reported_more(figures),
        'false terms': fewer_false(figures),
        'halves of the phone record (truth unknown)': repeats(figures),
        'time or memory': smaller(figures.get('speed', {}))}
    if any(others.values()):
        yield table(['better in', 'tools'], [
            [what, '; '.join(found)] for what, found in others.items() if found])
    ratios = [case['tools']['wavelets']['coefficients'][key]['over_bound'] / mine
              for name in IDEAL if name in figures.get('accuracy', {})
              for case in [figures['accuracy'][name]] for key in case['bound']
              for mine in [case['tools'][OURS]['coefficients'][key].get('over_bound')]
              if mine and 'over_bound' in case['tools']['wavelets']['coefficients'][key]]
    if ratios:
        yield ('On ideal sensors with N, B and K, least squares on wavelets '
               f'has errors of {min(ratios):.2f} to {max(ratios):.2f} times ours, median '
               f'{median(ratios):.2f}. It gives neither intervals nor warnings.\n')


def compared(case: Mapping[str, Any], key: str, tool: str) -> str:
    """Return one of `HOW` where the error of a tool is smaller than ours, or like it."""
    mine, error = (case['tools'][each]['coefficients'][key].get('over_bound')
                   for each in (OURS, tool))
    if tool == OURS or error is None:
        return ''
    if mine is None or error < mine / _AS_GOOD:
        return HOW[0]
    return HOW[1] if error <= mine * _AS_GOOD else ''


def reported_more(figures: Mapping[str, Any]) -> list[str]:
    """Return the tools that give a term on more axes than ours does, and no worse."""
    found: dict[str, dict[str, None]] = {}
    for case in figures.get('accuracy', {}).values():
        for key in case['bound']:
            for tool, name in names(figures).items():
                mine, theirs = (case['tools'][each]['coefficients'][key]['reported']
                                for each in (OURS, tool))
                if theirs > mine and compared(case, key, tool):
                    found.setdefault(name, {})[SYMBOLS[key]] = None
    return [f'{name} {", ".join(terms)}' for name, terms in found.items()]


def false_shares(figures: Mapping[str, Any], key: str) -> dict[str, float]:
    """Return by tool the share of axes with a term that is not there, over the cases without."""
    cases = [case for case in figures.get('accuracy', {}).values()
             if 'false' in case['tools'][OURS]['coefficients'][key]]
    return {tool: fmean(case['tools'][tool]['coefficients'][key]['false'] for case in cases)
            for tool in names(figures) if cases}


def fewer_false(figures: Mapping[str, Any]) -> list[str]:
    """Return the tools that invent a term less often than ours, of those that look for it."""
    found = []
    for tool, name in names(figures).items():
        better_at = [
            symbol for key, symbol in SYMBOLS.items()
            for shares in [false_shares(figures, key)]
            if shares and shares[tool] < shares[OURS]
            and any(case['tools'][tool]['coefficients'][key].get(share)
                    for case in figures['accuracy'].values() for share in ('reported', 'false'))]
        if better_at:
            found.append(f'{name} {", ".join(better_at)}')
    return found


def between_halves(figures: Mapping[str, Any], tool: str) -> dict[str, list[float]]:
    """Return by coefficient the ratios, as logarithms, of the halves of the telephone."""
    axes = figures['published']['tools'][tool]['filter']['log_ratio'].values()
    return {key: [abs(axis[key]) for axis in axes if axis[key] is not None]
            for key in _ENGINEERING}


def repeats(figures: Mapping[str, Any]) -> list[str]:
    """Return the tools whose numbers of both halves are nearer to each other than ours."""
    if 'published' not in figures:
        return []
    mine = between_halves(figures, OURS)
    found = []
    for tool, name in names(figures).items():
        better_at = [SYMBOLS[key] for key, ratios in between_halves(figures, tool).items()
                     if ratios and (not mine[key] or median(ratios) < median(mine[key]))]
        if better_at:
            found.append(f'{name} {", ".join(better_at)}')
    return found


def smaller(rows: Mapping[str, Any]) -> list[str]:
    """Return the tools that read a recording in less time, or in less memory, than ours."""
    return list(dict.fromkeys(
        tool for found in rows.values() for tool, row in found.items()
        if row['status'] == 0 and any(row[key] < found['imu_allan analyze'][key]
                                      for key in ('wall_s', 'memory_mb'))))


def tools(figures: Mapping[str, Any]) -> Iterator[str]:
    """List the tools."""
    yield '## Tools\n'
    yield '\n'.join(f'- {tool["name"]}: {tool["origin"]}'
                    for tool in figures['tools'].values()) + '\n'
    yield ('The adapters (`bench/peers/adapters/`) are ours and leave each tool at its '
           'defaults. A number for a whole sensor is compared with each axis.\n')
    yield ('GMWM was not run, as CRAN was not reachable; in R: '
           '`install.packages("simts"); library(simts); gmwm_imu(WN() + RW(), samples)`. '
           'N is `sqrt(SIGMA2 / rate)`, K `sqrt(GAMMA2 * rate)`.\n')


def accuracy(figures: Mapping[str, Any]) -> Iterator[str]:
    """Show the errors over the bound."""
    called = names(figures)
    some = next(iter(figures['accuracy'].values()))
    yield '## Accuracy\n'
    yield (f'{some["records"]} records of six axes for each case (`bench/peers/simulated.py`). '
           'Cells give the root mean square error over the Cramér-Rao bound, term by term, on '
           'axes where a tool reports the coefficient. Their share is in brackets unless it is '
           'all; a dash means none. Errors are known to about '
           f'{100 / math.sqrt(12 * some["records"]):.0f} %. Behind a low-pass, the bound is that '
           'for a known filter.\n')
    rows = [[f'`{name}`: {case["title"]}',
             ', '.join(f'{SYMBOLS[key]} {100 * bound:.2g}'
                       for key, bound in case['bound'].items()),
             *(errors_of(case, tool) for tool in called)]
            for name, case in figures['accuracy'].items()]
    yield table(['case', '*bound, %*', *called.values()], rows)


def errors_of(case: Mapping[str, Any], tool: str) -> str:
    """Return the errors of a tool, one dash where it reports no term."""
    errors = [error_of(case, key, tool) for key in case['bound']]
    return ', '.join(errors) if set(errors) != {'–'} else '–'


def error_of(case: Mapping[str, Any], key: str, tool: str) -> str:
    """Return the error of a tool over the bound, and the share of axes that have it."""
    found = case['tools'][tool]['coefficients'][key]
    mark = _MARKS[compared(case, key, tool)]
    share = '' if found['reported'] in (0, 1) else f' ({found["reported"]:.0%})'
    return f'{mark}{short(found.get("over_bound"))}{mark}{share}'


def false_terms(figures: Mapping[str, Any]) -> Iterator[str]:
    """Show how often a term is reported that is not there."""
    called = names(figures)
    yield '## Terms that are not there\n'
    yield 'Share of axes on which a tool reports a term that the sensor lacks.\n'
    rows = []
    for key, symbol in SYMBOLS.items():
        shares = false_shares(figures, key)
        if shares:
            cases = sum('false' in case['tools'][OURS]['coefficients'][key]
                        for case in figures['accuracy'].values())
            rows.append([symbol, str(cases), *(f'{share:.0%}' for share in shares.values())])
    yield table(['term', 'cases', *called.values()], rows)


def intervals(figures: Mapping[str, Any]) -> Iterator[str]:
    """Show coverage and interval score of the tools that have intervals."""
    yield '## Intervals\n'
    yield ('Share of 95 % intervals that contain the truth, and interval score, median and worst '
           'case. The score is width plus 40 times the miss, over the width of the best '
           'interval. An upper bound counts as an interval from zero.\n')
    rows = []
    for tool, name in names(figures).items():
        for key, symbol in SYMBOLS.items():
            found = [(entry['score'] / (3.92 * case['bound'][key]), title, entry['coverage'])
                     for title, case in figures['accuracy'].items() if key in case['bound']
                     for entry in [case['tools'][tool]['coefficients'][key]]
                     if 'coverage' in entry]
            if found:
                worst = max(found)
                rows.append([name, symbol, str(len(found)),
                             f'{fmean(each[2] for each in found):.0%}',
                             short(median(each[0] for each in found)),
                             f'{short(worst[0])} (`{worst[1]}`)'])
    yield table(['tool', 'term', 'cases', 'contains', 'score', 'worst'], rows)


def refusals(figures: Mapping[str, Any]) -> Iterator[str]:
    """Show who refuses what, in the words of the tool."""
    for tool, name in names(figures).items():
        refused = [case['tools'][tool] for case in figures['accuracy'].values()
                   if case['tools'][tool]['refused']]
        if refused:
            reason = str(refused[0]['reason']).split('. ')[0].split(' (')[0].replace('|', '\\|')
            yield (f'{name} refuses records of {len(refused)} of {len(figures["accuracy"])} '
                   f'cases. Its first reason: `{reason}`.\n')


def published(figures: Mapping[str, Any]) -> Iterator[str]:
    """Show what the tools say of the telephone and the tag."""
    found, called = figures['published'], names(figures)
    yield '## Two public recordings\n'
    yield ('Six hours of a Galaxy S5 at 10 Hz, and 74.5 hours of a whale tag at 1 Hz. The truth '
           'is unknown. Both are in the wheel of scikit-diveMove 0.4.0 (AGPL) on PyPI.\n')
    yield ('**Halves of the phone record**: ratio between the results of both halves, median over '
           'axes. NIS is that of a filter corrected every ten seconds, six axes both ways.\n')
    rows = []
    for tool, name in called.items():
        of = found['tools'][tool]['filter']
        ratios = between_halves(figures, tool)
        nis = [value for axis in of['nis'].values() for value in axis if value is not None]
        rows.append([name, *(f'{math.exp(median(values)):.2f}'
                             + (f' ({len(values)} of 6)' if len(values) < 6 else '') if values
                             else '–' for values in ratios.values()),
                     f'{short(min(nis))} to {short(max(nis))}, median {short(median(nis))}'
                     if nis else '–'])
    yield table(['tool', 'N', 'B', 'K', 'NIS'], rows)
    yield ('**Results for the gyroscopes**, quietest to noisiest axis: N in '
           'deg/√h, B in deg/h, K in deg/h/√h. The phone has a low-pass near 0.2 Hz; the tag has '
           f'coarse steps, and {_warmth(found["rests"])}. Only imu_allan uses its '
           'thermometer.\n')
    yield table(['tool', *(f'{where}: {symbol}' for where in ('phone', 'tag')
                           for symbol in ('N', 'B', 'K'))],
                [[name, *_said(found['tools'][tool]['answers'])] for tool, name in called.items()])
    for of in ('telephone', 'tag'):
        codes = dict.fromkeys(one.partition(':')[0] for part, said in found['findings'].items()
                              for one in said if (part == 'telephone') == (of == 'telephone'))
        where = 'phone' if of == 'telephone' else of
        yield f'Findings of imu_allan on the {where}: {", ".join(codes) or "none"}.\n'


def _warmth(rests: Sequence[Mapping[str, float]]) -> str:
    """Say between which temperatures the tag was."""
    return (f'its {len(rests)} rests span {min(rest["coldest_c"] for rest in rests):.0f} to '
            f'{max(rest["warmest_c"] for rest in rests):.0f} °C')


def _said(answers: Mapping[str, Any]) -> Iterator[str]:
    """Return N, B and K of the gyroscopes of the telephone and of the tag's first rest."""
    for part in ('telephone', 'rest 1'):
        axes = [axis for name, axis in answers[part].get('axes', {}).items()
                if name.startswith('gyro')]
        for key, scale in _ENGINEERING.items():
            values = [scale * axis[key][0] for axis in axes if axis[key][0] is not None]
            bounds = [scale * axis[key][2] for axis in axes if axis[key][2] is not None]
            if values:
                ends = dict.fromkeys((short(min(values)), short(max(values))))
                yield (' to '.join(ends)
                       + (f' ({len(values)} of 3)' if len(values) < 3 else ''))
            else:
                yield f'< {short(max(bounds))}' if bounds else '–'


def speed(rows: Mapping[str, Any]) -> Iterator[str]:
    """Show time and memory."""
    yield '## Speed and memory\n'
    yield ('Whole process on an MCAP with zstd chunks at 1 kHz, by number of messages: medians of '
           'wall / processor time and memory.\n')
    tools = dict.fromkeys(tool for found in rows.values() for tool in found)
    yield table(['tool', *(f'{int(messages):,}' for messages in rows)], [
        [tool, *(f'{row["wall_s"]:.1f} / {row["cpu_s"]:.1f} s, {row["memory_mb"]:.0f} MB'
                 + ('' if row['status'] == 0 else ', refused')
                 for found in rows.values() for row in [found[tool]])] for tool in tools])


def repeating() -> Iterator[str]:
    """Say how a row is made again."""
    yield '## Repeating it\n'
    yield ('One row. With these versions all digits are the same, on another kind of processor '
           'twelve:\n')
    yield ('```text\nmake .venv-peers/.installed\n.venv-peers/bin/python bench/peers/run.py '
           '--row b wavelets\n```\n')
