# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The comparison of Allan tools: what it scores is right, and its page says what was measured."""

import importlib
import json
from pathlib import Path
import re
import subprocess
import sys

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
