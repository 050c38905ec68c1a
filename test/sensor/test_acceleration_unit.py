# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Values that are in another unit: acceleration in g however it comes, what no sensor has."""

from characterized import messages, streamed
from hypothesis import given, settings, strategies as st
from imu_allan.characterization import characterize
from imu_allan.finding_messages import sentence_of
from imu_allan.node.run import Lane
from imu_allan.sensor.acceleration_unit import AccelerationUnit
from imu_allan.sensor.plausible import implausible
from imu_messages import cut
import numpy as np
import pytest

EVERY, ACCELERATION = slice(6), slice(3, 6)
FAULTS = {
    'nothing': [], 'zeros': [(slice(40), EVERY, 0.0)],
    'bump': [(slice(10, 30), ACCELERATION, None)],
    'set down': [(slice(1500), ACCELERATION, None)],
    'unusable': [(slice(20), slice(4, 5), np.nan), (slice(20, 30), ACCELERATION, 1e300),
                 (slice(40, 60), ACCELERATION, 0.0)]}
"""At the start: what stands in place of the samples, or, None, that noise is added."""


def at_rest_in_g(fault='nothing', count=6000):
    noise = np.random.default_rng(0)
    samples = noise.normal(0, 0.002, (count, 6))
    samples[:, 5] += 1
    for rows, columns, value in FAULTS[fault]:
        part = samples[rows, columns]
        part[:] = part + noise.normal(0, 0.5, part.shape) if value is None else value
    return messages(samples, 200)


@pytest.mark.parametrize('fault', FAULTS)
def test_node_and_recording_find_the_same_unit_whatever_comes_first(fault):
    block = at_rest_in_g(fault)
    whole = np.concatenate([part.samples for part in AccelerationUnit().each([block])])
    expected = block.samples.copy()
    expected[:, 3:] *= 9.80665
    np.testing.assert_array_equal(whole, expected)
    lane = lane_of(block, 100)
    parts = AccelerationUnit().each(cut(block, [5000]))
    expected_state = streamed(parts, None, 'topic').to_state()
    for key, array in lane.characterization.to_state().items():
        np.testing.assert_array_equal(array, expected_state[key])
    assert lane.snapshot().remarks[0].code == 'unit_g'


@settings(max_examples=30, deadline=None)
@given(st.sampled_from([*FAULTS]), st.sampled_from([1, 9.8, 0.01]),
       st.lists(st.integers(1, 2999), max_size=30))
def test_any_split_gives_the_same_samples(fault, scale, edges):
    block = at_rest_in_g(fault, 3000)
    block.samples[:, 3:] *= scale
    [*whole] = AccelerationUnit().each([block])
    [*parts] = AccelerationUnit().each(cut(block, edges))
    for name in ('samples', 'header_ns', 'receive_ns', 'absent'):
        np.testing.assert_array_equal(np.concatenate([getattr(part, name) for part in parts]),
                                      np.concatenate([getattr(part, name) for part in whole]))


@pytest.mark.parametrize(('gravity', 'noise', 'most'), [
    (9.81, 0.02, 32), (9.81, 2.0, 32), (0.0, 0.7, 2048)],
    ids=['at rest', 'driving', 'driving without gravity'])
def test_what_is_not_in_g_stays_as_it_is_and_hardly_waits(gravity, noise, most):
    block = at_rest_in_g(count=3000)
    block.samples[:, 3:] = np.random.default_rng(1).normal([0, 0, gravity], noise, (3000, 3))
    unit = AccelerationUnit()
    came = [len(unit(part)) for part in cut(block, range(3000))]
    assert came.index(most) == most - 1
    assert unit.decision is False
    assert unit.remarks == []


@pytest.mark.parametrize(('first', 'gravity', 'acceleration'), [
    (200, 9.81, (0, 0, 1)), (64, 0.0, (1, 0, 0))],
    ids=['placeholder', 'a push without gravity'])
def test_a_start_near_one_makes_no_g_of_what_follows(first, gravity, acceleration):
    block = at_rest_in_g(count=3000)
    block.samples[:, 3:] = np.random.default_rng(1).normal([0, 0, gravity], 0.05, (3000, 3))
    block.samples[:first, 3:] = acceleration
    for size in (1, 100, 3000):
        unit = AccelerationUnit()
        came = [part for given in cut(block, range(0, len(block), size)) for part in unit(given)]
        np.testing.assert_array_equal(np.concatenate([part.samples for part in came]),
                                      block.samples)
        assert unit.decision is False


@pytest.mark.parametrize('value', [np.nan, 0.0])
def test_messages_without_acceleration_do_not_wait(value):
    block = at_rest_in_g(count=100)
    block.samples[:, 3:] = value
    assert [len(part) for part in AccelerationUnit()(block)] == [100]


def lane_of(block, size):
    lane = Lane(streamed([], None, 'topic'))
    for part in cut(block, range(0, len(block), size)):
        lane.update([part])
    return lane


def test_messages_that_wait_are_in_the_result():
    lane = lane_of(at_rest_in_g(count=20), 1)
    for _ in range(2):
        characterization, remarks = lane.snapshot()
        result, *_ = characterization.fitted(remarks)
        assert result.timeline.samples == 20
        assert result.axes['accel_z'].mean == pytest.approx(9.80665, rel=2e-3)
        assert 'unit_g' in {remark.code for remark in result.warnings}


@pytest.mark.parametrize(('gyro', 'bias', 'accel', 'said'), [
    (0.005, 0.02, 0.05, {}),
    # A poor one of 17 deg/h beside the turn of the Earth, and a quiet one.
    (1e-6, 7.3e-5, 1e-3, {}),
    (0.015, 2.0, 0.02, {'gyro': ('mean', 'deg/s')}),
    # The 0.0028 deg/s/sqrt(Hz) of a good gyroscope of phones
    (0.028, 0.1, 0.02, {'gyro': ('noise_density', 'deg/s')}),
    (13.0, 40.0, 0.02, {'gyro': ('noise_density', 'counts')}),
    (0.001, 0.0, 3.0, {'accel': ('noise_density', 'mg')}),
    # A gyroscope of 0.1 deg/s/sqrt(Hz), the zero rate of another, an accelerometer of 100 g
    (0.0175, 1.31, 1.47, {}),
])
def test_what_no_sensor_has_at_rest_is_reported_with_the_likeliest_unit(gyro, bias, accel, said):
    samples = np.random.default_rng(0).normal(size=(10_000, 6)) * np.repeat([gyro, accel], 3)
    samples += [bias, bias, bias, 0.0, 0.0, 9.81]
    result = streamed([messages(samples, 100.0)]).result()
    assert {axis: (found.values['what'], found.values['likely'])
            for found in result.warnings if found.code == 'implausible'
            for axis in found.axes} == {
        f'{sensor}_{axis}': why for sensor, why in said.items() for axis in 'xyz'}


def test_gravity_tells_the_counts_of_all_axes_from_mg():
    samples = np.random.default_rng(0).normal(size=(10_000, 6)) * np.repeat([1e-3, 25.0], 3)
    samples += [0.0, 0.0, 0.0, 170.0, 330.0, 16_384.0]
    result = streamed([messages(samples, 200.0)]).result()
    said = [found for found in result.warnings if found.code == 'implausible']
    assert [(found.values['what'], found.values['likely']) for found in said] == [
        ('noise_density', 'counts')] * len(said)
    assert [axis for found in said for axis in found.axes] == ['accel_x', 'accel_y', 'accel_z']
    [sentence] = {sentence_of(found) for found in result.warnings if found.code == 'gravity'}
    assert sentence == 'the mean acceleration is 16387 m/s^2, not about 9.81'


def test_a_spread_is_reported_where_the_noise_density_is_not_known():
    # What alternates is a line, and no noise beside it.
    swing = np.tile([0.7, -0.7], 500) + np.random.default_rng(0).normal(size=1000) * 1e-3
    [found] = implausible({'gyro_x': characterize(swing, 100.0)})
    assert (found.values['what'], found.values['likely']) == ('spread', 'deg/s')
