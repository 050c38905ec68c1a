# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace

from imu_allan import characterize, simulate
from imu_allan.characterization import Characterization
from imu_allan.characterization.joint import joint_result
from imu_allan.characterization.power_ons import turn_on_bias
from imu_allan.noise.simulate import flicker
from imu_allan.noise.terms import SLOW_TERMS
from imu_allan.noise.uncertainty import widened_interval
from imu_allan.sensor.noise_model import parse_model
from imu_allan.sensor.simulated_imu import simulated_blocks
from imu_allan.writers.datasheet import check
from imu_allan.writers.datasheet.live import check_state
import numpy as np
import pytest
from repeated import slow
from scipy.signal import butter, lfilter, sosfilt
from whole_lines import refused, Varying

RATE_HZ = 50.0
SAMPLES = 10_000


def recorded(path, seed, *, model='noise_density: 0.005 deg/s/sqrt(Hz)', rate_hz=RATE_HZ,
             samples=SAMPLES, changed=lambda block: block, gyro_alone=False, axes=(0, 1, 3)):
    """
    Take in a gyroscope, its accelerometer, if it has one, being noise about gravity.

    Nearly all of the time goes into the fits of the axes: only some have values.
    """
    stream = Characterization(kind='recording', path=path, topic='/imu')
    whole = parse_model(f'gyro: {{{model}}}\n' + (
        '' if gyro_alone else 'accel: {noise_density: 100 ug/sqrt(Hz), z: {mean: 1 g}}'))
    there = np.isin(np.arange(6), axes)
    for block in simulated_blocks(whole, rate_hz, samples, seed=seed):
        stream.update(changed(replace(block, samples=np.where(there, block.samples, np.nan))))
    return stream


def altered(change):
    """Give what changes the samples of a block, which it gets with the stamps."""
    def changed(block):
        samples = block.samples.copy()
        change(samples, block.header_ns)
        return replace(block, samples=samples)

    return changed


def in_first_axis(change):
    """Give what changes the samples of the first axis of a block."""
    def of_rows(rows, _):
        rows[:, 0] = change(rows[:, 0])

    return altered(of_rows)


@pytest.fixture(scope='module')
def nights():
    """Four recordings of one IMU, whose zero bias is another after each power-on."""
    return [recorded(f'night{seed}', seed, model='noise_density: 0.005 deg/s/sqrt(Hz), '
                     f'rate_random_walk: 40 deg/h/sqrt(h), mean: {bias} deg/h')
            for seed, bias in ((1, 400), (2, -300), (3, 100), (4, -50))]


@pytest.fixture(scope='module')
def joint(nights):
    return joint_result(nights)


def said(result, code):
    return [remark for remark in result.warnings if remark.code == code]


def width(result, key):
    found = result.axes['gyro_x'].coefficients[key]
    return (found.ci95[1] - found.ci95[0]) / found.value


def test_a_step_that_is_reported_in_one_recording_bounds_the_random_walk_of_all():
    @altered
    def stepped(rows, stamps):
        rows[stamps > 4000e9, 0] += 2.4e-4

    model = ('noise_density: 0.0045 deg/s/sqrt(Hz), bias_instability: 5 deg/h, '
             'rate_random_walk: 54 deg/h/sqrt(h)')
    found = joint_result([recorded(path, seed, model=model, rate_hz=4.0, samples=28_800,
                                   gyro_alone=True, **more)
                          for path, seed, more in (('knocked', 1, {'changed': stepped}),
                                                   ('still', 2, {}))])
    walk = found.axes['gyro_x'].coefficients['rate_random_walk']
    assert (walk.ci95[1] if walk.ci95 else walk.upper95) > np.deg2rad(54 / 3600 / 60)
    step, = (remark.values for remark in said(found, 'bias_step') if 'gyro_x' in remark.axes)
    assert (step['recording'], step['size'], step['after_s']) == (
        'knocked', pytest.approx(2.4e-4, rel=0.3), pytest.approx(4000, abs=40))


def test_four_recordings_know_twice_as_well_as_one(nights, joint):
    single = nights[0].result()
    assert width(joint, 'noise_density') == pytest.approx(width(single, 'noise_density') / 2,
                                                          rel=0.25)
    low, high = joint.axes['gyro_x'].coefficients['noise_density'].ci95
    assert low < 0.005 * 0.017453292519943295 < high
    assert joint.timeline.samples == 4 * SAMPLES
    assert joint.timeline.duration_s == pytest.approx(4 * SAMPLES / RATE_HZ, rel=1e-3)
    assert said(joint, 'recordings_disagree') == []
    assert joint.axes['gyro_x'].coefficients['noise_density'].between < 1e-6


def test_the_result_holds_what_it_was_made_of(nights, joint):
    assert [part.path for part in joint.recordings] == [f'night{seed}' for seed in range(1, 5)]
    assert joint.recordings[1].means['gyro_y'] == nights[1].result().axes['gyro_y'].mean
    assert joint.source.path == 'night1 + night2 + night3 + night4'
    assert type(joint).from_dict(joint.to_dict()) == joint


def test_the_means_spread_from_one_power_on_to_the_next(joint):
    # 400, -300, 100 and -50 deg/h.
    sigma = float(np.std([400, -300, 100, -50], ddof=1)) * 4.848136811e-6
    for axis in ('gyro_x', 'gyro_y'):
        found = joint.turn_on_bias[axis]
        assert found.sigma == pytest.approx(sigma, rel=0.1)
        assert found.ci95[0] < sigma < found.ci95[1]
    assert joint.turn_on_bias['accel_x'].ci95[0] == 0.0
    remarks = said(joint, 'turn_on_bias')
    assert [one.axes for one in remarks] == [('gyro_x',), ('gyro_y',)]
    for one in remarks:
        bias = joint.turn_on_bias[one.axes[0]]
        assert (one.values['sigma'], one.values['sigma_low'], one.values['sigma_high']) == (
            bias.sigma, *bias.ci95)


def test_the_order_of_the_recordings_does_not_matter(nights, joint):
    other = joint_result(nights[::-1])
    for name, axis in joint.axes.items():
        for key, found in axis.coefficients.items():
            twin = other.axes[name].coefficients[key]
            assert twin.observable == found.observable
            assert (twin.value or 0.0) == pytest.approx(found.value or 0.0, rel=1e-3)


def test_a_recording_that_contradicts_the_others_is_named(nights):
    noisy = recorded('after', 9, model='noise_density: 0.006 deg/s/sqrt(Hz)')
    found = joint_result([*nights[:3], noisy])
    remarks = said(found, 'recordings_disagree')
    assert [one.axes for one in remarks] == [('gyro_x',), ('gyro_y',)]
    for one in remarks:
        assert (one.values['coefficient'], one.values['of_recording']) == (
            'noise_density', 'after')
        assert one.values['value'] / one.values['usual_value'] == pytest.approx(1.2, abs=0.02)
    between = found.axes['gyro_x'].coefficients['noise_density'].between
    assert between / found.axes['gyro_x'].coefficients['noise_density'].value > 0.05


def test_a_recording_whose_parts_contradict_each_other_is_reported_and_widens_the_interval():
    @altered
    def louder(rows, stamps):
        rows[stamps > 600e9, 0] *= 1.5

    def night(seed, **more):
        return recorded(f'night{seed}', seed, samples=60_000, gyro_alone=True, **more)

    result = joint_result([night(13, changed=louder), night(12)])
    plain = joint_result([night(11), night(12)])
    assert [(one.values['recording'], one.axes) for one in said(result, 'not_steady')] == [
        ('night13', ('gyro_x',))]
    assert width(result, 'noise_density') > 3 * width(plain, 'noise_density')
    assert not result.axes['gyro_x'].stationarity.steady
    assert result.axes['gyro_y'].stationarity.steady
    # The segments of the second night begin where the first one ends.
    starts = np.array([segment.start_s for segment in
                       result.axes['gyro_x'].stationarity.segments])
    assert (np.diff(starts) > 0).all()
    assert 0.4 < np.mean(starts > 0.999 * 1200) < 0.6


@pytest.mark.parametrize(('changed', 'fault', 'code'), [
    (lambda x: np.minimum(x, 0.0), 'saturated', 'saturated'),
    (lambda x: np.where(np.arange(len(x)) < SAMPLES // 4, x, x[0]), 'dead', 'stood_still'),
    (lambda x: np.full_like(x, 0.25), 'dead', 'constant_axis')])
def test_an_axis_at_fault_in_one_recording_is_at_fault_and_its_numbers_are_of_the_others(
        changed, fault, code):
    good = recorded('good', 1, gyro_alone=True)
    bad = recorded('bad', 2, changed=in_first_axis(changed), gyro_alone=True)
    found = joint_result([bad, good])
    axis, alone = found.axes['gyro_x'], good.result().axes['gyro_x']
    assert axis.fault == fault
    assert axis.mean == pytest.approx(alone.mean)
    assert axis.curve.adev[0] == pytest.approx(alone.curve.adev[0])
    assert axis.coefficients['noise_density'].value == pytest.approx(
        alone.coefficients['noise_density'].value, rel=1e-3)
    assert found.axes['gyro_y'].fault is None
    assert [(one.values['recording'], one.axes) for one in said(found, code)] == [
        ('bad', ('gyro_x',))]
    # Its mean is none of a power-on.
    assert 'gyro_x' not in found.turn_on_bias
    assert 'gyro_y' in found.turn_on_bias
    verdicts = check(found, parse_model('gyro: {x: {noise_density: 0.02 deg/s/sqrt(Hz)}, '
                                        'y: {noise_density: 0.02 deg/s/sqrt(Hz)}}'))
    assert {one.axis for one in verdicts if one.verdict == 'fail'} == {'gyro_x'}


@pytest.mark.parametrize(('terms', 'samples', 'apart'), [
    # As far apart as a random walk too small to show brings two means of ten minutes: twice that.
    ({'noise_density': 1e-3, 'rate_random_walk': 3e-5}, 60_000, 2 * 3e-5 * np.sqrt(2 * 600 / 3)),
    ({'noise_density': 1.0}, 20_000, 0.1)])
def test_a_mean_that_only_wanders_is_no_turn_on_bias(terms, samples, apart):
    axis = characterize(simulate(terms, samples, 100.0, seed=31), 100.0)
    assert not axis.coefficients['rate_random_walk'].observable
    spans = [samples / 100.0] * 2
    assert turn_on_bias([0.0, apart], axis, spans).ci95[0] == 0.0
    assert turn_on_bias([0.0, 100 * apart], axis, spans).ci95[0] > 0.0


@altered
def smoothed(rows, _):
    rows[1:] = (rows[1:] + rows[:-1]) / 2


@pytest.mark.parametrize(('other', 'complaint'), [
    ({'rate_hz': 60.0}, 'other: sampled at 60 Hz, night1 at 50 Hz; analyze recordings of '
     'different rates apart'),
    ({'changed': lambda block: replace(block, frame_id='imu_2')},
     "other: frame 'imu_2', but 'imu_link' in night1; analyze different IMUs apart"),
    ({'changed': lambda block: replace(block, absent=block.absent | np.array([False, True]))},
     'other: axes gyro_x, gyro_y, but gyro_x, gyro_y, accel_x in night1; analyze them apart'),
    ({'changed': smoothed}, Varying(
        'other: gyro_x falls by another low-pass than in night1 (noise at the fast end -<number> '
        '%); analyze different settings apart'))])
def test_what_cannot_be_one_series_is_refused(nights, other, complaint):
    with refused(complaint):
        joint_result([nights[0], recorded('other', 5, **other)])


def beside(path, seed, exponent, crossing_hz=1.0, samples=40_000, **more):
    """Record white noise and a power law that is as strong at a frequency, in all gyroscopes."""
    density = 0.005 * np.pi / 180
    size = density * np.sqrt(RATE_HZ * (2 * np.pi * crossing_hz / RATE_HZ)**exponent)
    slow = size * np.stack([flicker(samples, np.random.default_rng([seed, axis]), exponent)
                            for axis in range(3)], axis=1)
    begin = 0

    @altered
    def changed(rows, _):
        nonlocal begin
        rows[:, :3] += slow[begin:begin + len(rows)]
        begin += len(rows)

    return recorded(path, seed, samples=samples, changed=changed, **more)


def test_where_slow_noise_has_another_exponent_in_each_what_they_share_is_reported():
    joint = joint_result([beside('one', 1, 0.6), beside('other', 2, 1.3)])
    remarks = said(joint, 'power_law')
    assert [one.axes for one in remarks] == [('gyro_x',), ('gyro_y',)]
    assert all(one.values['recordings'] == ['one', 'other'] for one in remarks)
    assert all(one.values['density_is_mean'] for one in remarks)
    for axis in ('gyro_x', 'gyro_y'):
        found = joint.axes[axis]
        low, high = found.coefficients['noise_density'].ci95
        assert low < 0.005 * np.pi / 180 < high
        assert found.power_law is None
        assert not found.goodness_of_fit.acceptable
        assert found.coefficients['bias_instability'].value is None
        assert not any(found.curve.model_adev)
    assert joint.axes['accel_x'].coefficients['noise_density'].observable
    assert any(joint.axes['accel_x'].curve.model_adev)


def test_slow_noise_of_another_exponent_is_not_taken_for_a_low_pass(nights):
    # It reaches to the fast end.
    joint = joint_result([nights[0], beside('other', 5, 0.7, 25.0)])
    assert [(one.axes, one.values['exponents'][0]) for one in said(joint, 'power_law')] == [
        ((f'gyro_{letter}',), None) for letter in 'xy']


def test_a_low_pass_beside_slow_noise_of_another_exponent_is_refused():
    rng = np.random.default_rng(9)
    sigma = 0.0025 * np.pi / 180 * np.sqrt(RATE_HZ)

    @altered
    def cut(rows, _):
        # Noise behind a steep low-pass: the band has an edge, and no window describes it.
        rows[:, :3] = sosfilt(butter(2, 0.1, output='sos'), rows[:, :3], axis=0)
        rows[:, :3] += sigma * rng.standard_normal((len(rows), 3))

    low_passed = recorded('cut', 3, changed=cut, gyro_alone=True)
    axis = low_passed.result().axes['gyro_x']
    assert axis.band_limit_s is not None
    with refused(Varying('cut: gyro_x falls by another low-pass than in other (noise at the fast '
                         'end -<number> %); analyze different settings apart')):
        joint_result([beside('other', 5, 0.7, 1.0, gyro_alone=True), low_passed])


def filtered(path, seed, gain, **more):
    """Record behind imu_complementary_filter, which subtracts a bias that follows the rate."""
    state = np.zeros((1, 3))

    @altered
    def subtracted(rows, _):
        # bias += gain * (sample - bias), of the samples before.
        bias, state[:] = lfilter([0, gain], [1, gain - 1], rows[:, :3], axis=0, zi=state)
        rows[:, :3] -= bias

    return recorded(path, seed, changed=subtracted, **more)


@pytest.mark.parametrize('order', [1, slow(-1)])
def test_recordings_of_which_a_filter_has_changed_some_are_refused(nights, order):
    with refused('behind: a filter has taken out the slow part of gyro_x, which is not certain in '
                 'night1; analyze the raw topic of each'):
        joint_result([nights[0], filtered('behind', 5, 0.02)][::order])


@pytest.mark.parametrize('gain', [slow(0.05), 0.1])
def test_recordings_that_all_went_through_filters_tell_nothing_of_their_axes(gain):
    result = joint_result([filtered('a', 1, 0.02), filtered('b', 2, gain)])
    assert [one.axes for one in said(result, 'high_passed')] == [('gyro_x',), ('gyro_y',)]
    for name in ('gyro_x', 'gyro_y'):
        axis = result.axes[name]
        assert axis.high_passed_hz is not None
        assert not any(axis.coefficients[key].observable for key in SLOW_TERMS)
    # What the filter left of a mean is no turn-on bias.
    assert set(result.turn_on_bias) == {'accel_x'}


@pytest.mark.parametrize('low', [0.0, 0.5])
def test_parts_that_contradict_each_other_widen_an_interval_that_begins_at_zero(joint, low):
    flicker = replace(joint.axes['gyro_x'].coefficients['bias_instability'], observable=True,
                      value=1.0, ci95=(low, 1.5))
    low_end, high_end = widened_interval(flicker, variance=0.18).ci95
    assert high_end == pytest.approx(np.exp(np.hypot(np.log(1.5), 1.96 * 0.18**0.5)), rel=1e-3)
    assert low_end == (low and pytest.approx(np.exp(-np.hypot(np.log(2), 1.96 * 0.18**0.5)),
                                             rel=1e-3))


def test_one_recording_or_an_empty_one_is_no_joint_result(nights):
    with refused('a joint result needs at least two recordings'):
        joint_result(nights[:1])
    empty = Characterization(kind='recording', path='empty', topic='/imu')
    with refused('empty: holds no usable sample; leave it out'):
        joint_result([nights[0], empty])


def test_a_moment_without_one_sensor_in_one_recording_costs_nothing():
    @altered
    def holed(rows, _):
        rows[100:200, :3] = np.nan

    streams = [recorded('whole', 1), recorded('holed', 2, changed=holed)]
    joint = joint_result(streams)
    assert list(joint.axes) == ['gyro_x', 'gyro_y', 'accel_x']
    both = joint_result([streams[0], recorded('whole too', 2)])
    for name in ('gyro_x', 'accel_x'):
        found, expected = (result.axes[name].coefficients['noise_density'].ci95
                           for result in (joint, both))
        np.testing.assert_allclose(found, expected, rtol=0.02)
    limits = parse_model('gyro: {x: {noise_density: 0.01 deg/s/sqrt(Hz)}, '
                         'y: {noise_density: 0.01 deg/s/sqrt(Hz)}}\n'
                         'accel: {x: {noise_density: 200 ug/sqrt(Hz)}}')
    look = check_state(streams[1], limits, result=streams[1].result())
    assert look.decided
    assert {verdict.axis: verdict.verdict for verdict in look.verdicts} == dict.fromkeys(
        joint.axes, 'pass')
