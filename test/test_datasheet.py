# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0

from dataclasses import replace

from characterized import messages, state_of, streamed
from exact_results import UNSEEN, with_axes, with_coefficient, without
from imu_allan import characterize, result as schema
from imu_allan.datasheet import check, check_state, overall
from imu_allan.finding import finding
from imu_allan.noise.simulate import simulate
from imu_allan.sensor.noise_model import parse_model
from imu_allan.writers.datasheet import summary
import numpy as np
from on_terminal import FLAT
import pytest
from whole_lines import refused, Varying

SIGMA, RATE_HZ = 0.01, 100.0
DENSITY = SIGMA / np.sqrt(RATE_HZ)
WHITE = SIGMA * np.random.default_rng(1).normal(size=(10_000, 6))[:, :3]
NOISE = 'gyro: {x: {noise_density: 1e-3 rad/s/sqrt(Hz)}}'
ZERO_BIAS = 'gyro: {x: {zero_bias: 0.011 rad/s}}'


def only(result, text):
    (verdict,) = check(result, parse_model(text))
    return verdict


def test_an_interval_may_touch_the_limit_and_a_limit_of_zero_has_no_ratio(result):
    none = only(result, 'gyro: {x: {noise_density: 0 deg/sqrt(h)}}')
    assert (none.ratio, none.verdict) == (None, 'fail')
    result = with_coefficient(result, 'gyro_x', 'noise_density', ci95=(1e-4, 5e-4))
    assert only(result, 'gyro: {x: {noise_density: 5e-4 rad/s/sqrt(Hz)}}').verdict == 'pass'


@pytest.mark.parametrize(('bias', 'limit', 'outcome'), [
    # The means of all samples say otherwise of each.
    (-0.021, 0.02, 'fail'), (-0.007, 0.009, 'pass')])
def test_a_zero_bias_is_that_of_the_worst_start(result, bias, limit, outcome):
    means = {name: axis.mean for name, axis in result.axes.items()}
    starts = tuple(schema.RecordingPart(name, None, 3600.0, {**means, 'gyro_x': mean})
                   for name, mean in (('mon', 0.002), ('tue', bias)))
    found = only(replace(result, recordings=starts), f'gyro: {{x: {{zero_bias: {limit} rad/s}}}}')
    assert found.verdict == outcome


@pytest.mark.parametrize(('sigma', 'outcome'), [(1e-6, 'fail'), (2e-3, 'cannot tell')])
def test_a_drift_as_large_as_the_distance_leaves_a_zero_bias_open(result, sigma, outcome):
    drift = schema.DriftModel(1e-6, 0.0, (schema.GaussMarkov(sigma, 3600.0),), 1.0, 3600.0)
    result = with_axes(result, 'gyro_x', mean=0.012, drift_model=drift)
    assert only(result, ZERO_BIAS).verdict == outcome


def test_too_short_a_record_lets_nothing_pass_but_fails_what_fails(result):
    verdicts = check(result, parse_model('gyro: {noise_density: 2.5 deg/sqrt(h)}'),
                     shortest_s=4 * 3600.0)
    assert [one.verdict for one in verdicts] == ['cannot tell', 'fail', 'cannot tell']


@pytest.mark.parametrize(('changed', 'text', 'outcome', 'reason'), [
    # An axis that does not measure fails.
    (lambda r: without(r, 'gyro_x'), NOISE, 'fail',
     'gyro_x N: the axis is missing: the result does not hold it'),
    (lambda r: replace(r, axes={
        **r.axes, 'gyro_x': characterize(np.full(1000, 0.125), 100.0)}), NOISE, 'fail',
     'gyro_x N: the axis is constant'),
    (lambda r: with_axes(replace(r, warnings=(
        finding('constant_axis', ('gyro_x', 'gyro_y'), value=0.125, unit='rad/s'),)), 'gyro_x',
        curve=FLAT), NOISE, 'fail', 'gyro_x N: the axis is constant: every sample is 0.125 rad/s: '
     'there is no noise to measure'),
    (lambda r: with_coefficient(r, 'gyro_x', 'noise_density', value=1e-12,
                                ci95=(0.9e-12, 1.1e-12)), NOISE, 'fail',
     'gyro_x N: the axis is dead: its noise density is 1.1e-12 rad/s/sqrt(Hz) at most, less than '
     'a thousandth of the limit'),
    (lambda r: with_axes(r, 'gyro_x', stood_still=schema.Span(300.0, 58.9)), NOISE, 'fail',
     'gyro_x N: the axis is dead'),
    (lambda r: replace(r, warnings=(finding('frozen', messages=99, since_s=None),)), NOISE, 'fail',
     'gyro_x N: the sensor was dead for a part of the recording: 99 messages repeat one value: '
     'the sensor or its driver stood still, they are left out'),
    # What is not known is no verdict.
    (lambda r: r, ZERO_BIAS, 'pass', 'gyro_x zero bias: the 95 % interval is below 0.011 rad/s'),
    # Of several power-ons it is known no better than they differ.
    (lambda r: replace(r, turn_on_bias={'gyro_x': schema.TurnOnBias(0.002, (0.001, 0.01))}),
     ZERO_BIAS, 'cannot tell',
     'gyro_x zero bias: the 95 % interval reaches across 0.011 rad/s; record for longer'),
    # However long each of them lasts.
    (lambda r: replace(r, turn_on_bias={'gyro_x': schema.TurnOnBias(0.002, (0.001, 0.01))}),
     'gyro: {x: {turn_on_bias: 0.005 rad/s}}', 'cannot tell', 'gyro_x turn-on bias: the 95 % '
     'interval reaches across 0.005 rad/s; record more power-ons'),
    # It was recorded, and changed.
    (lambda r: replace(r, temperature=schema.Signal(60.0, *3 * [(20.0, None, 31.26)])),
     'gyro: {x: {temperature_drift: 36 deg/h/K}}', 'cannot tell', 'gyro_x temperature drift: from '
     '20.0 to 31.3 degrees Celsius no dependence shows; change it by more'),
    (lambda r: with_axes(r, 'gyro_x', goodness_of_fit=schema.GoodnessOfFit(1e-9, 0.8, False)),
     NOISE, 'cannot tell', 'gyro_x N: the noise model does not fit this axis'),
    (lambda r: replace(r, warnings=(finding('several_publishers'),)), NOISE, 'cannot tell',
     'gyro_x N: neighbouring messages differ in turn: two sensors that publish with one frame_id, '
     'or a vibration at half the message rate'),
    (lambda r: replace(r, warnings=(finding('several_publishers'),)), ZERO_BIAS, 'pass',
     'gyro_x zero bias: the 95 % interval is below 0.011 rad/s'),
    # The other sensor is not concerned.
    (lambda r: replace(r, warnings=(finding('interpolated', topic='/imu', half='accel'),)),
     NOISE, 'pass', 'gyro_x N: the 95 % interval is below 1e-3 rad/s/sqrt(Hz)'),
    (lambda r: with_coefficient(r, 'gyro_x', 'noise_density', **UNSEEN, upper95=1e-3), ZERO_BIAS,
     'cannot tell', 'gyro_x zero bias: the noise density does not show, and with it what the mean '
     'is worth; record for longer'),
    *((lambda r: with_axes(r, 'gyro_x', high_passed_hz=0.1, coarse_step=0.1), text, 'cannot tell',
       f'gyro_x {what}: a filter has taken out the slow part of this axis; record the raw topic')
      for text, what in ((NOISE, 'N'), (ZERO_BIAS, 'zero bias')))])
def test_a_dead_axis_fails_and_the_unknown_is_no_verdict(result, changed, text, outcome, reason):
    verdict = only(changed(result), text)
    assert (verdict.verdict, verdict.reason) == (outcome, reason)


# gyro_x: N = 7.0e-4 rad/s/sqrt(Hz) = 2.4064 deg/sqrt(h), interval 2.4016 .. 2.4112.
# Means of the fixture: 0.01 but on accel z, which measures exactly 1 g.
@pytest.mark.parametrize(('text', 'outcome', 'reason'), [
    *((f'gyro: {{x: {{noise_density: {limit}}}}}', outcome,
       f'gyro_x N: the 95 % interval {where}') for limit, outcome, where in (
        ('2.5 deg/sqrt(h)', 'pass', 'is below 2.5 deg/sqrt(h)'),
        ('2.3 deg/sqrt(h)', 'fail', 'is above 2.3 deg/sqrt(h)'),
        ('0.042 deg/s/sqrt(Hz)', 'pass', 'is below 0.042 deg/s/sqrt(Hz)'),
        ('7e-4 rad/s/sqrt(Hz)', 'cannot tell',
         'reaches across 7e-4 rad/s/sqrt(Hz); record for longer'))),
    ('gyro: {x: {zero_bias: 0.5 deg/s}}', 'fail',
     'gyro_x zero bias: the 95 % interval is above 0.5 deg/s'),
    ('accel: {z: {zero_bias: 5 mg, mean: 1 g}}', 'pass',
     'accel_z zero bias: the 95 % interval is below 5 mg'),
    ('accel: {z: {zero_bias: 5 mg}}', 'fail',
     'accel_z zero bias: the 95 % interval is above 5 mg; if that is gravity, write accel: '
     '{z: {mean: 1 g}}'),
    # A mean of 0.01 m/s^2 is no gravity.
    ('accel: {x: {zero_bias: 0.1 mg}}', 'fail',
     'accel_x zero bias: the 95 % interval is above 0.1 mg'),
    ('gyro: {x: {temperature_drift: 36 deg/h/K}}', 'cannot tell', 'gyro_x temperature drift: the '
     'result knows no dependence on temperature; record the temperature while it changes'),
    ('gyro: {x: {turn_on_bias: 36 deg/h}}', 'cannot tell', 'gyro_x turn-on bias: one power-on '
     'does not show it; analyze several recordings with --together'),
    ('gyro: {z: {rate_random_walk: 1.8e-6 rad/s^2/sqrt(Hz)}}', 'cannot tell',
     'gyro_z K: not observable in this recording; record for longer'),
    ('gyro: {z: {rate_random_walk: 1 rad/s^2/sqrt(Hz)}}', 'pass', 'gyro_z K: not observable, and '
     'with 95 % confidence below 1 rad/s^2/sqrt(Hz)')])
def test_the_interval_decides_of_every_quantity_and_in_any_unit(result, text, outcome, reason):
    verdict = only(result, text)
    assert (verdict.verdict, verdict.reason) == (outcome, reason)


@pytest.mark.parametrize(('interval', 'outcome'), [
    ((-3e-9, -2e-9), 'fail'), ((-3e-10, -2e-10), 'pass'), ((-2e-9, 1e-10), 'cannot tell')])
def test_a_falling_ramp_counts_as_much_as_a_rising_one(result, interval, outcome):
    value = sum(interval) / 2
    result = with_coefficient(result, 'gyro_x', 'rate_ramp', observable=True, value=value,
                              ci95=interval, upper95=None)
    verdict = only(result, 'gyro: {x: {rate_ramp: 1e-9 rad/s^2}}')
    assert (verdict.verdict, verdict.value) == (outcome, abs(value))


def test_one_failure_fails_the_sensor_and_one_undecided_limit_keeps_it_from_passing(result):
    for text, each, outcome, said in (
            ('noise_density: 9 deg/sqrt(h)', ['pass'] * 3, 'pass', []),
            ('noise_density: 3 deg/sqrt(h), rate_random_walk: 70 deg/h/sqrt(h)',
             [*['pass'] * 3, 'cannot tell', *['pass'] * 2], 'cannot tell',
             ['gyro_y K: the 95 % interval reaches across 70 deg/h/sqrt(h); record for longer '
              '(measured 54, 38 .. 71)']),
            ('noise_density: 2.5 deg/sqrt(h), zero_bias: 1 deg/s',
             ['pass', 'pass', 'fail', 'pass', 'pass', 'pass'], 'fail',
             ['gyro_y N: the 95 % interval is above 2.5 deg/sqrt(h) (measured 2.647, 2.642 .. '
              '2.652)'])):
        verdicts = check(result, parse_model(f'gyro: {{{text}}}'))
        assert ([one.verdict for one in verdicts], overall(verdicts), summary(verdicts)) == (
            each, outcome, (outcome, said))


def test_a_specification_without_a_limit_is_refused(result):
    with refused('the specification limits no coefficient; write for instance gyro: '
                 '{noise_density: 0.03 deg/s/sqrt(Hz)}'):
        check(result, parse_model('gyro: {mean: 1 deg/s}'))


def stream_of(samples, rate_hz=RATE_HZ):
    rows = np.full((len(samples), 6), np.nan)
    rows[:, :samples.shape[1]] = samples
    return streamed([messages(rows, rate_hz, gyro_alone=True)])


def verdicts_of(step, limit, rounded=np.round, mean=0.0, key='noise_density'):
    """Return the verdict on gyro_x with a step in its noise and a limit in its density."""
    rows = WHITE + np.array([mean, 0, 0])
    rows[:, 0] = step * SIGMA * rounded(rows[:, 0] / (step * SIGMA))
    stream = stream_of(rows)
    unit = {'noise_density': 'rad/s/sqrt(Hz)', 'bias_instability': 'rad/s'}[key]
    model = parse_model(f'gyro: {{x: {{{key}: {limit * DENSITY} {unit}}}}}')
    (said,), (live,) = check(stream.result(), model), state_of(stream, model).verdicts
    assert live.verdict == said.verdict
    return said


def test_what_is_cut_towards_zero_does_not_pass_below_what_it_can_show():
    found = verdicts_of(1.54, 0.7, np.trunc)
    assert found.verdict == 'cannot tell'
    assert found.reason == Varying(
        'gyro_x N: the output steps by <number> rad/s, <number> times the noise of one sample, '
        'and hides what is limited; record with a finer resolution')
    assert verdicts_of(1.54, 3.0, np.trunc).verdict == 'pass'
    # The jumps of a tenth of the samples are no slow noise.
    assert verdicts_of(1.54, 1.0, np.trunc, key='bias_instability').verdict == 'cannot tell'


def test_noise_above_half_a_step_is_judged_as_any():
    for step, limit, mean, outcome in (
            (1.5, 0.7, 0.3, 'fail'), (1.5, 1.3, 0.3, 'pass'), (0.5, 0.7, 0.0, 'fail'),
            # Beyond what steps can make of nothing, a limit is broken whatever they hide.
            (1.5, 0.3, 0.0, 'fail')):
        assert verdicts_of(step, limit, mean=mean).verdict == outcome


def test_a_random_walk_that_may_level_off_fails_no_unit_on_the_bench():
    """Of a process of a minute the record says no more than a bound for the random walk."""
    stream = stream_of(np.column_stack([simulate(
        {'noise_density': 7.9e-5, 'bias_instability': 2.4e-5,
         'gauss_markov': {'sigma': 7.2e-5, 'correlation_time_s': 60.0}}, 25_000, 10.0, seed)
        for seed in (0, 1)]), 10.0)
    limit = '{rate_random_walk: 4.0e-6 rad/s^2/sqrt(Hz)}'
    found = state_of(stream, parse_model(f'gyro: {{x: {limit}, y: {limit}}}')).verdicts
    for name, axis in stream.result().axes.items():
        assert axis.coefficients['rate_random_walk'].upper95 is not None, name
    assert [one.verdict for one in found] == ['cannot tell'] * 2


def test_an_undecided_mean_stays_open_beside_a_finding_about_the_noise_alone():
    result, record = stream_of(WHITE).fitted()
    mean = abs(result.axes['gyro_x'].mean)
    model = parse_model(f'gyro: {{x: {{zero_bias: {mean} rad/s}}}}')
    for warnings in (), (finding('interpolated', topic='/imu', half='gyro'),):
        state = check_state(replace(result, warnings=warnings), [record], model)
        assert (state.decided, state.verdicts[0].verdict) == (False, 'cannot tell')
