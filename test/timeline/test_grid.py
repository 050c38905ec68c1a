# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace

from hypothesis import given, settings, strategies as st
from imu_messages import codes, cut, pick, run, START_NS, still
import numpy as np
import pytest


def paired(count: int, rate_hz: float) -> np.ndarray:
    """Give stamps of a USB device that hands over two samples at a time, 23 Hz by the median."""
    interval = 1e9 / rate_hz
    stamps = np.arange(count) * interval
    stamps[::2] += 0.74 * interval
    return START_NS + np.rint(stamps).astype(np.int64)


def bursts(count: int, rate_hz: float, length: int) -> np.ndarray:
    """Give stamps of messages that arrive `length` at a time, 20 us apart."""
    places = np.arange(count)
    last = places // length * length + length - 1
    return START_NS + np.rint(last * 1e9 / rate_hz).astype(np.int64) + places % length * 20_000


def mostly_100_ms(resolution_s: float) -> np.ndarray:
    """Give stamps in ticks of a sensor of 9.862 Hz: more than half of the steps are 100 ms."""
    ticks = np.ceil(np.arange(8000) / 9.862 / resolution_s - 1e-9)
    return START_NS + np.rint(ticks * resolution_s * 1e9).astype(np.int64)


LATE_NOW_AND_THEN = np.where(np.random.default_rng(2).random(20_000) < 0.86, 0.100, 0.110)
STALLS = np.maximum(40 - (np.arange(30_000) - 1000) % 1777, 0) * (np.arange(30_000) >= 1000)


@pytest.mark.parametrize(('rate_hz', 'off', 'header', 'receive'), [
    (40.0, 1e-4, paired(20_000, 40.0), None),
    (40.0, 1e-4, None, paired(20_000, 40.0)),
    *((9.862, 1e-4, mostly_100_ms(resolution_s), None) for resolution_s in (0.01, 0.1)),
    (1 / LATE_NOW_AND_THEN.mean(), 1e-4,
     START_NS + np.rint(np.cumsum(LATE_NOW_AND_THEN) * 1e9).astype(np.int64), None),
    *((400.0, 2e-3, None, bursts(30_000, 400.0, length)) for length in (2, 25)),
    (100.0, 2e-3, None, np.repeat(still(20_000).receive_ns[3::4], 4)),
    (200.0, 1e-4, still(30_000, 200.0, late=STALLS).header_ns, None),
], ids=['pairs', 'pairs received', *2 * ['ticks'], 'late now and then', *2 * ['bursts'],
        'received together', 'stalls of the host'])
def test_uneven_stamps_neither_invent_nor_lose_samples(rate_hz, off, header, receive):
    block = still(len(receive if header is None else header))
    block.header_ns[:] = 0 if header is None else header
    if receive is not None:
        block = replace(block, receive_ns=receive)
    summary, _ = run(block)
    assert summary.timeline.sample_rate_hz == pytest.approx(rate_hz, rel=off)
    assert (summary.timeline.samples, summary.timeline.missing) == (len(block), 0)
    assert summary.timeline.duplicates == 0
    assert summary.clock == ('receive' if header is None else 'header')
    assert run(cut(block, range(0, len(block), 997)))[0] == summary


@settings(max_examples=60, deadline=None)
@given(data=st.data(), rate_hz=st.floats(5.0, 5000.0), jitter=st.sampled_from([0.0, 0.02, 0.1]))
def test_lost_samples_are_counted_exactly_at_any_rate(data, rate_hz, jitter):
    count = data.draw(st.integers(300, 5000))
    rng = np.random.default_rng(data.draw(st.integers(0, 1000)))
    block = still(count, rate_hz, late=rng.uniform(0, jitter, count))
    lost = set()
    for _ in range(data.draw(st.integers(0, 12))):
        at = data.draw(st.integers(30, count - 30))
        lost |= set(range(at, min(at + data.draw(st.integers(1, 9)), count - 20)))
    assert_counted(block, lost, rate_hz)


def assert_counted(block, lost, rate_hz):
    places = np.arange(len(block.header_ns))
    summary, _ = run(pick(block, np.setdiff1d(places, list(lost))), motion='keep')
    assert summary.timeline.missing == len(lost)
    assert summary.timeline.samples == len(places) - len(lost)
    assert summary.timeline.sample_rate_hz == pytest.approx(rate_hz, rel=2e-3)
    assert 'rate_changed' not in codes(summary)


@pytest.mark.parametrize('lost', [
    [30, 32, 34, 36, 38, 40, 56, 128], [39, 40, 65, 85, 109, 110, 113, 175, 205, 252]])
def test_few_losses_that_are_nearly_even_by_chance_are_no_ticks(lost):
    assert_counted(still(300, 5.0), lost, 5.0)
