# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from hypothesis import given, strategies as st
from imu_allan.timeline.clock import flaw_of, iso_time, order_stamps, place_in_burst
import numpy as np
import pytest


def judge(stamps, bursts=False):
    stamps = np.asarray(stamps, dtype=np.int64)
    return flaw_of(stamps, np.zeros(max(len(stamps) - 1, 0), dtype=bool), bursts)


@pytest.mark.parametrize(('stamps', 'flaw'), [
    ([0] * 20, 'zero'),
    ([7] * 20, 'constant'),
    (np.repeat(np.arange(20), 50) * 10**9, 'in whole seconds'),
    (np.repeat(np.arange(500), 2) * 10**7, 'coarse'),
    (np.tile([5, 1], 50), 'out of order'),
])
def test_flaws_of_a_clock_are_named(stamps, flaw):
    assert judge(stamps) == flaw


def test_an_even_clock_is_usable_at_any_rate_even_one_hertz():
    for interval in (10**9, 10**7, 10**5):
        assert not judge(np.arange(1000) * interval + 10**18)


def test_messages_that_came_twice_are_no_flaw_of_the_clock():
    stamps = np.repeat(np.arange(500), 2) * 10**7
    assert not flaw_of(stamps, np.diff(stamps) == 0, bursts=False)


def test_messages_received_together_are_no_flaw_of_the_receive_clock():
    assert not judge(np.repeat(np.arange(500), 4) * 10**7, bursts=True)


def test_rising_stamps_need_no_order():
    assert order_stamps(np.array([1, 2, 5]), 0) is None


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


def test_a_clock_set_back_is_a_jump_and_a_swapped_message_is_not():
    stamps = np.concatenate([np.arange(100), np.arange(50, 150)]) * 10
    order = order_stamps(stamps, None)
    assert order is not None
    assert np.flatnonzero(order.jumps).tolist() == [100]
    assert order.keep.all()
    swapped = np.arange(100)
    swapped[[40, 41]] = [41, 40]
    order = order_stamps(swapped, None)
    assert order is not None
    assert not order.jumps.any()
    assert np.flatnonzero(order.out_of_order).tolist() == [41]


def test_places_in_a_burst_go_on_across_blocks():
    assert place_in_burst(np.array([5, 5, 7, 8, 8, 8]), None, 0).tolist() == [0, 1, 0, 0, 1, 2]
    assert place_in_burst(np.array([8, 8, 9]), 8, 2).tolist() == [3, 4, 0]
    assert place_in_burst(np.array([1, 2, 3]), 0, 0) is None


def test_times_are_iso_or_none():
    assert iso_time(0) == '1970-01-01T00:00:00Z'
    assert iso_time(1_700_000_000_123_456_789) == '2023-11-14T22:13:20.123456Z'
    assert iso_time(10**30) is None
