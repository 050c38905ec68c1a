# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The battery: its simulators, its bounds, its scores, and where it finds two runs to differ."""

from dataclasses import replace
import json
import os
from pathlib import Path
import subprocess
import sys

from battery import bounds, recordings, simulated
from battery.__main__ import main
from battery.cases import CONSUMER, RECORDS, SPECTRA, WALKING
from battery.doors import Answer, Said
from battery.outcomes import of_record, of_spectra, outcome, verdict
from battery.sensors import B, Filter, K, N, Q, Sensor, TERMS
from battery.tables import differences, table
from bench_filter import both_ways
from imu_allan import simulate
import numpy as np
import pytest
from scipy.fft import dct
from scipy.signal import butter


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


def test_simulated_quantization_noise_has_the_variance_of_the_bounds():
    drawn = simulated.quantization(100_000, np.random.default_rng(3))
    nu = (np.arange(1000) + 0.5) / 2000
    assert drawn.var() == pytest.approx(bounds.term_power(Q, nu, 1.0).mean(), rel=0.02)
    assert abs(drawn.sum()) < 10


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


def test_noise_through_a_filter_keeps_its_slow_level():
    sensor = Sensor(10, 2000, {N: 1.0}, through=Filter([0.2], [1.0, -0.8], times=4))
    seen = [sensor.record(np.random.default_rng(seed)).mean() for seed in range(300)]
    assert np.var(seen) * 2000 == pytest.approx(1.0, abs=0.25)


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


def test_records_and_spectra_are_the_same_again():
    [number] = [number for number, case in enumerate(RECORDS) if case.name == '10 s, NB']
    first, again, other = of_record(number, 0), of_record(number, 0), of_record(number, 1)
    for one in (*first, *again, *other):
        del one['cpu_s']
    assert first == again
    assert first[0]['terms'] != other[0]['terms']
    [flicker] = [number for number, case in enumerate(SPECTRA) if case.name == 'NB']
    assert [one['terms'] for one in of_spectra(flicker, 0, 2)] == [
        one['terms'] for one in of_spectra(flicker, 0, 2)]


@pytest.mark.parametrize(('name', 'seed'), [('QNB', 71008), ('mean of 8', 61000)])
def test_flicker_is_known_as_well_as_it_can_be_beside_quantization_and_behind_a_filter(name, seed):
    """Flicker of another exponent is compared where it is seen: B was twice as wide elsewhere."""
    [number] = [number for number, case in enumerate(RECORDS) if case.name == name]
    [found] = of_record(number, seed)
    assert found['terms'][B]['width'] < 1.5


def test_every_case_has_a_name_of_its_own_and_finite_bounds():
    for cases in (RECORDS, SPECTRA):
        names = [(case.family, case.name) for case in cases]
        assert len(set(names)) == len(names)
        for case in cases:
            widths = bounds.reference_widths(case.sensor)
            assert set(widths) == set(TERMS)
            assert all(np.isfinite(width) and width > 0 for width in widths.values()), case.name
            assert all(cost >= 1 for cost in bounds.corner_costs(case.sensor).values()), case.name


def test_who_does_not_know_the_corner_reads_white_noise_in_the_pass_band_alone():
    """The stop band of one pole shows N times the corner, and nothing of N itself."""
    corner_hz, rate_hz, hours = 0.2, 100.0, 1.0
    sensor = Sensor(rate_hz, hours * 3600, {N: 1.0},
                    through=Filter(*butter(1, corner_hz, fs=rate_hz)))
    cost = bounds.corner_costs(sensor)[N]
    # So many of the coefficients lie below the corner; those about it say something, too.
    assert 0.5 < cost * np.sqrt(2 * corner_hz / rate_hz) < 2
    assert bounds.corner_costs(replace(sensor, through=None))[N] == 1


def of_flicker(seed, interval, codes=()):
    """Outcome of a record in which N and B are, and B is said to lie in an interval."""
    [case] = [case for case in RECORDS if case.name == '1 min, NB']
    truth = case.sensor.terms
    said = {Q: Said(None, None, 1e-6), N: Said(truth[N], (0.9 * truth[N], 1.1 * truth[N]), None),
            B: Said(truth[B], tuple(end * truth[B] for end in interval), None),
            K: Said(None, None, 1e-3)}
    return outcome('records', case, seed, Answer(said, codes, 0.1),
                   bounds.reference_widths(case.sensor), bounds.corner_costs(case.sensor))


def test_two_runs_differ_where_all_records_changed_the_same_way():
    before = [of_flicker(seed, (0.5, 2.0)) for seed in range(9)]
    wider = [of_flicker(seed, (0.5, 4.0)) for seed in range(9)]
    wrong = [of_flicker(seed, (1.1, 2.0), ('poor_fit',)) for seed in range(9)]
    for same in (before, [of_flicker(0, (1.1, 2.0)), *before[1:]]):
        # One record that changed is no difference.
        assert list(differences(before, same))[2:] == []
    assert {line.split()[6] for line in list(differences(before, wider))[2:]
            if '1 min' in line} == {'width', 'score'}
    found = list(differences(before, wrong))[2:]
    assert any('coverage' in line and line.endswith('-3.0') for line in found)
    assert any('poor_fit' in line and line.endswith('+3.0') for line in found)


def test_the_table_has_coverage_width_and_what_is_false():
    found = [of_flicker(seed, (0.5, 2.0) if seed else (1.1, 2.0)) for seed in range(4)]
    lines = list(table(found))
    [head] = [line for line in lines if 'N    ' in line and '1 min, NB' in line]
    [flicker] = [line for line in lines if line.split()[:1] == ['B']]
    assert head.split()[:6] == ['short:', '1', 'min,', 'NB', '4', 'N']
    assert flicker.split()[1:3] == ['1.00', '0.750']


def test_a_recording_of_the_reader_is_held_against_its_parts(short_recording, monkeypatch):
    for named in (short_recording, short_recording.parent):
        monkeypatch.setenv('IMU_ALLAN_DATA', str(named))
        # It has no accelerometer.
        axes = list(recordings.axes())
        assert [axis[:2] for axis in axes] == [('a', f'gyro {letter}') for letter in 'xyz']
        [found] = recordings.of_axis(*axes[0])
        assert found['terms'][N]['freedom'] == 3


def test_filters_run_over_a_recording_too_short_for_the_longest_outage():
    record = simulate({'noise_density': 1e-4, 'rate_random_walk': 1e-5}, 4800, 10.0, 1)
    for line in both_ways(record, 10.0, 'angular_velocity'):
        assert ('within its band', 'coast 60') in line
        assert ('within its band', 'coast 300') not in line


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


@pytest.mark.parametrize(('arguments', 'line'), [
    (['--only', 'nonsense'], 'battery: error: --only: no family and no case is called nonsense'),
    (['--only', '10 s, N', '--base', '/nowhere', '--checkout', '/nowhere'],
     '/nowhere: no checkout of imu_allan, and no file of outcomes')])
def test_what_cannot_be_run_is_refused(arguments, line, monkeypatch, capsys):
    monkeypatch.setattr(sys, 'argv', ['battery', *arguments])
    with pytest.raises(SystemExit) as stop:
        main()
    assert line in (stop.value.code, *capsys.readouterr().err.splitlines())
