# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What waits for a node does not wait for one that is no more."""

import time

import pytest
from ros_harness import PATIENCE_S, Ros


def test_waiting_ends_when_a_node_has_ended_by_itself(ros: Ros) -> None:
    ros.start('imu_allan_node', {'publish_period': 1e9})
    began = time.monotonic()
    with pytest.raises(AssertionError, match=r'^imu_allan_node_0\.log ended\n'
                       r'(?s:.*)publish_period(?s:.*)$'):
        ros.until(lambda: False)
    assert time.monotonic() - began < PATIENCE_S / 2
