# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The benchmarks: the battery, and the comparison of Allan tools with its page."""

import json
import os
from pathlib import Path
import re
import subprocess
import sys

import accuracy
import adapters
from battery import bounds, simulated
from battery.cases import CONSUMER, WALKING
from battery.doors import Said
from battery.outcomes import verdict
from battery.sensors import B, K, N, Sensor
import numpy as np
import page
from processes import python
import pytest
import recorded
import run
from scipy.fft import dct
import simulated as records
from test_packaging import environment, fresh_environment

ROOT = Path(__file__).parents[1]
SMALL = records.Case('white noise and a random walk', {recorded.N: 1e-4, recorded.K: 3e-5},
                     rate_hz=50.0, hours=1 / 6)


@pytest.mark.parametrize(('draw', 'power'), [
    (simulated.white, lambda nu: bounds.term_power(N, nu, 1.0)),
    (simulated.walk, lambda nu: bounds.term_power(K, nu, 1.0)),
    (lambda samples, rng: simulated.power_law(samples, 1.0, rng),
     lambda nu: bounds.term_power(B, nu, 1.0)),
    *((lambda samples, rng, of=exponent: simulated.power_law(samples, of, rng),
       lambda nu, of=exponent: bounds.slow_power(nu, of)) for exponent in (0.7, 1.3)),
    *((lambda samples, rng, of=time: simulated.process(samples, of, rng),
       lambda nu, of=time: bounds.process_power(nu, of)) for time in (20.0, 0.3))],
    ids=['white', 'walk', 'flicker', 'f^-0.7', 'f^-1.3', 'process of 20 samples',
         'process of 0.3 samples'])
def test_simulated_noise_has_the_spectrum_of_the_bounds(draw, power):
    rng, samples, seen = np.random.default_rng(3), 16384, 0.0
    for _ in range(60):
        drawn = draw(samples, rng)
        # Of noise that grows for ever the ends differ; a ramp between them takes little else.
        seen += dct(drawn - np.linspace(drawn[0], drawn[-1], samples), norm='ortho')**2 / 60
    ratio = seen[1:] / power(np.arange(1, samples) / (2 * samples))
    # The slowest octave that is looked at holds 3840 values: 2.3 % is one standard error.
    for first in 2**np.arange(6, 13):
        assert ratio[first:2 * first].mean() == pytest.approx(1.0, abs=0.08)


def test_bounds_of_case_a_and_b_are_the_known_ones_and_a_process_costs_slow_terms_theirs():
    case_a = bounds.reference_widths(Sensor(100, 10_800, CONSUMER))
    case_b = bounds.reference_widths(Sensor(200, 3600, WALKING))
    relative = [width[key] / (2 * bounds.NORMAL95 * terms[key])
                for width, terms in ((case_a, CONSUMER), (case_b, WALKING)) for key in (N, B, K)]
    assert relative == pytest.approx([0.00069, 0.044, 0.30, 0.00084, 0.100, 0.174], rel=0.02)
    alone, beside = (bounds.reference_widths(Sensor(20, 3600, CONSUMER, process=process))
                     for process in (None, (5e-5, 60.0)))
    assert beside[B] > 1.5 * alone[B]
    assert beside[N] == pytest.approx(alone[N], rel=0.1)


@pytest.mark.parametrize(('said', 'truth', 'reported', 'inside', 'width', 'score'), [
    (Said(1.0, (0.9, 1.2), None), 1.1, True, True, 3.0, 3.0),
    # A miss costs forty times its distance.
    (Said(1.0, (0.9, 1.2), None), 0.8, True, False, 3.0, 3.0 + 40.0),
    # A bound counts as the interval from zero.
    (Said(None, None, 0.4), 0.3, False, True, None, 4.0),
    (Said(None, None, 0.4), 0.5, False, False, None, 4.0 + 40.0),
    (Said(None, None, None), 1.0, False, None, None, None)])
def test_what_is_said_is_scored_by_width_and_miss(said, truth, reported, inside, width, score):
    found = verdict(said, truth, 0.1, 2.0)
    assert (found.reported, found.inside, found.width, found.free, found.score) == (
        reported, inside, width and pytest.approx(width), width and pytest.approx(width / 2),
        score and pytest.approx(score))


def test_two_runs_of_one_checkout_are_the_same_and_a_file_can_stand_for_it(tmp_path):
    def battery(*more):
        return python('-m', 'battery', '--parts', 'records', '--only', '10 s, N', '--records', 2,
                      '--seed', 5, *more, cwd=ROOT,
                      env={**os.environ, 'PYTHONPATH': str(ROOT / 'bench')})

    written = tmp_path / 'outcomes.json'
    first = battery('--output', str(written))
    assert first.returncode == 0, first.stderr
    assert [line.split()[:5] for line in first.stdout.splitlines()[1:2]] == [
        ['short:', '10', 's,', 'N', '2']]
    assert [one['seed'] for one in json.loads(written.read_text())['outcomes']] == [5, 6]
    *_, heard, head = battery('--base', str(written)).stdout.splitlines()
    assert heard == '2 records compared: where they differ by more than two standard errors'
    assert head.split() == ['term', 'what', 'base', 'now', 'standard', 'errors']
    (tmp_path / 'imu_allan').mkdir()
    (tmp_path / 'imu_allan' / '__init__.py').write_text('raise SystemExit("of the base")')
    other = battery('--checkout', str(written), '--base', str(tmp_path))
    assert other.stderr.splitlines()[-1] == f'the battery failed in {tmp_path}'


def test_two_tools_and_one_small_case_make_a_page(monkeypatch):
    monkeypatch.setitem(records.CASES, 'walk', SMALL)
    tools = ('ours', 'wavelets')
    found = accuracy.run(['walk'], tools, records=2)
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
        for tool in tools for module in [adapters.adapter(tool)]}}
    text = page.page(figures)
    [errors] = re.findall(r'^\| `walk`.*\| (.*?) \|$', text.partition('## Accuracy')[2]
                          .partition('\n## ')[0], re.MULTILINE)
    score = found['walk']['tools']['wavelets']['coefficients']
    assert errors.replace('*', '').split(', ') == [
        f'{score[key]["over_bound"]:.2f}' for key in ('noise_density', 'rate_random_walk')]
    assert text.index('Where another tool is better') < text.index('## Accuracy')


def test_refusals_and_terms_that_are_not_there_count_and_an_interval_by_width_and_miss():
    estimate = recorded.Estimate
    answer = {axis: {'noise_density': estimate(1.1e-4 if 'gyro' in axis else 1.1e-3),
                     'bias_instability': estimate(1.0)}
              for axis in recorded.AXES}
    scores = accuracy.scores(SMALL, [answer, None])
    assert scores['noise_density']['reported'] == 0.5
    assert scores['noise_density']['rmse'] == pytest.approx(0.1)
    assert scores['bias_instability'] == {'false': 0.5}
    assert scores['rate_random_walk'] == {'reported': 0.0}
    for truth, score in ((1.0, 0.2), (1.2, 0.2 / 1.2 + 40 / 12)):
        assert accuracy.interval_score(estimate(1.0, 0.9, 1.1), truth) == (pytest.approx(score))


@pytest.mark.parametrize('row', [('b', 'allantools'), ('gap', 'wavelets')])
def test_a_row_that_is_not_there_is_refused_with_the_names_of_those_that_are(
        row, monkeypatch, capsys):
    monkeypatch.setattr(sys, 'argv', ['run.py', '--row', *row])
    with pytest.raises(SystemExit):
        run.main()
    assert 'gaps and one of ours, wavelets, readings,' in capsys.readouterr().err


def test_the_page_is_the_one_the_command_wrote_with_every_length_that_was_timed():
    figures = json.loads((ROOT / 'bench' / 'peers' / 'figures.json').read_text())
    assert (ROOT / 'docs' / 'peers.md').read_text() == page.page(figures)
    row = next(iter(figures['speed'].values()))
    figures['speed'] = dict.fromkeys(('100000', '1000000', '3000000'), row)
    assert '| tool | 100,000 | 1,000,000 | 3,000,000 |' in page.page(figures)


@pytest.mark.slow
@pytest.mark.skipif(sys.version_info < (3, 11), reason='the pinned versions need Python 3.11')
def test_a_fresh_environment_repeats_one_row_of_the_page(tmp_path):
    peers = ROOT / 'bench' / 'peers'
    python = environment(tmp_path / 'venv', '--requirement', str(peers / 'requirements.txt'),
                         str(ROOT)) / 'python'
    done = subprocess.run([str(python), str(peers / 'run.py'), '--row', 'b', 'wavelets'],
                          check=True, capture_output=True, text=True, env=fresh_environment())
    row = json.loads(done.stdout.partition('\n')[2])['coefficients']
    figures = json.loads((peers / 'figures.json').read_text())['accuracy']['b']['tools']
    expected = figures['wavelets']['coefficients']
    assert row.keys() == expected.keys()
    for key, scores in expected.items():
        # Another kind of processor rounds what comes after.
        assert row[key] == pytest.approx(scores, rel=1e-12)
