# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""High rates, busy computers, long runs: nothing is lost, nothing grows."""

from contextlib import contextmanager
from math import log
import subprocess
import sys

from imu_allan.block import ImuBlock
from imu_allan.characterization import Characterization
from imu_allan.sensor.noise_model import parse_model
from imu_allan.sensor.simulated_imu import SimulatedImu
import numpy as np
import pytest
from repeated import slow
from ros_harness import assert_kept_up, Health, LARGEST_MB, PATIENCE_S, resident_mb

MODEL = parse_model("""
gyro: {noise_density: 1e-4 rad/s/sqrt(Hz), bias_instability: 2e-5 rad/s,
       rate_random_walk: 2e-6 rad/s^2/sqrt(Hz)}
accel: {noise_density: 2e-3 m/s^2/sqrt(Hz), bias_instability: 4e-4 m/s^2,
        rate_random_walk: 5e-5 m/s^3/sqrt(Hz), z: {mean: 9.81 m/s^2}}
""")
RATE_HZ = 25.0


@contextmanager
def busy_cores(count):
    processes = [subprocess.Popen([sys.executable, '-c', 'while True: pass'])
                 for _ in range(count)]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


@pytest.mark.parametrize(('rate_hz', 'seconds', 'busy'), [
    (1000.0, 4.0, 1), slow(1000.0, 600.0, 1), slow(4000.0, 60.0, 0)])
def test_nothing_is_lost_in_real_time_beside_a_busy_core(ros, rate_hz, seconds, busy):
    node = ros.start('imu_allan_node', {
        'publish_period': 2.0, 'state_file': str(ros.folder / 'state'),
        'checkpoint_period': 5.0}, best_effort=True, shared_memory=True)
    health = Health(ros)
    with busy_cores(busy):
        simulator = ros.start('imu_simulator', {
            'rate': rate_hz, 'duration': seconds, 'wait_for_subscriptions': 1},
            shared_memory=True)
        # Best effort begins when both sides have found each other: the first may be missed.
        ros.until(lambda: sum(health.number('reception', key) for key in ('received', 'lost'))
                  >= rate_hz * seconds - 200, seconds + PATIENCE_S)
        assert simulator.wait() == 0
    assert_kept_up(node, health, rate_hz)
    assert node.stop() == 0


@pytest.mark.parametrize(('hours', 'speed', 'best_effort'), [
    # At full speed the simulator waits for a subscription that keeps all.
    (0.01, 0.0, False),
    # By default a subscription does not: one that keeps all has a queue that grows with every
    # moment in which the IMU is faster than the node.
    slow(24.0, 25.0, True)])
def test_memory_and_cost_stay_as_samples_pile_up(ros, hours, speed, best_effort):
    node = ros.start('imu_allan_node', {'publish_period': 5.0,
                                        'state_file': str(ros.folder / 'state')},
                     best_effort=best_effort, shared_memory=True)
    simulator = ros.start('imu_simulator', {
        'rate': 1000.0, 'duration': hours * 3600, 'speed': speed, 'wait_for_subscriptions': 1},
        shared_memory=True)
    health, total = Health(ros), hours * 3.6e6
    samples, memories, cpu = [], [], []

    def arrived():
        # A fit comes and goes within a second: a single look would be a matter of luck.
        memories[-1] = max(memories[-1], resident_mb(node.popen.pid))
        return sum(health.number('reception', key) for key in ('received', 'lost')) >= (
            total * len(memories) / 8 - (200 if best_effort else 0))

    for _ in range(8):
        memories.append(0.0)
        ros.until(arrived, 7200)
        samples.append(health.number('reception', 'received'))
        cpu.append(node.scheduled_s())
    assert simulator.wait() == 0
    # How many are lost at 25 times the rate depends on what else the computer does.
    assert health.number('reception', 'lost') <= (0.001 * total if best_effort else 0)
    assert node.stop() == 0
    assert max(memories) < LARGEST_MB
    if best_effort:
        assert memories[-1] < 1.1 * memories[0]
        costs = np.diff(cpu) / np.diff(samples)
        assert costs[-1] < 1.25 * costs[0]


def phases(draw, hours):
    """Give the day of a robot: seconds, how it is shaken, its bends and turns, and its engine."""
    now_s = 120.0
    yield now_s, 0.0, 0.0, 0.0, 0.0, 0.0
    while now_s < hours * 3600:
        # On uneven ground, in slow bends; then, now and then, on the spot.
        drive_s, turn_s = draw.uniform(10, 600), draw.uniform(3, 10) * (draw.random() < 0.3)
        yield drive_s, 0.05, 0.6, 0.1, 0.0, 0.0
        yield turn_s, 0.01, 0.1, 0.0, 0.5, 0.0
        # Stops of 5 s to 10 min, a quarter of them with the engine on.
        stop_s = float(np.exp(draw.uniform(log(5), log(600))))
        yield stop_s, 0.0, 0.0, 0.0, 0.0, float(draw.random() < 0.25)
        now_s += drive_s + turn_s + stop_s


@pytest.mark.parametrize(('seed', 'hours'), [(1, 2), slow(3, 7 * 24)])
def test_stop_and_go_shows_the_noise_of_the_sensor(seed, hours):
    draw, imu = np.random.default_rng(seed), SimulatedImu(MODEL, RATE_HZ, seed)
    run, first, at_rest_s, tilt = Characterization(kind='topic', topic='/imu'), 0, 0.0, np.zeros(3)
    for seconds, *shaken, bends, turn, engine in phases(draw, hours):
        numbers = first + np.arange(round(seconds * RATE_HZ))
        first += len(numbers)
        at_rest_s += 0.0 if any((*shaken, engine)) else seconds
        samples = imu.draw(len(numbers))
        samples += draw.normal(0, np.repeat(shaken, 3), samples.shape)
        # No floor is flat: after each move the IMU stands at another angle, of 0.05 degree.
        tilt += draw.normal(0, 0.01, 3) * any(shaken)
        samples[:, 3:] += tilt
        samples[:, 2] += turn + bends * np.sin(2 * np.pi * numbers / RATE_HZ / 20)
        # At 8.3 Hz.
        samples += np.outer(np.sin(2 * np.pi * 8.3 * numbers / RATE_HZ),
                            np.repeat([0.01, 0.3], 3)) * engine
        stamps = 10**18 + np.rint(numbers / RATE_HZ * 1e9).astype(np.int64)
        run.update(ImuBlock(stamps, stamps, samples, np.zeros((len(stamps), 2), bool), 'imu'))
    result, summary = run.result(), run.summary()
    for name, axis in result.axes.items():
        assert axis.coefficients['noise_density'].observable
        assert axis.goodness_of_fit.acceptable
        # Every interval or bound is about the true value, with room for chance.
        for key in ('noise_density', 'bias_instability', 'rate_random_walk'):
            found, true = axis.coefficients[key], MODEL.axes[name][key]
            low, high = found.ci95 or (0.0, found.upper95 or 0.0)
            assert low - (high - low) < true < high + (high - low), (name, key, low, high)
    used_s = summary.timeline.samples / RATE_HZ - summary.motion.cut.total_s
    assert 0.7 * at_rest_s < used_s < 1.02 * at_rest_s
