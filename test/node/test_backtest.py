# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The backtest of a running node is seldom made."""

from imu_allan.block import ImuBlock
from imu_allan.node.run import new_run, Run, Setup
from imu_allan.timeline import TimelineOptions
import numpy as np


def test_a_backtest_is_made_again_when_the_record_is_longer_by_a_part() -> None:
    run = new_run(Setup('/imu', TimelineOptions()))
    stamps = 1_700_000_000 * 10**9 + np.arange(10_000) * 10**8
    samples = np.random.default_rng(3).normal(0, 0.01, (10_000, 6))
    samples[:, 5] += 9.8
    block = ImuBlock(stamps, stamps, samples, np.zeros((10_000, 2), bool), 'imu')

    def grow(first: int, last: int) -> list[float]:
        run.lanes[0].update([block.part(slice(first, last))])
        return fitted(run)

    assert grow(0, 7000) == [350.0] * 6
    assert grow(7000, 8000) == [350.0] * 6
    assert grow(8000, 8100) == [405.0] * 6


def fitted(run: Run) -> list[float]:
    """Fit as the node does; return what the backtests were trained on."""
    tested = run.backtests
    results, _ = run.snapshot().fitted(tested)
    run.learn(results, run.fed if tested is None else None)
    found = [axis.backtest for axis in run.snapshot().as_one(results).axes.values()]
    return [round(each.trained_s) for each in found if each is not None]
