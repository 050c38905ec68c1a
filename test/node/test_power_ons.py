# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A run over several power-ons of the robot knows the turn-on bias."""

import json
from pathlib import Path
from typing import Any

from imu_allan.node import run as run_module
from imu_allan.node.checkpoint import decode_state, encode_state
from imu_allan.node.run import new_run, pack, Run, Setup, unpack
from imu_allan.noise.random_effects import random_effects
from imu_allan.timeline import TimelineOptions
import numpy as np
import pytest
from ros_harness import at_rest, RATE_HZ

SETUP = Setup('/imu', TimelineOptions())
SIGMA = 0.01
SAMPLES = 4000


@pytest.fixture
def boot(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    path = tmp_path / 'boot_id'
    path.write_text('first\n')
    monkeypatch.setattr(run_module, 'BOOT_ID', path)
    return path


def feed(run: Run, mean: float, seed: int) -> float:
    """Give samples of one power-on; return the mean of the first axis."""
    block = at_rest(SAMPLES, RATE_HZ, start_s=seed * 1e5, seed=seed, noise=SIGMA,
                    mean=(mean, mean, mean, 0, 0, 0))
    run.lanes[0].characterization.update(block)
    return float(block.samples[:, 0].mean())


def ended(run: Run) -> list[Any]:
    """Give what is noted of the power-ons that have ended."""
    state = run.lanes[0].characterization.to_state()
    return list(json.loads(str(state['memory/power_ons'])))


def resumed(run: Run, boot: Path, name: str = '') -> Run:
    """Go through the state file, as a node that is started again does, after a boot if named."""
    content = encode_state(pack(run, SETUP))
    if name:
        boot.write_text(name)
    return unpack(decode_state(content), SETUP)


def test_means_of_every_boot_make_the_turn_on_bias_and_no_random_walk(boot: Path) -> None:
    biases = np.random.default_rng(1).normal(0, 0.1, 6)
    run = new_run(SETUP)
    means = []
    for number, bias in enumerate(biases):
        if number:
            run = resumed(run, boot, f'boot {number}')
        means.append(feed(run, bias, number))
    result = run.snapshot().result()
    found = result.turn_on_bias['gyro_x']
    expected = random_effects(means, [SIGMA / np.sqrt(SAMPLES)] * len(means))
    assert found.sigma == pytest.approx(expected.between, rel=1e-3)
    assert found.ci95 == pytest.approx(expected.between_ci95, rel=1e-2)
    assert found.ci95[0] < np.std(biases, ddof=1) < found.ci95[1]
    assert result.turn_on_bias['accel_x'].sigma < 3 * SIGMA / np.sqrt(SAMPLES)
    # What differs from one power-on to the next is no drift of the sensor.
    walk = result.axes['gyro_x'].coefficients['rate_random_walk']
    assert not walk.observable
    low, high = result.axes['gyro_x'].coefficients['noise_density'].ci95 or (0, 0)
    assert low < SIGMA / RATE_HZ**0.5 * 1.02
    assert high > SIGMA / RATE_HZ**0.5 * 0.98


def test_power_ons_one_soon_after_the_other_are_no_slow_turn() -> None:
    run = new_run(SETUP)
    for number, bias in enumerate([0.0, 0.1, 0.0, 0.1, 0.0]):
        run.lanes[0].update([at_rest(4000, start_s=60.0 * number, seed=number,
                                     mean=(bias, 0, 0, 0, 0, 9.8))])
        run.lanes[0].power_on()
    assert 'slow_motion' not in {finding.code for finding in run.snapshot().result().warnings}


def test_a_node_that_is_started_again_on_the_same_boot_goes_on_with_the_power_on(
        boot: Path) -> None:
    run = new_run(SETUP)
    feed(run, 0.0, 0)
    run = resumed(run, boot)
    feed(run, 0.1, 1)
    assert run.snapshot().result().turn_on_bias == {}
    # A computer that cannot tell its boots counts every start.
    boot.unlink()
    for _ in range(2):
        run = resumed(run, boot)
    assert len(ended(run)) == 2
