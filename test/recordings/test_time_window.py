# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The part of a recording between two times."""

from dataclasses import replace

from imu_allan.recordings.time_window import between
from imu_messages import cut, still
import pytest


@pytest.mark.parametrize('received', ['as sent', 'all at once'])
@pytest.mark.parametrize(('start_s', 'duration_s', 'first', 'last'), [
    (0.0, 20.0, 0, 2000), (30.0, None, 3000, 6000), (10.0, 5.0, 1000, 1500)])
def test_a_part_is_cut_by_the_stamps_that_advance(start_s, duration_s, first, last, received):
    block = still(6000)
    if received == 'all at once':
        # As some converters write it.
        block = replace(block, receive_ns=0 * block.receive_ns + block.receive_ns[-1])
    shortfall = []
    parts = list(between(cut(block, [2500]), start_s, duration_s, 'bag', shortfall))
    kept = [stamp for part in parts for stamp in part.header_ns.tolist()]
    assert kept == block.header_ns[first:last].tolist()
    assert not shortfall
