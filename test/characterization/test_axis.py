# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The result of an axis: what is reported of the fit, beside the curve and of its two halves."""

from dataclasses import replace
import tracemalloc
import warnings

from characterized import B, characterized, K, messages, N, one_axis, several, streamed, taken_in
from exact_results import axis_of as drifting
from imu_allan.characterization.axis import axis_results, characterize
from imu_allan.characterization.noise_findings import drift_of_halves_findings
from imu_allan.noise.simulate import simulate
from imu_allan.noise.terms import allan_variance, Quantity
from imu_allan.noise.uncertainty import bounded
from imu_allan.result import Backtest, GoodnessOfFit, Innovations, Span
from imu_allan.tuning.backtest import backtest
import numpy as np
import pytest
from repeated import slow
from scipy.signal import butter, lfilter

RATE = 100.0
WHITE = simulate({N: 1e-3}, 300_000, RATE, seed=3)
HALVES_HZ = 10.0
HALF_S = 3600.0


@pytest.mark.parametrize(('numerator', 'denominator', 'width'), [
    (np.ones(2) / 2, [1.0], 2), (np.ones(40) / 40, [1.0], 40), ([0.1], [1.0, -0.9], 57),
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


def axis_of(first, second, steps=118, shorter=None):
    """Return an axis whose halves had these errors over a minute, under each other's model."""
    innovations = shorter or Innovations(10.0, 1.0, 700, (1.0, 1.0)), Innovations(
        60.0, (first + second) / 2, steps, (first, second))
    return drifting(1e-3, backtest=Backtest(HALF_S, HALF_S, innovations, ()))


def test_a_presence_is_a_probability():
    # Weights add up to 1 but for rounding.
    for seed in (2, 11):
        axis = characterize(simulate({N: 1e-3, B: 1e-3}, 20_000, 100.0, seed), 100.0)
        assert axis.coefficients[N].presence == 1.0
        assert all(0 <= found.presence <= 1 for found in axis.coefficients.values())


def test_a_half_that_drifts_more_is_reported_and_the_axis_is_not_steady():
    half = round(HALF_S * HALVES_HZ)
    first, second = (simulate({K: k}, half, HALVES_HZ, seed) for k, seed in ((1e-4, 1), (2e-4, 2)))
    rows = np.full((2 * half, 6), np.nan)
    rows[:, 0] = np.concatenate((first, first[-1] + second - second[0])) + simulate(
        {N: 1e-3}, 2 * half, HALVES_HZ, 1)
    result = streamed([messages(rows, HALVES_HZ, gyro_alone=True)]).result()
    # The segments alone do not see it.
    [seen] = (warning for warning in result.warnings if warning.code == 'not_steady')
    assert (seen.axes, seen.severity, seen.values['higher']) == (('gyro_x',), 'know', 'second')
    assert seen.values['drift_ratio'] == pytest.approx(2.0, abs=0.05)
    assert seen.values['interval_s'] == pytest.approx(61, abs=0.5)
    assert not result.axes['gyro_x'].stationarity.steady


UNCERTAIN, OTHERWISE = axis_of(1.5, 0.7, steps=300), axis_of(0.7, 1.5, steps=300)
LOUD, STEADY = axis_of(4.0, 0.25, steps=10_000), axis_of(1.0, 1.0, steps=10_000)
OVER_10_S = Innovations(10.0, 1.0, 118, (4.0, 0.25))


@pytest.mark.parametrize(('axes', 'over'), [
    # Axes that say the same together are believed where each alone is not.
    ({'gyro_x': UNCERTAIN}, {}),
    (dict.fromkeys(('gyro_x', 'gyro_y', 'gyro_z'), UNCERTAIN),
     dict.fromkeys(('gyro_x', 'gyro_y', 'gyro_z'), 60)),
    ({'gyro_x': UNCERTAIN, 'gyro_y': OTHERWISE, 'accel_z': UNCERTAIN}, {}),
    # What its sensor does is not said of an axis that does not.
    ({'gyro_x': LOUD, 'gyro_y': LOUD, 'gyro_z': STEADY}, {'gyro_x': 60, 'gyro_y': 60}),
    # Where a minute came too seldom a shorter interval speaks, and is not compared with a minute.
    ({'gyro_x': LOUD, 'gyro_y': LOUD, 'gyro_z': axis_of(9.0, 1 / 9, steps=18, shorter=OVER_10_S)},
     {'gyro_x': 60, 'gyro_y': 60, 'gyro_z': 10}),
    # Ratio of variances that F(59, 59) exceeds in .135 %: 2.21, where 3 sigma say 2.18.
    *(({'gyro_x': axis_of(ratio, 1 / ratio)}, over) for ratio, over in (
        (2.20, {}), (2.24, {'gyro_x': 60}))),
    # A difference that nobody cares about, however certain.
    ({'gyro_x': axis_of(1.2, 1 / 1.2, steps=1_000_000)}, {}),
    # The backtest of an older file, and none.
    ({'gyro_x': replace(LOUD, backtest=replace(LOUD.backtest, innovations=(
        Innovations(60.0, 2.1, 118),))), 'gyro_y': replace(LOUD, backtest=None)}, {})])
def test_which_axes_are_said_to_change_and_over_what_time(axes, over):
    found = drift_of_halves_findings(axes)
    assert {name: one.values['interval_s'] for name, one in found.items()} == over


@pytest.mark.slow
@pytest.mark.parametrize('hours', [1 / 6, 1 / 3, 1.0, 3.0])
def test_steady_sensors_are_hardly_ever_reported_to_change(hours):
    """Sixty gyroscopes of three axes of each kind; the intervals of N are no matter here."""
    kinds = [
        {}, {K: 1e-5}, {B: 3e-4},
        *({'gauss_markov': {'sigma': sigma, 'correlation_time_s': time_s}}
          for sigma, time_s in ((2e-3, 10.0), (5e-4, 100.0), (1e-3, 3000.0)))]
    samples, seen = round(3600 * hours * HALVES_HZ), 0
    for terms in kinds:
        for first in range(0, 180, 30):
            records = [simulate({N: 1e-3, **terms}, samples, HALVES_HZ, seed)
                       for seed in range(first, first + 30)]
            series = taken_in(np.transpose(records)).finished().periodogram
            tested = backtest(series.series, series.cell, 1 / HALVES_HZ)
            for at in range(0, len(tested), 3):
                axes = {f'gyro_{letter}': drifting(1e-3, backtest=found)
                        for letter, found in zip('xyz', tested[at:at + 3], strict=True)}
                seen += bool(drift_of_halves_findings(axes))
    # Three axes and their mean, each at .27 %, would be 4 of 360.
    assert seen <= 3
