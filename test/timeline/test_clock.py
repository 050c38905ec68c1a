# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from hypothesis import given, strategies as st
from imu_allan.timeline.clock import iso_time, order_stamps, place_in_burst
import numpy as np


@given(st.lists(st.integers(-(2**62), 2**62), max_size=200), st.integers(-(2**62), 2**62))
def test_kept_stamps_rise_between_jumps_and_every_other_has_a_reason(stamps, last):
    stamps = np.array(stamps, dtype=np.int64)
    order = order_stamps(stamps, last)
    if order is None:
        assert np.all(np.diff(stamps) > 0)
        return
    assert np.all(order.keep ^ order.duplicate ^ order.out_of_order)
    newest = last
    for stamp, keep, jump in zip(stamps.tolist(), order.keep, order.jumps, strict=True):
        if keep:
            assert jump or stamp > newest
            newest = stamp


def test_places_in_a_burst_go_on_across_blocks():
    assert place_in_burst(np.array([5, 5, 7, 8, 8, 8]), None, 0).tolist() == [0, 1, 0, 0, 1, 2]
    assert place_in_burst(np.array([8, 8, 9]), 8, 2).tolist() == [3, 4, 0]
    assert place_in_burst(np.array([1, 2, 3]), 0, 0) is None


def test_times_are_iso_or_none():
    assert iso_time(0) == '1970-01-01T00:00:00Z'
    assert iso_time(1_700_000_000_123_456_789) == '2023-11-14T22:13:20.123456Z'
    assert iso_time(10**30) is None
