# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The backtest of a running node: seldom made, and that of a recording of the same messages."""

import json
from typing import Any

from imu_allan.analysis import analyze
from imu_allan.block import ImuBlock
from imu_allan.cdr import encode_imu
from imu_allan.node.run import new_run, Run, Setup
from imu_allan.timeline import TimelineOptions
import numpy as np
from ros_harness import Driver, recorded, Ros
from std_msgs.msg import String

RATE_HZ = 10.0
SAMPLES = 7000
"""More than ten minutes, without which there is no backtest."""


def messages(count: int = SAMPLES) -> ImuBlock:
    stamps = 1_700_000_000 * 10**9 + np.arange(count) * round(1e9 / RATE_HZ)
    samples = np.random.default_rng(3).normal(0, 0.01, (count, 6))
    samples[:, 5] += 9.8
    return ImuBlock(stamps, stamps, samples, np.zeros((count, 2), bool), 'imu')


def test_file_and_topic_hold_the_backtest_of_a_recording_of_the_same_messages(ros: Ros) -> None:
    block = messages()
    ros.start('imu_allan_node', {'publish_period': 0.5})
    results = ros.listen(String, 'imu_allan/result')
    driver = Driver(ros).wait_for_node()
    for stamp, sample in zip(block.header_ns.tolist(), block.samples, strict=True):
        driver.send(encode_imu(stamp, sample, 'imu'))
    path = recorded(ros.folder / 'same.mcap', {'imu': block})
    expected = backtests(json.loads(analyze(path).to_json()))
    assert all(found['trained_s'] > 300 for found in expected.values())
    assert len(expected) == 6

    def published() -> bool:
        return any(backtests(json.loads(message.data)) == expected for message in results[-1:])

    def saved() -> bool:
        document = ros.saved()
        return document is not None and backtests(document) == expected

    ros.until(published)
    ros.until(saved)


def backtests(document: dict[str, Any]) -> dict[str, Any]:
    return {name: axis['backtest'] for name, axis in document['axes'].items()}


def test_a_backtest_is_made_again_when_the_record_is_longer_by_a_part() -> None:
    run = new_run(Setup('/imu', TimelineOptions()))
    block = messages(10_000)

    def grow(first: int, last: int) -> list[float]:
        part = slice(first, last)
        run.lanes[0].update([ImuBlock(block.header_ns[part], block.receive_ns[part],
                                      block.samples[part], block.absent[part], 'imu')])
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
