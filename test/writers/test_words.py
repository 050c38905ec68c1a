# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Findings are data; their words stand in one table, which nothing else makes or reads."""

import ast
from collections.abc import Iterator
from pathlib import Path
import re
import subprocess
import sys

import imu_allan
from imu_allan.finding import ACT, Finding, finding
from imu_allan.writers.words import advice, message_of, of_axis, presented, says, WORDS
import pytest

PACKAGE = Path(imu_allan.__file__).parent
MODULES = sorted(path for path in PACKAGE.rglob('*.py') if path.name != 'words.py')
LONGEST = 25
"""Words of a sentence."""
# A figure or a path stands for a word.
SENTENCES = re.compile(r'(?<=[.;:!?])\s')


def calls_of(tree: ast.AST) -> Iterator[ast.Call]:
    """Give the calls that make a finding with a code that is written there."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
            name = getattr(node.func, 'id', getattr(node.func, 'attr', ''))
            if name in ('finding', 'remark'):
                yield node


def test_every_code_that_is_found_has_words() -> None:
    codes = {call.args[0].value for path in MODULES  # type: ignore[attr-defined]
             for call in calls_of(ast.parse(path.read_text()))}
    assert len(codes) > 40
    assert {code for code in codes if isinstance(code, str)} <= set(WORDS)
    assert set(WORDS) >= ACT


@pytest.mark.parametrize('path', MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_no_module_makes_or_reads_a_sentence_of_a_finding(path: Path) -> None:
    tree = ast.parse(path.read_text())
    for call in calls_of(tree):
        for keyword in call.keywords:
            assert keyword.arg != 'message', ast.unparse(call)
            # A figure that is text is a name or a reason, never a sentence put together here.
            assert not (isinstance(keyword.value, ast.JoinedStr)), ast.unparse(call)
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and node.attr == 'message':
            owner = ast.unparse(node.value)
            # Answers of services, errors of argparse, and how a standard is met: no findings.
            assert owner in ('response', 'error') or (
                owner == 'finding' and path.parent.name == 'node'), ast.unparse(node)


def texts_of(code: str) -> Iterator[str]:
    """Give every text about a code, each alternative with the longest of what is said within."""
    words = WORDS[code]
    for text in (words.title, words.means, words.found, words.says, words.do, words.live or ''):
        made = re.sub(r'\{[^}]*[?!=<>][^}]*\}', '', text)
        made = re.sub(r'\{[^}]*\}', '0', made)
        while group := re.search(r'\[\[(?:\*[^*]*\*)?((?:(?!\[\[).)*?)\]\]', made):
            longest = max(group[1].split('|'), key=len)
            made = made[:group.start()] + longest + made[group.end():]
        yield from made.split('|')


PRIVATE = re.compile(r'\b(told|doubt|borne out|sticks? out|stands? (in for|out)|bridged?|stretch|'
                     r'coast|course of|claim|wild|bent|wander|(?<!random )walk)\b', re.IGNORECASE)


@pytest.mark.parametrize('code', WORDS)
def test_sentences_of_the_table_are_short_and_plain(code: str) -> None:
    for text in texts_of(code):
        assert not set('{}[]|') & set(text.replace('covariance[0]', '')), text
        for sentence in SENTENCES.split(text):
            assert len(sentence.split()) <= LONGEST, sentence
        assert not PRIVATE.search(text), text


def test_axes_of_one_kind_are_one_finding_with_a_figure_each() -> None:
    found = [finding('band_limited', (f'gyro_{letter}',), window_s=window)
             for letter, window in zip('xyz', (0.0148, 0.02, 0.0152), strict=True)]
    [one] = presented(found)
    assert one == finding('band_limited', ('gyro_x', 'gyro_y', 'gyro_z'),
                          window_s=[0.0148, 0.02, 0.0152])
    assert one.message.endswith('its effective window is 0.0148 to 0.02 s')
    assert says(of_axis(one, 'gyro_y')).endswith('its effective window is 0.02 s')
    assert presented([one]) == (one,)


def test_other_units_and_other_facts_are_findings_of_their_own() -> None:
    found = [finding('bias_step', (name,), size=0.1, unit=unit, after_s=60.0)
             for name, unit in (('gyro_x', 'rad/s'), ('accel_x', 'm/s^2'), ('gyro_y', 'rad/s'))]
    assert [one.axes for one in presented(found)] == [('gyro_x', 'gyro_y'), ('accel_x',)]
    assert len(presented([found[0], found[0]])) == 2


@pytest.mark.parametrize(('times', 'said'), [
    ((1924.0, 4918.0, 2640.0), '32 min 4 s to 81 min 58 s'),
    ((9.5, 12.0, 12.0), '9.5 s to 12 s'), ((184.0, 184.0, 184.0), '3 min 4 s')])
def test_lengths_of_time_are_said_from_the_shortest_to_the_longest(
        times: tuple[float, ...], said: str) -> None:
    [one] = presented([finding('stood_still', (f'gyro_{letter}',), start_s=0.0, duration_s=time)
                       for letter, time in zip('xyz', times, strict=True)])
    assert f'the same value for {said} from 0 s on' in one.message


def test_what_is_to_be_acted_upon_comes_first() -> None:
    found = [finding('motion', count=1, excluded_s=3.0), finding('gravity', mean=1.0),
             finding('unknown_rate'), finding('future_code')]
    assert [one.code for one in presented(found)] == [
        'unknown_rate', 'gravity', 'motion', 'future_code']


def test_at_a_running_node_the_advice_is_what_one_can_do_there() -> None:
    moving = finding('mostly_motion', share=0.8)
    assert message_of(moving) == ('80 % of the samples are motion; record while the sensor stands '
                                  'still')
    assert message_of(moving, live=True) == ('80 % of the samples are motion; let the IMU rest, '
                                             'or set motion to keep')
    assert '--' not in ''.join(advice(finding(code), live=True) for code in WORDS
                               if WORDS[code].live is not None)


def test_a_finding_of_another_version_keeps_its_message() -> None:
    assert message_of(Finding('poor_fit', message='gyro_x: it does not fit')) == (
        'gyro_x: it does not fit')
    assert message_of(Finding('of_the_future', message='news\x1b')) == 'news\\x1b'
    assert message_of(Finding('of_the_future')) == 'of the future'


def test_the_page_of_findings_is_made_from_the_table() -> None:
    docs = PACKAGE.parent / 'docs'
    shown = subprocess.run(
        [sys.executable, '-c', 'import make_findings; print(make_findings.page(), end="")'],
        check=True, capture_output=True, text=True, cwd=docs).stdout
    assert (docs / 'findings.md').read_text() == shown
