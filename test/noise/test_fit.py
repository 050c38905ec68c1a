# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What real sensors do to a fit: low-pass, tones, drift, and terms that are not there."""

import json

from battery.bounds import reference_widths, term_power
from battery.sensors import Sensor
from characterized import (
    B,
    characterized,
    covers,
    ends,
    holds,
    K,
    N,
    results_of,
    simulated,
    taken_in,
)
from imu_allan.characterization.axis import characterize
from imu_allan.noise import spectrum
from imu_allan.noise.axis_fit import fit_axes
from imu_allan.noise.joint_fit import joint_fit
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.simulate import simulate
import numpy as np
import pytest
from repeated import slow
from scipy.fft import idct
from scipy.signal import butter, lfilter
from whole_lines import refused

DEGREE = np.pi / 180
SENSOR = {N: 0.0045 * DEGREE, B: 0.0014 * DEGREE, K: 2.5e-4 * DEGREE}
RATE = 100.0
HOURS_3 = 1_080_000
WHOLE = 8192
"""Samples of a record that is transformed as a whole."""
NOT_FINITE = ('samples must be finite, below 1e30, real, and none masked; '
              'imu_allan.analyze reads a CSV file with gaps')


def seen(axis):
    return {key for key, found in axis.coefficients.items() if found.observable}


@pytest.fixture(scope='module')
def record():
    return simulate(SENSOR, HOURS_3, RATE, seed=1)


def test_coefficients_of_a_mems_gyro_are_found_with_honest_intervals(record):
    axis = characterize(record, RATE)
    for key, truth in SENSOR.items():
        found = axis.coefficients[key]
        assert holds(found, truth), key
        assert found.ci95[0] < found.value < found.ci95[1]
    assert axis.coefficients[N].value == pytest.approx(SENSOR[N], rel=3e-3)
    # The interval shrinks as one over the square root of time: three times as long again.
    assert axis.coefficients[N].ci_halves_in_s == pytest.approx(3 * HOURS_3 / RATE, rel=0.1)
    assert axis.goodness_of_fit.acceptable
    assert (axis.tones, axis.band_limit_s) == ((), None)
    for key in ('quantization_noise', 'rate_ramp'):
        c = axis.coefficients[key]
        assert (c.observable, c.value, c.ci95) == (False, None, None)
        assert c.upper95 > 0
    assert json.dumps(axis.to_dict(), allow_nan=False)
    assert 'np.' not in repr(axis.to_dict())


@pytest.mark.parametrize('low_pass', [
    butter(1, 20, fs=RATE), butter(4, 2.5, fs=RATE), (np.ones(2) / 2, [1.0])],
    ids=['1st 20 Hz', '4th 2.5 Hz', 'boxcar 2'])
def test_low_pass_is_seen_and_leaves_the_coefficients_alone(record, low_pass):
    axis, remarks = characterized(lfilter(*low_pass, record)[2000:], RATE)
    assert 'band_limited' in remarks
    assert axis.band_limit_s is not None
    assert (axis.band_edge_hz, axis.gauss_markov) == (None, None)
    assert axis.coefficients[N].value == pytest.approx(SENSOR[N], rel=0.025)
    for key, truth in SENSOR.items():
        # Within four standard errors, or under the upper bound.
        found = axis.coefficients[key]
        assert (abs(found.value - truth) <= np.diff(found.ci95) if found.observable
                else truth <= 1.5 * found.upper95), key
    assert axis.coefficients['quantization_noise'].value is None


@pytest.mark.parametrize('frequency', [0.05, slow(1.0), 13.37, slow(49.99)])
def test_tone_is_named_and_leaves_the_coefficients_alone(record, frequency):
    amplitude = 5 * SENSOR[N]
    tone = amplitude * np.sin(2 * np.pi * frequency * np.arange(HOURS_3) / RATE)
    axis = characterize(record + tone, RATE)
    assert axis.tones[0].frequency_hz == pytest.approx(frequency, abs=0.01)
    assert axis.tones[0].amplitude == pytest.approx(amplitude, rel=0.15)
    assert len(axis.tones) <= 2
    assert axis.coefficients[N].value == pytest.approx(SENSOR[N], rel=5e-3)
    found = axis.coefficients[B]
    # What it leaves where the flicker is seen may be a process of its time.
    assert found.observable or frequency == 0.05
    assert holds(found, SENSOR[B]) or (frequency == 0.05 and ends(found)[1] > SENSOR[B])


@pytest.mark.parametrize('seeds', [range(5), slow(range(5, 20))])
def test_white_noise_has_no_other_term(seeds):
    for axis in simulated({N: 1.0}, 50_000, RATE, seeds):
        assert seen(axis) == {N}
        assert axis.tones == ()


@pytest.mark.thorough
@pytest.mark.parametrize('records', [5, slow(10)])
def test_random_walk_that_levels_off_is_a_gauss_markov_process(records):
    # Two hours of a minute's correlation: few coefficients know, too few for the whole band's sum.
    model = {N: 1e-3, 'gauss_markov': {'sigma': 1e-3, 'correlation_time_s': 60.0}}
    axes = simulated(model, 360_000, 50.0, range(records))
    found = [axis.gauss_markov for axis in axes if axis.gauss_markov]
    assert len(found) >= 0.8 * records
    assert np.median([one.sigma for one in found]) == pytest.approx(1e-3, rel=0.2)
    assert np.median([one.correlation_time_s for one in found]) == pytest.approx(60, rel=0.3)
    assert not any(axis.coefficients[K].observable for axis in axes if axis.gauss_markov)
    # The model goes through the curve at its long end instead of far above.
    for curve in (axis.curve for axis in axes if axis.gauss_markov):
        sure = np.array(curve.edf) > 4
        low, high = np.transpose(curve.ci95)[:, sure]
        model = np.array(curve.model_adev)[sure]
        assert ((0.8 * low < model) & (model < 1.25 * high)).all()


@pytest.mark.thorough
@pytest.mark.parametrize(('size', 'time_s'), [slow(2.0, 300.0), (1.5, 100.0)])
def test_slow_process_in_twelve_hours_is_found_with_intervals_that_cover(size, time_s):
    sigma = size * SENSOR[B]
    model = {**SENSOR, 'gauss_markov': {'sigma': sigma, 'correlation_time_s': time_s}}
    del model[K]
    found = [axis.gauss_markov for axis in simulated(model, 43_200, 1.0, range(12))]
    some = [one for one in found if one]
    # In 99 of 100 drawn records and more.
    assert len(some) >= 10
    # Of 12 intervals of 95 % four or more fail once in 450 times.
    assert sum(not covers(one.sigma_ci95, sigma) for one in some) <= 3
    assert sum(not covers(one.correlation_time_ci95, time_s) for one in some) <= 3


@pytest.mark.thorough
@pytest.mark.parametrize(('records', 'flickering'), [(range(2), range(4)),
                                                     slow(range(2, 5), range(4, 12))])
@pytest.mark.parametrize('terms', [
    {N: 1e-3, K: 3e-4}, {**SENSOR, K: 5e-4 * DEGREE}, {N: 1e-3, B: 1e-3}], ids='+'.join)
def test_a_lasting_random_walk_and_flicker_are_no_gauss_markov_process(terms, records, flickering):
    axes = (simulated(terms, 360_000, RATE, records) if K in terms
            else simulated(terms, 72_000, RATE, flickering))
    assert not any(axis.gauss_markov for axis in axes)
    assert all(axis.coefficients[K].observable for axis in axes) == (K in terms)


@pytest.mark.parametrize('slope', [-1e-4, slow(1e-3)])
def test_ramp_of_any_strength_leaves_the_other_terms_as_they_are(slope):
    # 1e-3 rad/s^2 over three hours is a thousand times the noise of a sample.
    model = {N: 1e-3, B: 5e-4, K: 5e-5}
    record, time = simulate(model, HOURS_3, RATE, 3), np.arange(HOURS_3) / RATE
    gentle, strong = (characterize(record + ramp * time, RATE).coefficients
                      for ramp in (1e-5, slope))
    for key in model:
        assert strong[key].value == pytest.approx(gentle[key].value, rel=0.01)
        assert strong[key].ci95 == pytest.approx(gentle[key].ci95, rel=0.02)
    for ramp, found in ((1e-5, gentle), (slope, strong)):
        assert holds(found['rate_ramp'], ramp)
        assert np.diff(found['rate_ramp'].ci95) < 5e-6


@pytest.mark.parametrize(('errors', 'observable'), [(2.2, False), (3.0, True)])
def test_a_ramp_is_reported_where_a_random_walk_seldom_drifts_so_far(errors, observable):
    walk, samples = 3e-3, 60_000
    time = np.arange(samples) / RATE
    record = simulate({N: 1e-3, K: walk}, samples, RATE, 1)
    drift = (record[-50:].mean() - record[:50].mean()) / (time[-1] - 0.5)
    error = walk / np.sqrt(samples / RATE)
    found = characterize(record + (errors * error - drift) * time, RATE).coefficients['rate_ramp']
    assert found.observable == observable
    # The normal interval, and a little for what is not known of the walk.
    width = (found.ci95[1] - found.value if observable else found.upper95 - errors * error) / error
    assert 1.9 < width < 2.1


def record_without_chance(terms, ramp=0.0):
    """Give a record whose every coefficient has exactly the power that is expected of it."""
    number = np.arange(1, WHOLE)
    # What the ends of a record leave of flicker in its slowest coefficients.
    left = {B: spectrum.flicker_dct_factor(number)}
    power = sum(size**2 * term_power(key, number / (2 * WHOLE), RATE) * left.get(key, 1)
                for key, size in terms.items())
    signs = np.random.default_rng(0).choice([-1, 1], WHOLE - 1)
    samples = idct(np.concatenate(([0.0], signs * np.sqrt(power))), norm='ortho')
    return samples + ramp * np.arange(WHOLE) / RATE


@pytest.mark.parametrize('ramp', [0.0, -1e-2])
@pytest.mark.parametrize('terms', [
    {N: 1e-3}, {N: 1e-3, B: 5e-3}, {N: 1e-3, K: 3e-3, 'quantization_noise': 4e-5},
    {N: 1e-3, B: 5e-3, K: 1e-2}], ids='+'.join)
def test_without_chance_coefficients_are_exact_and_their_intervals_the_bound(terms, ramp):
    axis = characterize(record_without_chance(terms, ramp), RATE)
    assert axis.goodness_of_fit.acceptable
    assert axis.goodness_of_fit.p_value > 0.9
    assert axis.goodness_of_fit.worst_relative_misfit == 0
    assert axis.band_limit_s is None
    assert seen(axis) - {'rate_ramp'} == set(terms)
    bound = reference_widths(Sensor(RATE, WHOLE / RATE, terms))
    for key, truth in terms.items():
        found = axis.coefficients[key]
        low, high = found.ci95
        # A median lies a little beside the most likely value, and uncertainty widens.
        assert abs(found.value - truth) < 0.08 * bound[key]
        widest = 3 if key == N else 1.5
        assert 0.9 * bound[key] < high - low < widest * bound[key]
    for key in set(bound) - set(terms):
        assert 0.5 * bound[key] < axis.coefficients[key].upper95 < 5 * bound[key]


def test_white_noise_below_strong_quantization_noise_is_found_with_honest_intervals():
    # As of an integrating gyroscope: they cross at 0.9 Hz, within 4096 samples.
    terms = {N: 2e-6, 'quantization_noise': 5e-6}
    axes = simulated(terms, 720_000, 200.0, range(24))
    found = [axis.coefficients[N] for axis in axes]
    assert sum(holds(one, 2e-6) for one in found) >= 21
    assert np.std([np.log(one.value / 2e-6) for one in found]) < 0.03
    assert all(axis.stationarity.steady for axis in axes)


@pytest.mark.parametrize(('terms', 'samples'), [
    ({'quantization_noise': 1.0}, 60_000), ({'quantization_noise': 1.0}, 4_000),
    ({'quantization_noise': 4.8e-6, N: 2e-7}, 120_000)])
def test_nothing_else_is_found_in_quantization_noise(terms, samples):
    records = np.transpose([simulate(terms, samples, 200.0, seed) for seed in range(12)])
    found = results_of(taken_in(records), 200.0)
    assert sum(holds(axis.coefficients['quantization_noise'], terms['quantization_noise'])
               for axis, _ in found) >= 10
    for axis, remarks in found:
        assert seen(axis) <= set(terms)
        # It falls towards low frequencies by itself, and its ends are no drift of the mean.
        assert remarks.keys() <= {'short_record', 'implausible'}


@pytest.mark.parametrize(('key', 'clearly'), [('quantization_noise', 2.5), (B, 6), (K, 20)])
def test_a_term_is_observable_where_it_is_several_standard_errors(key, clearly):
    # Such a square is two standard errors of it.
    unit = reference_widths(Sensor(RATE, WHOLE / RATE, {N: 1e-3}))[key]
    for size, observable in ((0.7, False), (clearly, True)):
        axis = characterize(record_without_chance({N: 1e-3, key: size * unit}), RATE)
        assert axis.coefficients[key].observable == observable


@pytest.mark.parametrize(('samples', 'rate', 'quantity', 'line'), [
    (np.zeros((5, 2)), 100.0, 'angular_velocity',
     'samples must have one dimension, not 2: characterize one axis at a time'),
    *(([1.0, value], 100.0, 'angular_velocity', NOT_FINITE) for value in (np.nan, 1e100)),
    (np.ma.masked_greater([1.0, 9999.0], 2.0), 100.0, 'angular_velocity', NOT_FINITE),
    ([1.0, 2.0j], 100.0, 'angular_velocity', NOT_FINITE),
    ([1.0, 2.0], 0.0, 'angular_velocity',
     'sample_rate_hz must be a number from 1e-30 to 1e+30, not 0'),
    ([1.0, 2.0], 100.0, 'torque',
     "quantity must be 'angular_velocity' or 'linear_acceleration', not 'torque'")])
def test_what_cannot_be_characterized_is_refused(samples, rate, quantity, line):
    with refused(line, ValueError):
        characterize(samples, rate, quantity)


@pytest.mark.parametrize('kind', [np.float16, np.float32, np.int64])
def test_a_rate_may_be_a_number_of_numpy(kind):
    rows = simulate({N: 1e-3}, 5000, kind(200))
    assert np.array_equal(rows, simulate({N: 1e-3}, 5000, 200.0))
    assert characterize(rows, kind(200)).to_dict() == characterize(rows, 200.0).to_dict()


@pytest.mark.parametrize(('crossings', 'least'), [(5, 10), (10, 16)])
def test_the_first_slow_noise_that_shows_is_flicker_and_no_random_walk(crossings, least):
    """Of 120 short records in which flicker had just come into sight 22 had a random walk."""
    count = 36_000
    flicker = 1e-4 * np.sqrt(2 * np.pi * crossings * RATE / count)
    found = [axis.coefficients for axis in simulated(
        {N: 1e-4, B: flicker}, count, RATE, range(3000, 3024))]
    assert sum(own[K].observable for own in found) <= 2
    assert sum(own[B].observable for own in found) >= least


def test_flicker_that_the_prior_takes_for_granted_is_not_reported_beside_a_random_walk():
    """Of 192 records of white noise and a random walk 42 had a false flicker."""
    found = [axis.coefficients for axis in simulated(
        {N: 1e-4, K: 6e-6}, 180_000, RATE, range(4000, 4024))]
    assert sum(own[K].observable for own in found) >= 16
    assert sum(own[B].observable for own in found) <= 1


def test_an_axis_has_the_same_numbers_alone_and_beside_one_with_a_line():
    rng = np.random.default_rng(5)
    filtered = lfilter(*butter(2, 0.15), rng.normal(0, 1, 5000))
    line = rng.normal(0, 1, 5000) + 0.3 * np.sin(0.7 * np.arange(5000))
    alone, beside = Estimator(), Estimator(axes=2)
    alone.update(filtered)
    beside.update(np.column_stack((line, filtered)))
    [one] = fit_axes(alone.finished(), 0.01)
    first, other = fit_axes(beside.finished(), 0.01)
    assert first.lines
    for key, found in one.fit.estimates.items():
        assert vars(other.fit.estimates[key]) == pytest.approx(vars(found), rel=1e-6), key


def test_several_records_have_the_same_numbers_in_any_order():
    rng, fits = np.random.default_rng(8), []
    for _ in range(2):
        estimator = Estimator()
        estimator.update(rng.normal(0, 1, 60_000))
        fits += fit_axes(estimator.finished(), 0.01)
    # The noise of neither changes by the median, but it is less certain of one.
    steady, unsure = sorted(fits, key=lambda one: -one.change.weight[0])
    assert steady.change.typical == unsure.change.typical == 0.0
    one, other = joint_fit([steady, unsure], 0.01), joint_fit([unsure, steady], 0.01)
    for key, found in one.fit.estimates.items():
        assert vars(other.fit.estimates[key]) == pytest.approx(
            vars(found), rel=1e-6, nan_ok=True), key
