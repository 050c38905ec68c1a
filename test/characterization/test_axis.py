# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The result of an axis: what is reported of the fit, beside the curve and of its two halves."""

import tracemalloc
import warnings

from characterized import B, characterized, ends, K, N, one_axis, several, taken_in
from imu_allan.characterization.axis import axis_results, characterize
from imu_allan.noise.simulate import simulate
from imu_allan.noise.terms import allan_variance, Quantity
from imu_allan.noise.uncertainty import bounded
from imu_allan.result import GoodnessOfFit, Span
import numpy as np
import pytest
from repeated import slow
from scipy.signal import butter, lfilter

RATE = 100.0
WHITE = simulate({N: 1e-3}, 300_000, RATE, seed=3)
HALVES_HZ = 10.0
HALF_S = 3600.0


@pytest.mark.parametrize(('numerator', 'denominator', 'width'), [
    (np.ones(2) / 2, [1.0], 2), (np.ones(40) / 40, [1.0], 40), ([0.1], [1.0, -0.9], 33),
    (*butter(2, 0.4), 2)])
def test_model_behind_a_low_pass_is_exact_at_every_averaging_time(numerator, denominator, width):
    axis = characterize(lfilter(numerator, denominator, WHITE)[200:], RATE)
    assert axis.band_limit_s == pytest.approx(width / RATE, rel=0.15)
    response = lfilter(numerator, denominator, np.eye(1, 200)[0])
    for size, model in zip(2 ** np.arange(10), axis.curve.model_adev, strict=False):
        difference = np.repeat([-1.0, 1.0], size) / size
        exact = 1e-3 * np.sqrt(RATE / 2) * np.linalg.norm(np.convolve(difference, response))
        assert model == pytest.approx(exact, rel=0.06)


def reported_avar(axis):
    values = {key: found.value for key, found in axis.coefficients.items() if found.observable}
    return allan_variance(values, np.array(axis.curve.tau_s))


def test_model_is_that_of_the_coefficients_and_describes_the_curve():
    model = {N: 1e-3, B: 3e-3, K: 3e-3}
    axis = characterize(simulate(model, 300_000, RATE, seed=3), RATE)
    assert axis.coefficients[K].observable
    np.testing.assert_allclose(np.array(axis.curve.model_adev)**2, reported_avar(axis))
    adev, model_adev = np.array([axis.curve.adev, axis.curve.model_adev])[
        :, np.array(axis.curve.edf) > 300]
    np.testing.assert_allclose(model_adev, adev, rtol=0.1)
    without = bounded(axis)
    assert not without.coefficients[K].observable
    np.testing.assert_allclose(np.array(without.curve.model_adev)**2, reported_avar(without))


def test_what_is_worth_telling_has_its_code():
    assert characterized(WHITE, RATE)[1] == {}
    [(code, said)] = characterized(lfilter(np.ones(8) / 8, [1.0], WHITE), RATE)[1].items()
    assert (code, list(said)) == ('band_limited', ['window_s'])
    steps = characterized(np.round(WHITE / 0.03) * 0.03, RATE)[1]
    assert steps['coarse_resolution'] == {
        'step': pytest.approx(0.03), 'unit': 'rad/s', 'ratio': pytest.approx(3.0, rel=0.1)}
    axis, words = characterized(np.cumsum(np.cumsum(WHITE)), RATE)
    assert 'poor_fit' in words
    assert not axis.goodness_of_fit.acceptable


def test_the_misfit_of_a_ramp_without_noise_is_no_number():
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter('always')
        characterize(1e-3 * np.arange(60_000) / RATE, RATE)
    words = 'poor_fit: no sum of noise terms comes within a factor of ten of this spectrum. -> '
    assert words in [str(one.message)[:len(words)] for one in warned]


@pytest.mark.parametrize('count', [5000, 60_000])
@pytest.mark.parametrize('rate', [1.0, 137.0, 1000.0])
def test_a_result_scales_with_the_unit_of_time(rate, count):
    noise = simulate({N: 1e-3, B: 3e-3, K: 1e-3}, count, RATE, seed=5)
    # Noise that grows counts less, band by band.
    for samples in noise, noise * np.linspace(1.0, 2.0, count):
        one, other = (characterized(samples, hz)[0].coefficients for hz in (RATE, rate))
        for key, power in ((N, -0.5), (B, 0.0), (K, 0.5)):
            np.testing.assert_allclose(ends(other[key]), (rate / RATE)**power * np.array(
                ends(one[key])), rtol=1e-9)


@pytest.mark.parametrize('period', [
    [0, 1], [0, 1, 0, -1], np.sin(np.arange(8) * np.pi / 4), np.arange(37)])
@pytest.mark.parametrize('count', [2000, 60_000])
def test_samples_that_repeat_exactly_are_no_noise(period, count):
    axis, _ = characterized(np.resize(1e-3 * np.array(period), count), RATE)
    assert not axis.goodness_of_fit.acceptable


@pytest.mark.parametrize(('step', 'severity'), [(0.015, 'know'), (0.03, 'act'), (0.1, 'act')])
def test_steps_that_falsify_the_noise_density_are_a_warning_of_python(step, severity):
    # Midway between two steps even the smallest noise is output as half a step.
    output = np.floor(WHITE / step) * step
    [(axis, [said])] = axis_results(
        taken_in(output).finished(), RATE, [Quantity.ANGULAR_VELOCITY])
    assert (said.code, said.severity) == ('coarse_resolution', severity)
    far_off = axis.coefficients[N].value > 1.2e-3
    assert far_off == (severity == 'act')
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter('always')
        characterize(output, RATE)
    assert [(one.category, str(one.message).partition(':')[0]) for one in warned] == [
        (UserWarning, 'coarse_resolution')] * far_off


@pytest.mark.parametrize('samples', [np.full(1000, 2.0), [], [1.0], WHITE[:2], WHITE[:40],
                                     np.arange(63) % 3 * 1.0])
def test_an_axis_that_is_constant_or_too_short_has_a_curve_at_most(samples):
    axis, remarks = characterized(samples, RATE)
    constant = len({*samples}) == 1
    assert remarks == ({'constant_axis': {'value': samples[0], 'unit': 'rad/s'}} if constant
                       else {})
    assert len(axis.curve.tau_s) == max(len(samples), 1).bit_length() - 1
    assert all(low <= at <= high for at, (low, high) in zip(
        axis.curve.adev, axis.curve.ci95, strict=True))
    assert {0.0}.issuperset(axis.curve.adev) == (constant or not len(samples))
    assert {0.0}.issuperset(axis.curve.model_adev)
    assert axis.mean == (pytest.approx(np.mean(samples)) if len(samples) else None)
    assert (axis.spectrum, axis.drift_model) == (None, None)
    assert axis.goodness_of_fit == GoodnessOfFit(None, None, False)
    assert not any(one.observable or one.value or one.upper95
                   for one in axis.coefficients.values())


@pytest.mark.parametrize(('lengths', 'settled', 'before'), [
    (range(20_000, 30_000, 1000), 6, 8), slow(range(30_000, 60_000, 500), 10, 40)])
def test_fits_of_a_growing_record_hold_no_memory(lengths, settled, before):
    # Beside a driver for days, every fit is one of a record of another length.
    estimator, kept = taken_in(WHITE[:lengths.start]), []
    tracemalloc.start()
    for begin in lengths:
        estimator.update(WHITE[begin:begin + lengths.step])
        one_axis(estimator, RATE)
        kept.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    # One array of each length, kept, would be 0.8 MB.
    assert max(kept[before:]) < max(kept[settled:before]) + 500_000


@pytest.mark.parametrize(('start', 'stop'), [(0, 20_000), (50_000, 50_600)])
@pytest.mark.filterwarnings('error')
def test_an_axis_that_stood_still_for_a_while_has_no_coefficients(start, stop):
    samples = WHITE[:60_000].copy()
    samples[start:stop] = 0.25
    axis, remarks = characterized(samples, RATE)
    # To a column of the signal over time, 128 samples, on either side.
    assert remarks == {'stood_still': {
        'start_s': pytest.approx(start / RATE, abs=1.28),
        'duration_s': pytest.approx((stop - start) / RATE, abs=2.56)}}
    assert axis.stood_still == Span(**remarks['stood_still'])
    assert not any(found.observable for found in axis.coefficients.values())
    assert axis.goodness_of_fit == GoodnessOfFit(None, None, False)


def test_the_model_describes_records_of_a_hundred_samples():
    records = [simulate({N: 1e-3, B: 1e-4}, 100, RATE, seed) for seed in range(60)]
    misfits = [axis.goodness_of_fit.acceptable is False for axis in several(records, RATE)]
    assert np.mean(misfits) <= 0.05


def test_a_presence_is_a_probability():
    # Weights add up to 1 but for rounding.
    for seed in (2, 11):
        axis = characterize(simulate({N: 1e-3, B: 1e-3}, 20_000, 100.0, seed), 100.0)
        assert axis.coefficients[N].presence == 1.0
        assert all(0 <= found.presence <= 1 for found in axis.coefficients.values())
