# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What filters with one bias state predict and what happens; the numbers chosen for them."""

from dataclasses import replace

from exact_results import axis_of, FLICKER
import imu_allan
from imu_allan.characterization.axis import characterize
from imu_allan.errors import LONGEST_S, SHORTEST_S
from imu_allan.noise.simulate import simulate
from imu_allan.result import Tone
from imu_allan.tuning.backtest import run_filters
from imu_allan.tuning.state_space import state_space
from imu_allan.tuning.tune import assess, Filters, Truth, tune
import numpy as np
import pytest
from scipy.signal import lfilter
from whole_lines import refused

HORIZONS = np.array([1.0, 3.0, 20.0, 90.0])
PROCESS = {'processes': ((5e-4, 40.0),)}
SHORTER = ('a coast of 0.5 s is shorter than an aiding interval of 1 s: a filter is unaided for '
           'at least one interval')


def one(value):
    return np.array([value])


def filters_of(white, driving, time=np.inf):
    return Filters.of(one(white), one(driving), one(time), 1.0)


def unaided_variance(axis, aiding_s, horizons):
    """Variance of means after very many corrections of the filter of the whole drift model."""
    spaces = [state_space(axis, step_s) for step_s in (aiding_s, *horizons)]
    # Without a random walk, nothing is left of the unknown bias in the end.
    known = spaces[0].process[-1, -1] == 0
    spaces[0].initial[-1, -1] *= 1 - known
    _, covariance = run_filters(spaces[:1], [np.zeros(4001)], {4000}).before[4000]
    return np.array([float((over.observation @ covariance[0] @ over.observation.T
                            + over.measurement)[0, 0]) for over in spaces[1:]])


@pytest.mark.parametrize(('filters', 'drift'), [
    (filters_of(4e-6, 9e-10), {'walk': 3e-5}),
    (filters_of(4e-6, 2 * 5e-4**2 / 40, 40.0), PROCESS)], ids=['walking', 'markov'])
def test_a_filter_predicts_what_the_kalman_filter_of_its_model_predicts(filters, drift):
    truth = axis_of(2e-3, **drift)
    np.testing.assert_allclose(filters.predicted(HORIZONS)[:, 0],
                               unaided_variance(truth, 1.0, HORIZONS), rtol=1e-9)
    np.testing.assert_allclose(Truth(truth).expected(filters, HORIZONS),
                               filters.predicted(HORIZONS), rtol=1e-9)


def happened(samples, filters, horizon):
    """Mean square error of a filter that sees every sample and predicts the mean of the next."""
    gain, decay = float(filters.gain[0]), 1 - float(filters.forgetting[0])
    state = lfilter([0.0, gain], [1.0, -decay], samples)
    total = np.concatenate(([0.0], np.cumsum(samples)))
    mean = (total[horizon:] - total[:-horizon]) / horizon
    weight = float(filters.weight(np.array([float(horizon)]))[0, 0])
    return float(np.mean((mean - weight * state[:len(mean)])[5000:] ** 2))


@pytest.mark.parametrize(('filters', 'walk'), [
    (filters_of(2e-6, 1e-9), 0.0),
    (filters_of(2e-6, 2 * 8e-4**2 / 8, 8.0), 0.0),
    (filters_of(4e-6, 1e-9), 1e-4)],
    ids=['walking', 'markov', 'on a random walk'])
def test_what_happens_to_a_wrong_filter_is_what_a_simulation_shows(filters, walk):
    drift = {'rate_random_walk': walk} if walk else {
        'gauss_markov': {'sigma': 5e-4, 'correlation_time_s': 30.0}}
    samples = simulate({'noise_density': 1e-3, **drift}, 2_000_000, 1.0, seed=8)
    truth = Truth(axis_of(1e-3, walk, () if walk else ((5e-4, 30.0),)))
    for horizon in (1, 10, 60):
        expected = truth.expected(filters, one(float(horizon)))[0, 0]
        assert happened(samples, filters, horizon) == pytest.approx(expected, rel=0.02)


def test_a_sensor_that_a_filter_models_keeps_its_numbers():
    tuning = tune(axis_of(1e-3, 5e-5), 0.5, 32.0)
    assert tuning.noise_density == pytest.approx(1e-3, rel=0.01)
    assert tuning.random_walk == pytest.approx(5e-5, rel=0.08)
    assert tuning.nis == pytest.approx(1, abs=0.01)
    assert tuning.coast_ratio == pytest.approx(1, abs=0.1)
    # Horizons reach from the correction to the coast.
    assert [row[0] for row in tuning.consistency] == pytest.approx([.5, 1, 2, 4, 8, 16, 32])
    assert (tuning.aiding_interval_s, tuning.coast_s) == (0.5, 32.0)
    assert (tuning.known_from_s, tuning.known_to_s) == (0.01, 3e3)
    triple = tune(axis_of(1e-3, **PROCESS), 1.0, 100.0, bias='gauss_markov')
    assert triple.random_walk is None
    assert triple.noise_density == pytest.approx(1e-3, rel=0.01)
    assert triple.sigma == pytest.approx(5e-4, rel=0.1)
    assert triple.correlation_time_s == pytest.approx(40.0, rel=0.2)
    assert [expected / predicted for _, expected, predicted in triple.consistency
            ] == pytest.approx([1.0] * 7, abs=0.02)


def test_a_drift_that_no_random_walk_describes_is_not_said_to_be_known():
    """The exported walk of a flicker-like sensor is near zero; the tuned one covers its drift."""
    axis = axis_of(1e-3, 1e-7, ((3e-4, 3.0), (3e-4, 30.0), (3e-4, 300.0)))
    process = tune(axis, 1.0, 60.0, 'gauss_markov')
    walk = process.sigma * (2 / process.correlation_time_s)**0.5
    again = assess(axis, process.noise_density, walk, 1.0, 60.0, process.correlation_time_s)
    np.testing.assert_allclose(again.consistency, process.consistency, rtol=1e-9)
    measured = assess(axis, 1e-3, 1e-7, 1.0, 60.0)
    tuning = tune(axis, 1.0, 60.0)
    assert measured.coast_ratio > 3
    assert measured.nis > 1.2
    assert 0.7 < tuning.coast_ratio < 1.4
    assert 0.9 < tuning.nis < 1.1
    folk = assess(axis, 1e-3, 10 * tuning.random_walk, 1.0, 60.0)
    assert folk.coast_ratio < 0.2
    # No pair coasts as well as the full model.
    horizons, expected, _ = np.array(tuning.consistency).T
    assert (np.sqrt(unaided_variance(axis, 1.0, horizons)) <= expected * (1 + 1e-9)).all()


def test_the_conservative_set_covers_how_much_the_drift_of_a_sensor_usually_changes():
    axis = axis_of(1e-3, 1e-5, ((3e-4, 30.0),))
    plain, careful = (tune(axis, 1.0, 60.0, conservative=careful) for careful in (False, True))
    assert all(predicted > expected for _, expected, predicted in careful.consistency)
    # 1.645 standard deviations of 0.17 of the logarithm, twice for a variance, and chance.
    assert careful.coast_ratio < plain.coast_ratio / 1.75


@pytest.mark.parametrize('drift', [{}, {'walk': 1e-5}, {'walk': 1e-4}], ids=['N', 'N+K', 'N+10 K'])
def test_corrections_rarer_than_the_record_is_long_have_a_filter_for_what_it_may_hide(drift):
    """Candidates reach what a record of a minute may hide, not only the little that it shows."""
    axis = axis_of(1e-3, known=(0.01, 20.0), **drift)
    plain, careful = (tune(axis, 600.0, 3600.0, conservative=careful) for careful in (False, True))
    assert plain.nis < 1
    assert plain.coast_ratio < 1.3
    assert all(predicted > expected for _, expected, predicted in careful.consistency)


def test_a_conservative_filter_of_short_steps_is_still_worth_something():
    """What is uncertain in fast noise goes into N: a random walk that covers it has no end."""
    axis = axis_of(6.6e-4, 1.7e-5, ((2.5e-4, 0.1), (1.5e-4, 20.0), (1.6e-4, 300.0)),
                   known=(0.1, 3e3))
    curve = replace(axis.curve, adev=tuple(
        adev * (1.1 if tau < 0.1 else 1.0)
        for tau, adev in zip(axis.curve.tau_s, axis.curve.adev, strict=True)))
    careful = tune(replace(axis, curve=curve), 0.05, 60.0, conservative=True)
    assert 0.6 < careful.nis < 1
    assert 0.1 < careful.coast_ratio < 1
    assert careful.random_walk < 3e-4


@pytest.mark.parametrize(('asked', 'line'), [
    (lambda: tune(axis_of(1e-3, 1e-5), 1.0, 0.5), SHORTER),
    (lambda: assess(axis_of(1e-3, 1e-5), 1e-3, 1e-5, 1.0, 0.5), SHORTER),
    (lambda: tune(axis_of(1e-3), bias='flicker'),
     "bias must be 'random_walk' or 'gauss_markov', not 'flicker'"),
    (lambda: tune(axis_of(0.0)),
     'this axis has no noise: there is nothing to tune a filter with')])
def test_what_cannot_be_tuned_is_refused(asked, line):
    with refused(line):
        asked()


@pytest.mark.slow
@pytest.mark.parametrize('minutes', [10, 60])
@pytest.mark.parametrize(('terms', 'drift'), [
    ({}, {}), ({'rate_random_walk': 5e-5}, {'walk': 5e-5}),
    *(({'gauss_markov': {'sigma': 5e-4, 'correlation_time_s': time}},
       {'processes': ((5e-4, time),)}) for time in (30.0, 100.0)),
    ({'bias_instability': 3e-4}, {'processes': FLICKER})],
    ids=['N', 'N+K', 'N+30 s', 'N+100 s', 'N+B'])
def test_a_conservative_filter_is_overconfident_in_one_record_of_twenty(minutes, terms, drift):
    """Fitted on so many minutes; what happens is computed from the truth."""
    truth, horizons = Truth(axis_of(1e-3, **drift)), np.geomspace(1.0, 60.0, 7)
    careful, half = [], []
    for seed in range(40):
        samples = simulate({'noise_density': 1e-3, **terms}, 3000 * minutes, 50.0, seed)
        axis = characterize(samples, 50.0)
        pairs = [(one.noise_density, one.random_walk) for one in (
            tune(axis, 1.0, 60.0, conservative=True), tune(axis, 1.0, 60.0))]
        # And the pair half way to the tuned one.
        for ratios, (n, k) in ((careful, pairs[0]), (half, np.sqrt(np.multiply(*pairs)))):
            filters = filters_of(n**2, k**2)
            ratios.append(truth.expected(filters, horizons)[:, 0]
                          / filters.predicted(horizons)[:, 0])
    # Five per cent at each horizon, with twice the error of 40 trials.
    assert np.mean(np.array(careful) > 1, axis=0).max() < 0.12
    if 'bias_instability' in terms and minutes == 10:
        # Half of what is added would not do.
        assert np.mean(np.max(half, axis=1) > 1) > 0.1


def test_axes_that_are_equal_for_a_filter_are_tuned_once_and_others_anew():
    axis = axis_of(2e-3, 3e-5)
    first = tune(axis)
    assert tune(replace(axis, mean=0.5)) is first
    assert tune(axis, coast_s=10.0) != first
    # Lines count as noise of the corrections.
    louder = replace(axis, tones=(Tone(5.0, 1e-2),))
    assert tune(louder).noise_density > 1.1 * first.noise_density
    assert tune(axis_of(2e-3, 3e-5, tones=((4.0, 1e-2),))).noise_density > first.noise_density


AXIS = axis_of(1e-3, 1e-5)
NO_NUMBERS = [(None, 'None'), ('1', "'1'"), (True, 'True'), (np.ones(2), 'array([1., 1.])'),
              ('x\n' * 10_000, "'" + 9 * 'x\\n' + 'x…n' + 9 * 'x\\n' + "'")]
TIMES = {
    'aiding_interval_s': lambda time: imu_allan.tune(AXIS, time, 1e9),
    'coast_s': lambda time: imu_allan.assess(AXIS, 1e-3, 1e-5, 1e-6, time),
    'correlation_time_s': lambda time: imu_allan.tune(AXIS, bias='gauss_markov',
                                                      correlation_time_s=time),
    'step_s': lambda time: imu_allan.state_space(AXIS, time),
    'horizons_s': lambda time: imu_allan.predicted_drift(AXIS, [1.0, time]),
    'calibration_s': lambda time: imu_allan.predicted_drift(AXIS, [1.0], time),
}
NUMBERS = {
    'noise_density': lambda number: imu_allan.assess(AXIS, number, 1e-5),
    'random_walk': lambda number: imu_allan.assess(AXIS, 1e-3, number),
}


@pytest.mark.parametrize('name', [*TIMES, *NUMBERS])
def test_what_is_no_number_in_range_is_one_line_that_names_the_argument(name):
    ends = 'from 1e-06 to 3.2e+09' if name in TIMES else 'from 1e-30 to 1e+30'
    said = [*NO_NUMBERS, *((value, f'{value:g}') for value in (0, float('nan'), 1e-31, 1e31))]
    # This may be left out.
    for value, line in said[name == 'correlation_time_s':]:
        with refused(f'{name} must be a number {ends}, not {line}'):
            (TIMES | NUMBERS)[name](value)


def test_a_random_walk_has_no_correlation_time():
    with refused("correlation_time_s is for bias='gauss_markov': a random walk has none"):
        imu_allan.tune(AXIS, correlation_time_s=100.0)


def test_drift_over_one_time_is_that_over_a_list_of_it():
    assert imu_allan.predicted_drift(AXIS, 10) == imu_allan.predicted_drift(AXIS, [10.0])


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('known_s', [200.0, 1e4])
def test_the_ends_of_what_is_taken_give_numbers(known_s):
    """A filter that is corrected every microsecond forgets less than a double shows beside 1."""
    axis = axis_of(1e-3, 1e-5, ((3e-4, 30.0),), known=(0.1, known_s),
                   quantity='linear_acceleration')
    for aiding, coast in ((SHORTEST_S, LONGEST_S), (SHORTEST_S, SHORTEST_S),
                          (LONGEST_S, LONGEST_S)):
        for bias in ('random_walk', 'gauss_markov'):
            for conservative in (False, True):
                found = imu_allan.tune(axis, aiding, coast, bias, conservative)
                assert np.isfinite(found.consistency).all()
        forecast = imu_allan.predicted_drift(axis, [aiding, coast], coast)
        assert np.isfinite([*forecast.integral, *forecast.position]).all()
        assert np.isfinite([*forecast.integral_ci95, *forecast.position_ci95]).all()
