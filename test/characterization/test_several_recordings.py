# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace

from characterized import covers, messages, N, said, streamed, unbiased
from imu_allan.characterization.several_recordings import joint_result
from imu_allan.noise.terms import SLOW_TERMS
from imu_allan.sensor.noise_model import parse_model
from imu_allan.sensor.simulated_imu import SimulatedImu
import numpy as np
import pytest
from whole_lines import refused

RATE_HZ = 50.0
SAMPLES = 10_000
DENSITY = 0.005 * np.pi / 180


def recorded(path, seed, change=None, *, model='noise_density: 0.005 deg/s/sqrt(Hz)',
             rate_hz=RATE_HZ, samples=SAMPLES, gyro_alone=False, **fields):
    """Take in a sensor of which only some axes have values: nearly all time goes into fits."""
    whole = parse_model(f'gyro: {{{model}}}\n' + (
        '' if gyro_alone else 'accel: {noise_density: 100 ug/sqrt(Hz), z: {mean: 1 g}}'))
    rows = SimulatedImu(whole, rate_hz, seed).draw(samples)
    rows[:, [2, 4, 5]] = np.nan
    if change is not None:
        change(rows)
    return streamed([replace(messages(rows, rate_hz, gyro_alone=gyro_alone), **fields)], path)


@pytest.fixture(scope='module')
def nights():
    """Four recordings of one IMU, whose zero bias is another after each power-on."""
    return [recorded(f'night{seed}', seed, model='noise_density: 0.005 deg/s/sqrt(Hz), '
                     f'rate_random_walk: 40 deg/h/sqrt(h), mean: {bias} deg/h')
            for seed, bias in ((1, 400), (2, -300), (3, 100), (4, -50))]


@pytest.fixture(scope='module')
def joint(nights):
    return joint_result(nights)


def test_four_recordings_know_twice_as_well_as_one(nights, joint):
    one, four = (result.axes['gyro_x'].coefficients[N] for result in (nights[0].result(), joint))
    assert np.diff(four.ci95) / four.value == pytest.approx(np.diff(one.ci95) / one.value / 2,
                                                            rel=0.25)
    assert covers(four.ci95, DENSITY)
    assert four.between < 1e-6
    assert joint.timeline.samples == 4 * SAMPLES
    assert joint.timeline.duration_s == pytest.approx(4 * SAMPLES / RATE_HZ, rel=1e-3)
    assert said(joint, 'recordings_disagree') == []
    # The result holds what it was made of.
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
        assert covers(found.ci95, sigma)
    assert joint.turn_on_bias['accel_x'].ci95[0] == 0.0
    remarks = said(joint, 'turn_on_bias')
    assert [one.axes for one in remarks] == [('gyro_x',), ('gyro_y',)]
    for one in remarks:
        bias = joint.turn_on_bias[one.axes[0]]
        assert (one.values['sigma'], one.values['sigma_low'], one.values['sigma_high']) == (
            bias.sigma, *bias.ci95)


def test_a_recording_that_contradicts_the_others_is_named(nights):
    noisy = recorded('after', 9, model='noise_density: 0.006 deg/s/sqrt(Hz)')
    found = joint_result([*nights[:3], noisy])
    remarks = said(found, 'recordings_disagree')
    assert [one.axes for one in remarks] == [('gyro_x',), ('gyro_y',)]
    for one in remarks:
        assert (one.values['coefficient'], one.values['of_recording']) == (N, 'after')
        assert one.values['value'] / one.values['usual_value'] == pytest.approx(1.2, abs=0.02)
    between = found.axes['gyro_x'].coefficients[N].between
    assert between / found.axes['gyro_x'].coefficients[N].value > 0.05


def cut_off(rows):
    rows[:, 0] = np.minimum(rows[:, 0], 0.0)


def die(rows):
    rows[SAMPLES // 4:, 0] = rows[0, 0]


def still(rows):
    rows[:, 0] = 0.0


@pytest.mark.parametrize(('change', 'fault'), [
    (cut_off, 'saturated'), (die, 'dead'), (still, 'constant')])
def test_an_axis_at_fault_in_one_recording_is_refused(change, fault):
    with refused(f'bad: gyro x is {fault}, but not in every recording; leave this one out'):
        joint_result([recorded('good', 1, gyro_alone=True),
                      recorded('bad', 2, change, gyro_alone=True)])


def test_an_axis_at_fault_in_all_recordings_has_no_numbers():
    found = joint_result([recorded(path, seed, still, gyro_alone=True)
                          for path, seed in (('one', 1), ('other', 2))])
    assert [one.axes for one in said(found, 'constant_axis')] == [('gyro_x',)]
    assert found.axes['gyro_x'].constant
    assert not any(one.observable for one in found.axes['gyro_x'].coefficients.values())
    assert found.axes['gyro_y'].coefficients[N].observable
    assert list(found.turn_on_bias) == ['gyro_y']


def smooth(rows):
    rows[1:] = (rows[1:] + rows[:-1]) / 2


def filtered(gain):
    def change(rows):
        rows[:, :3] = unbiased(rows[:, :3], gain)
    return change


@pytest.mark.parametrize(('other', 'complaint'), [
    ({'rate_hz': 60.0}, 'other: sampled at 60 Hz, night1 at 50 Hz; analyze recordings of '
     'different rates apart'),
    ({'frame_id': 'imu_2'},
     "other: frame 'imu_2', but 'imu_link' in night1; analyze different IMUs apart"),
    ({'absent': np.tile([False, True], (SAMPLES, 1))},
     'other: axes gyro_x, gyro_y, but gyro_x, gyro_y, accel_x in night1; analyze them apart')])
def test_what_cannot_be_one_series_is_refused(nights, other, complaint):
    with refused(complaint):
        joint_result([nights[0], recorded('other', 5, **other)])


@pytest.mark.parametrize(('change', 'code'), [
    (smooth, 'band_limited'), (filtered(0.02), 'high_passed')])
def test_a_filter_in_one_recording_alone_is_reported_and_leaves_n_right(nights, change, code):
    joint = joint_result([nights[0], recorded('other', 5, change)])
    assert ('gyro_x',) in [one.axes for one in said(joint, code)]
    assert joint.axes['gyro_x'].coefficients[N].value == pytest.approx(DENSITY, rel=0.03)


def test_recordings_that_all_went_through_filters_tell_nothing_of_their_axes():
    result = joint_result([recorded(path, seed, filtered(gain))
                           for path, seed, gain in (('a', 1, 0.02), ('b', 2, 0.1))])
    assert [one.axes for one in said(result, 'high_passed')] == [('gyro_x',), ('gyro_y',)]
    for name in ('gyro_x', 'gyro_y'):
        axis = result.axes[name]
        assert axis.high_passed_hz is not None
        assert not any(axis.coefficients[key].observable for key in SLOW_TERMS)
    # What the filter left of a mean is no turn-on bias.
    assert set(result.turn_on_bias) == {'accel_x'}


def test_recordings_that_are_no_series_are_refused(nights):
    with refused('empty: holds no usable sample; leave it out'):
        joint_result([nights[0], streamed([], 'empty')])
