# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The thread that reads ahead, and the joining of blocks."""

from collections.abc import Iterator
import threading

from bags import assert_same, block, joined
from hypothesis import given, strategies as st
from imu_allan.block import ImuBlock
from imu_allan.recordings.reading.read_ahead import larger_blocks, read_ahead
from whole_lines import refused


def threads() -> int:
    return sum(thread.name.startswith('imu_allan') for thread in threading.enumerate())


def test_an_exception_comes_after_the_items_before_it():
    def failing() -> Iterator[tuple[ImuBlock, int]]:
        yield block(3), 1
        yield block(2, first=3), 2
        raise OSError('disk on fire')

    ahead, larger = read_ahead(failing()), larger_blocks(failing())
    assert [next(ahead)[1], next(ahead)[1]] == [1, 2]
    # Blocks are joined.
    assert_same(block(5), next(larger)[0])
    for stream in (ahead, larger):
        with refused('disk on fire', OSError):
            next(stream)
    assert threads() == 0


def test_a_consumer_that_stops_early_ends_the_thread_and_closes_the_source():
    closed = []

    def endless() -> Iterator[int]:
        try:
            while True:
                yield 1
        finally:
            closed.append(True)

    stream = read_ahead(endless())
    next(stream)
    stream.close()
    assert closed == [True]
    assert threads() == 0


@given(st.lists(st.tuples(st.integers(1, 9), st.sampled_from(['a', 'b'])), max_size=30),
       st.integers(1, 20))
def test_joined_blocks_hold_the_same_messages(sizes, messages):
    blocks, first = [], 0
    for size, frame_id in sizes:
        blocks.append((block(size, frame_id, first), first))
        first += size
    after = list(larger_blocks(iter(blocks), messages))
    if not blocks:
        assert after == []
        return
    whole = joined([item for item, _ in after])
    assert_same(joined([item for item, _ in blocks]), whole)
    assert [item.frame_id for item, _ in after for _ in range(len(item))] == [
        frame_id for size, frame_id in sizes for _ in range(size)]
    assert all(len(item) < messages + 9 for item, _ in after)
    positions = [position for _, position in after]
    assert positions == sorted(positions)
