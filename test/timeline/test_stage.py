# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from imu_allan.block import ImuBlock
from imu_allan.timeline import TimelineStage
import numpy as np


def test_clean_messages_come_out_as_they_went_in():
    rng = np.random.default_rng(1)
    header = np.arange(10_000) * 10_000_000 + 1_700_000_000_000_000_000
    samples = rng.normal(size=(10_000, 6)) + [0, 0, 0, 0, 0, 9.81]
    stage = TimelineStage()
    blocks = stage.push(ImuBlock(header, header, samples, np.zeros((10_000, 2), bool), 'imu'))
    blocks += stage.flush()
    assert np.array_equal(np.concatenate([b.samples for b in blocks]), samples)
    assert [b.first_index for b in blocks] == [0, *np.cumsum([len(b) for b in blocks])[:-1]]
    summary = stage.summary()
    assert summary.timeline.sample_rate_hz == 100.0
    assert (summary.timeline.samples, summary.timeline.missing) == (10_000, 0)
    assert summary.remarks == ()
