# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0

from hypothesis import given, settings, strategies as st
from imu_allan.sensor.noise_model import parse_model
from imu_allan.sensor.simulated_imu import simulated_blocks, SimulatedImu
from imu_allan.sensor.units import STANDARD_GRAVITY
import numpy as np

MODEL = parse_model("""
gyro: {noise_density: 0.005 deg/s/sqrt(Hz), bias_instability: 10 deg/h, mean: 0.1 deg/s}
accel: {noise_density: 100 ug/sqrt(Hz), gauss_markov: {sigma: 50 ug, correlation_time: 30 s}}
""")


@settings(max_examples=20, deadline=None)
@given(st.lists(st.integers(0, 2500), min_size=1, max_size=5))
def test_samples_do_not_depend_on_the_sizes_they_are_drawn_in(sizes: list[int]) -> None:
    at_once = SimulatedImu(MODEL, 200.0, seed=5).draw(sum(sizes))
    imu = SimulatedImu(MODEL, 200.0, seed=5)
    np.testing.assert_array_equal(np.concatenate([imu.draw(size) for size in sizes]), at_once)


def test_every_axis_has_noise_of_its_own_and_another_seed_gives_other_noise() -> None:
    samples = SimulatedImu(MODEL, 100.0, seed=1).draw(20_000)
    other = SimulatedImu(MODEL, 100.0, seed=2).draw(20_000)
    correlation = np.corrcoef(np.diff(np.concatenate((samples, other), axis=1), axis=0).T)
    np.testing.assert_array_less(np.abs(correlation - np.eye(12)), 0.05)


def test_accelerometer_at_rest_measures_gravity_unless_the_model_names_a_mean() -> None:
    accel = SimulatedImu(MODEL, 100.0).draw(5000)[:, 3:].mean(axis=0)
    np.testing.assert_allclose(accel, [0, 0, STANDARD_GRAVITY], atol=0.02)
    lying = parse_model('accel: {noise_density: 100 ug/sqrt(Hz), x: {mean: 1 g}}')
    accel = SimulatedImu(lying, 100.0).draw(5000)[:, 3:].mean(axis=0)
    np.testing.assert_allclose(accel, [STANDARD_GRAVITY, 0, 0], atol=0.02)


def test_blocks_cover_the_samples_with_even_stamps_and_a_sensor_left_out_is_absent() -> None:
    blocks = list(simulated_blocks(MODEL, 300.0, 25_000, start_ns=10**18, frame_id='f'))
    stamps = np.concatenate([block.header_ns for block in blocks])
    assert len(stamps) == 25_000
    assert all(block.frame_id == 'f' for block in blocks)
    np.testing.assert_allclose(stamps - 10**18, np.arange(25_000) * (1e9 / 300), atol=0.6)
    np.testing.assert_array_equal(np.concatenate([block.samples for block in blocks]),
                                  SimulatedImu(MODEL, 300.0).draw(25_000))
    gyro_only = parse_model('gyro: {noise_density: 0.005 deg/s/sqrt(Hz)}')
    block = next(iter(simulated_blocks(gyro_only, 100.0, 10)))
    np.testing.assert_array_equal(block.absent, np.tile([False, True], (10, 1)))


def test_white_noise_has_the_density_of_the_model() -> None:
    white = parse_model('gyro: {noise_density: 0.01 rad/s/sqrt(Hz)}\n'
                        'accel: {noise_density: 0.01 m/s^2/sqrt(Hz)}')
    np.testing.assert_allclose(SimulatedImu(white, 100.0).draw(50_000).std(axis=0), 0.1, rtol=0.02)
