# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The comparison of Allan tools: what it scores is right, and its page says what was measured."""

import importlib
import json
from pathlib import Path
import re
import subprocess
import sys

import numpy as np
import pytest
from test_packaging import environment, fresh_environment

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope='module')
def peers():
    """Give the modules of bench/peers, which are programs' and no package's."""
    names = ('recorded', 'simulated', 'accuracy', 'adapters', 'page')
    sys.path.insert(0, str(ROOT / 'bench' / 'peers'))
    try:
        return type('Peers', (), {name: importlib.import_module(name) for name in names})
    finally:
        sys.path.remove(str(ROOT / 'bench' / 'peers'))


@pytest.fixture
def small(peers, monkeypatch):
    """Make the sensor with white noise and a random walk one of ten minutes."""
    case = peers.simulated.Case('white noise and a random walk', {
        peers.recorded.N: 1e-4, peers.recorded.K: 3e-5}, rate_hz=50.0, hours=1 / 6)
    monkeypatch.setitem(peers.simulated.CASES, 'walk', case)
    monkeypatch.syspath_prepend(str(ROOT / 'bench' / 'peers'))
    return case


@pytest.mark.usefixtures('small')
def test_two_tools_and_one_small_case_make_a_page(peers):
    tools = ('ours', 'wavelets')
    found = peers.accuracy.run(['walk'], tools, records=2)
    for tool in tools:
        scores = found['walk']['tools'][tool]['coefficients']
        # Twelve axes: the root mean square of an efficient estimate lies within these.
        assert 0.4 < scores['noise_density']['over_bound'] < 2
        assert 0.4 < scores['rate_random_walk']['over_bound'] < 2.5
        assert scores['noise_density']['reported'] == 1
    assert found['walk']['tools']['ours']['coefficients']['noise_density']['coverage'] > 0.7
    assert 'coverage' not in found['walk']['tools']['wavelets']['coefficients']['noise_density']
    figures = {'accuracy': found, 'tools': {
        tool: {'name': module.NAME, 'origin': module.ORIGIN}
        for tool in tools for module in [peers.adapters.adapter(tool)]}}
    text = peers.page.page(figures)
    [errors] = re.findall(r'^\| `walk`.*\| (.*?) \|$', text.partition('## Accuracy')[2]
                          .partition('\n## ')[0], re.MULTILINE)
    score = found['walk']['tools']['wavelets']['coefficients']
    assert errors.replace('*', '').split(', ') == [
        f'{score[key]["over_bound"]:.2f}' for key in ('noise_density', 'rate_random_walk')]
    assert text.index('Where another tool is better') < text.index('## Accuracy')


@pytest.mark.usefixtures('small')
def test_a_record_is_the_same_whenever_it_is_drawn(peers, tmp_path):
    first, again, other = (peers.simulated.record('walk', number, tmp_path / name)
                           for number, name in ((0, 'a'), (0, 'b'), (1, 'c')))
    assert first.samples.tobytes() == again.samples.tobytes()
    assert not np.allclose(first.samples, other.samples)


@pytest.mark.parametrize(('key', 'right'), [
    ('noise_density', lambda tau: 1 / tau),
    ('bias_instability', lambda tau: 2 * np.log(2) / np.pi * tau**0),
    ('rate_random_walk', lambda tau: tau / 3), ('quantization_noise', lambda tau: 3 / tau**2)])
def test_the_generator_has_the_allan_variance_of_each_term(peers, key, right):
    drawn = np.hstack([peers.simulated.noise({key: 1.0}, 100.0, 1 << 14,
                                             np.random.default_rng(seed)) for seed in range(8)])
    tau, variance = peers.recorded.overlapped(drawn, 100.0, 2 ** np.arange(8))
    assert variance.mean(axis=0) / right(tau) == pytest.approx(np.ones(8), abs=0.06)


def test_the_bound_is_that_of_the_statistics_page(peers):
    bound = peers.simulated.bound(peers.simulated.CASES['b'])
    assert [bound[key] for key in ('noise_density', 'bias_instability', 'rate_random_walk')] == (
        pytest.approx([0.00084, 0.10, 0.1739], rel=0.02))


def test_refusals_and_terms_that_are_not_there_count_and_an_interval_by_width_and_miss(
        peers, small):
    estimate = peers.recorded.Estimate
    answer = {axis: {'noise_density': estimate(1.1e-4 if 'gyro' in axis else 1.1e-3),
                     'bias_instability': estimate(1.0)}
              for axis in peers.recorded.AXES}
    scores = peers.accuracy.scores(small, [answer, None])
    assert scores['noise_density']['reported'] == 0.5
    assert scores['noise_density']['rmse'] == pytest.approx(0.1)
    assert scores['bias_instability'] == {'false': 0.5}
    assert scores['rate_random_walk'] == {'reported': 0.0}
    for truth, score in ((1.0, 0.2), (1.2, 0.2 / 1.2 + 40 / 12)):
        assert peers.accuracy.interval_score(estimate(1.0, 0.9, 1.1), truth) == (
            pytest.approx(score))


def test_whatever_another_tool_does_better_comes_first(peers):
    figures = json.loads((ROOT / 'bench' / 'peers' / 'figures.json').read_text())

    def is_first(better):
        return bool(re.search(better, peers.page.page(figures).partition('## Tools')[0]))

    scores = [[case['tools'][tool]['coefficients']['rate_random_walk']
               for tool in ('ours', 'readings')]
              for case in figures['accuracy'].values() if 'rate_random_walk' in case['bound']]
    for mine, theirs in scores:
        mine |= {'reported': 0.5, 'over_bound': 1.0}
        theirs |= {'reported': 0.4, 'over_bound': 1.0}
    assert not is_first('share of axes.*allantools K')
    scores[0][1]['reported'] = 0.6
    assert is_first('share of axes.*allantools K')

    assert not is_first('false terms.*allantools')
    for case in figures['accuracy'].values():
        for tool, share in (('ours', 0.1), ('readings', 0.05)):
            score = case['tools'][tool]['coefficients']['bias_instability']
            score |= {'false': share} if 'false' in score else {}
    assert is_first('false terms.*allantools B')

    for theirs, first in ((0.3, False), (-0.1, True)):
        for tool, ratio in (('ours', 0.2), ('readings', theirs)):
            for axis in figures['published']['tools'][tool]['filter']['log_ratio'].values():
                axis['noise_density'] = ratio
        assert is_first('halves of the.*allantools N') == first


def test_the_page_is_the_one_the_command_wrote_with_every_length_that_was_timed(peers):
    figures = json.loads((ROOT / 'bench' / 'peers' / 'figures.json').read_text())
    assert (ROOT / 'docs' / 'peers.md').read_text() == peers.page.page(figures)
    row = next(iter(figures['speed'].values()))
    figures['speed'] = dict.fromkeys(('100000', '1000000', '3000000'), row)
    assert '| tool | 100,000 | 1,000,000 | 3,000,000 |' in peers.page.page(figures)


@pytest.mark.slow
@pytest.mark.skipif(sys.version_info < (3, 11), reason='the pinned versions need Python 3.11')
def test_a_fresh_environment_repeats_one_row_of_the_page(tmp_path):
    peers = ROOT / 'bench' / 'peers'
    python = environment(tmp_path / 'venv', '--requirement', str(peers / 'requirements.txt'),
                         str(ROOT)) / 'python'
    done = subprocess.run([str(python), str(peers / 'run.py'), '--row', 'b', 'wavelets'],
                          check=True, capture_output=True, text=True, env=fresh_environment())
    row = json.loads(done.stdout.partition('\n')[2])['coefficients']
    page = json.loads((peers / 'figures.json').read_text())['accuracy']['b']['tools']['wavelets']
    assert row.keys() == page['coefficients'].keys()
    for key, scores in page['coefficients'].items():
        # Another kind of processor rounds what comes after.
        assert row[key] == pytest.approx(scores, rel=1e-12)
