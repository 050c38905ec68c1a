# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""High rates, busy computers, long runs: nothing is lost, nothing grows."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import subprocess
import sys
import time

import numpy as np
import pytest
from repeated import slow
from ros_harness import (
    assert_kept_up,
    Driver,
    Health,
    LARGEST_MB,
    PATIENCE_S,
    Process,
    resident_mb,
    Ros,
)
from std_srvs.srv import Trigger

FLOOD_S = 180.0


@contextmanager
def busy_cores(count: int) -> Iterator[None]:
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
def test_nothing_is_lost_in_real_time_beside_a_busy_core(
        ros: Ros, rate_hz: float, seconds: float, busy: int) -> None:
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


@pytest.mark.slow
@pytest.mark.parametrize(('publishers', 'rate_hz'), [(1, 12_000.0), (2, 8000.0)])
def test_a_flood_for_minutes_costs_little_memory(ros: Ros, publishers: int, rate_hz: float
                                                 ) -> None:
    node = ros.start('imu_allan_node', best_effort=True, shared_memory=True)
    health = Health(ros)
    began, most = time.monotonic(), 0.0
    floods = [ros.start('imu_simulator', {'rate': rate_hz, 'duration': FLOOD_S, 'seed': number,
                                          'wait_for_subscriptions': 1},
                        remaps={'__node': f'flood{number}'}, shared_memory=True)
              for number in range(publishers)]
    while any(flood.running for flood in floods):
        ros.executor.spin_once(timeout_sec=0.5)
        most = max(most, resident_mb(node.popen.pid))
    took_s = time.monotonic() - began
    print(f'{publishers * rate_hz * FLOOD_S:.0f} messages in {took_s:.0f} s, '
          f'{health.number("reception", "received"):.0f} received: {most:.0f} MB', flush=True)
    assert most < LARGEST_MB
    assert ros.call(Trigger, 'imu_allan/reset').success
    driver = Driver(ros).wait_for_node()

    def saved() -> bool:
        # Samples count as mixed for some seconds after the flood.
        driver.publish(200)
        return bool(ros.call(Trigger, 'imu_allan/save').success)

    ros.until(saved)
    assert node.stop() == 0
    if took_s > 1.2 * FLOOD_S:
        pytest.skip('the computer had no time for the flood')


def most_mb_until(ros: Ros, health: Health, node: Process, numbered: float) -> float:
    """Wait for messages, lost ones too; return the most memory held until then."""
    most = 0.0

    def arrived() -> bool:
        nonlocal most
        # A fit comes and goes within a second: a single look would be a matter of luck.
        most = max(most, resident_mb(node.popen.pid))
        return sum(health.number('reception', key) for key in ('received', 'lost')) >= numbered

    ros.until(arrived, 7200)
    return most


@pytest.mark.parametrize(('hours', 'speed', 'best_effort'), [
    # At full speed the simulator waits for a subscription that keeps all.
    (0.01, 0.0, False),
    # By default a subscription does not: one that keeps all has a queue that grows with every
    # moment in which the IMU is faster than the node.
    slow(24.0, 25.0, True)])
def test_memory_and_cost_stay_as_samples_pile_up(
        ros: Ros, hours: float, speed: float, best_effort: bool) -> None:
    node = ros.start('imu_allan_node', {'publish_period': 5.0,
                                        'state_file': str(ros.folder / 'state')},
                     best_effort=best_effort, shared_memory=True)
    simulator = ros.start('imu_simulator', {
        'rate': 1000.0, 'duration': hours * 3600, 'speed': speed, 'wait_for_subscriptions': 1},
        shared_memory=True)
    health, total = Health(ros), hours * 3.6e6
    samples, memories, cpu = [], [], []
    for part in range(1, 9):
        memories.append(most_mb_until(ros, health, node, total * part / 8 - (
            200 if best_effort else 0)))
        samples.append(health.number('reception', 'received'))
        threads = Path(f'/proc/{node.popen.pid}/task').iterdir()
        cpu.append(sum(int((thread / 'schedstat').read_text().split()[0])
                       for thread in threads) * 1e-9)
        print(f'{samples[-1]:12.0f} samples {memories[-1]:6.1f} MB {cpu[-1]:8.1f} s of CPU',
              flush=True)
    assert simulator.wait() == 0
    # How many are lost at 25 times the rate depends on what else the computer does.
    assert health.number('reception', 'lost') <= (0.001 * total if best_effort else 0)
    assert node.stop() == 0
    assert max(memories) < LARGEST_MB
    if best_effort:
        assert memories[-1] < 1.1 * memories[0]
        costs = np.diff(cpu) / np.diff(samples)
        assert costs[-1] < 1.25 * costs[0]
