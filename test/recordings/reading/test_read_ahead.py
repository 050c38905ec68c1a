# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The thread that reads ahead, and the joining of blocks."""

from collections.abc import Iterator
import subprocess
import sys
import threading
import time

from bags import assert_same, block, joined
from hypothesis import given, strategies as st
from imu_allan.block import ImuBlock
from imu_allan.recordings.reading.read_ahead import larger_blocks, read_ahead
import pytest
from whole_lines import refused


def threads() -> int:
    return sum(thread.name.startswith('imu_allan') for thread in threading.enumerate())


def test_items_come_in_order_and_the_thread_ends():
    assert list(read_ahead(iter(range(1000)))) == list(range(1000))
    assert threads() == 0


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


def test_no_more_than_depth_items_are_held():
    made = []

    def counted() -> Iterator[int]:
        for item in range(100):
            made.append(item)
            yield item

    stream = read_ahead(counted(), depth=3)
    next(stream)
    deadline = time.monotonic() + 5
    while len(made) < 4 and time.monotonic() < deadline:
        time.sleep(0.01)
    time.sleep(0.05)
    assert len(made) == 4
    assert list(stream) == list(range(1, 100))


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


@pytest.mark.parametrize('read', ['os.read(os.pipe()[0], 1)', 'itertools.count()'])
def test_a_program_that_leaves_off_ends_at_once_and_silently(read):
    program = ('import itertools, os\n'
               'from imu_allan.recordings.reading.read_ahead import read_ahead\n'
               'def items():\n'
               '    yield 1\n'
               f'    yield from {read}\n'
               'stream = read_ahead(items())\n'
               'next(stream)\n')
    done = subprocess.run([sys.executable, '-c', program], capture_output=True, timeout=20)
    assert (done.returncode, done.stderr) == (0, b'')


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
