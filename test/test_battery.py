# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The battery: its simulators, its bounds and its scores."""

import json
import os
from pathlib import Path
import subprocess
import sys

from battery import bounds, simulated
from battery.cases import CONSUMER, WALKING
from battery.doors import Said
from battery.outcomes import verdict
from battery.sensors import B, K, N, Sensor
import numpy as np
import pytest
from scipy.fft import dct


def octave_ratios(draw, power, samples=16384, records=60):
    """Mean power of records in octaves, over what it should be; the slowest left out."""
    rng = np.random.default_rng(3)
    seen = np.zeros(samples)
    for _ in range(records):
        drawn = draw(samples, rng)
        # Of noise that grows for ever the ends differ; a ramp between them takes little else.
        seen += dct(drawn - np.linspace(drawn[0], drawn[-1], samples), norm='ortho')**2 / records
    nu = np.arange(1, samples) / (2 * samples)
    ratio = seen[1:] / power(nu)
    return np.array([ratio[first:2 * first].mean() for first in 2**np.arange(6, 13)])


def of_law(exponent, power):
    return (lambda samples, rng: simulated.power_law(samples, exponent, rng)), power


def of_process(time):
    return (lambda samples, rng: simulated.process(samples, time, rng),
            lambda nu: bounds.process_power(nu, time))


@pytest.mark.parametrize(('draw', 'power'), [
    (simulated.white, lambda nu: bounds.term_power(N, nu, 1.0)),
    (simulated.walk, lambda nu: bounds.term_power(K, nu, 1.0)),
    of_law(1.0, lambda nu: bounds.term_power(B, nu, 1.0)),
    of_law(0.7, lambda nu: bounds.slow_power(nu, 0.7)),
    of_law(1.3, lambda nu: bounds.slow_power(nu, 1.3)), of_process(20.0), of_process(0.3),
], ids=['white', 'walk', 'flicker', 'f^-0.7', 'f^-1.3', 'process of 20 samples',
        'process of 0.3 samples'])
def test_simulated_noise_has_the_spectrum_of_the_bounds(draw, power):
    # Of 60 records the slowest octave holds 3840 values: 2.3 % is one standard error.
    assert octave_ratios(draw, power) == pytest.approx(1.0, abs=0.08)


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
def test_what_is_said_is_scored_by_its_width_and_its_miss(
        said, truth, reported, inside, width, score):
    found = verdict(said, truth, 0.1, 2.0)
    assert (found.reported, found.inside) == (reported, inside)
    assert (found.width, found.free, found.score) == (
        width and pytest.approx(width), width and pytest.approx(width / 2),
        score and pytest.approx(score))


ROOT = Path(__file__).parents[1]


def battery(*arguments):
    """Run the battery as `make battery` does."""
    return subprocess.run([sys.executable, '-m', 'battery', *arguments], cwd=ROOT,
                          env={**os.environ, 'PYTHONPATH': str(ROOT / 'bench')},
                          capture_output=True, text=True, check=False)


def test_two_runs_of_one_checkout_are_the_same_and_a_file_can_stand_for_it(tmp_path):
    chosen = ('--parts', 'records', '--only', '10 s, N', '--records', '2', '--seed', '5')
    written = tmp_path / 'outcomes.json'
    first = battery(*chosen, '--output', str(written))
    assert first.returncode == 0, first.stderr
    assert [line.split()[:5] for line in first.stdout.splitlines()[1:2]] == [
        ['short:', '10', 's,', 'N', '2']]
    assert [one['seed'] for one in json.loads(written.read_text())['outcomes']] == [5, 6]
    again = battery(*chosen, '--base', str(written))
    *_, heard, head = again.stdout.splitlines()
    assert heard == '2 records compared: where they differ by more than two standard errors'
    assert head.split() == ['term', 'what', 'base', 'now', 'standard', 'errors']
