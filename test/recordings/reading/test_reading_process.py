# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Reading in a process or thread of its own: the same messages, and nothing left behind."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import groupby
import os
from pathlib import Path
import signal
import subprocess
import sys
import threading

from bags import assert_same, block, FailingRecording, joined
from hypothesis import given, strategies as st
from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError
from imu_allan.recordings import choose_topic, open_recording, read_blocks
from imu_allan.recordings.reading import reading_process
from imu_allan.recordings.reading.read_ahead import larger_blocks, read_ahead
from imu_allan.recordings.write import write_recording
import pytest
from whole_lines import refused

MESSAGES = block(50_000)


@pytest.fixture(autouse=True)
def every_recording_is_worth_a_process(monkeypatch):
    monkeypatch.setattr(reading_process, 'WORTHWHILE_BYTES', 0)


def children() -> list[int]:
    found = []
    for process in Path('/proc').glob('[0-9]*'):
        # One may end meanwhile.
        with suppress(OSError):
            _, parent, *_ = (process / 'stat').read_text().rpartition(')')[2].split()
            if int(parent) == os.getpid():
                found.append(int(process.name))
    return found


def threads() -> int:
    return sum(thread.name.startswith('imu_allan') for thread in threading.enumerate())


@pytest.mark.parametrize(('storage', 'compression'), [
    ('mcap', 'zstd'), ('mcap', 'lz4'), ('mcap', ''), ('sqlite3', '')])
def test_the_messages_are_those_that_this_process_reads(tmp_path, storage, compression):
    bag = write_recording(tmp_path / 'bag', [MESSAGES], storage=storage, compression=compression)
    before = children()
    with open_recording(bag) as recording:
        blocks = read_blocks(recording, choose_topic(recording))
        assert len(children()) == len(before) + 1
        assert_same(MESSAGES, joined(list(blocks)))
        assert children() == before
        assert recording.remarks == []


def test_every_change_of_frame_id_begins_a_block(tmp_path):
    parts = [replace(MESSAGES.part(slice(a, b)), frame_id=name)
             for a, b, name in [(0, 10, 'one'), (10, 20_000, 'two'), (20_000, 20_001, 'one')]]
    bag = write_recording(tmp_path / 'bag', parts)
    with open_recording(bag) as recording:
        after = list(read_blocks(recording, choose_topic(recording)))
    assert [name for name, _ in groupby(block.frame_id for block in after)] == [
        'one', 'two', 'one']
    for name in ('one', 'two'):
        assert_same(joined([part for part in parts if part.frame_id == name]),
                    joined([block for block in after if block.frame_id == name]))


@pytest.mark.parametrize('error', [
    ImuAllanError('bag: this and that'), OSError(5, 'Input/output error'),
    ZeroDivisionError('a defect')], ids=lambda error: type(error).__name__)
def test_an_exception_comes_after_the_blocks_before_it(error):
    blocks = reading_process.read_in_process(FailingRecording(MESSAGES, error), '/imu')
    taken = []
    with pytest.raises(type(error)) as caught:
        taken.extend(block for block, _ in blocks)
    assert str(caught.value) == str(error)
    assert_same(MESSAGES, joined(taken))
    if isinstance(error, ZeroDivisionError):
        # A defect shows where it is.
        assert 'in decoded' in str(caught.value.__cause__)


def test_whoever_stops_early_leaves_no_process_and_one_ended_from_outside_is_one_error(tmp_path):
    # One that is still being read for a while.
    bag = write_recording(tmp_path / 'bag', [block(400_000)], compression='')
    before = set(children())
    with open_recording(bag) as recording:
        for killed in (False, True):
            blocks = read_blocks(recording, choose_topic(recording))
            next(blocks)
            [child] = set(children()) - before
            if killed:
                os.kill(child, signal.SIGKILL)
                with refused(f'{bag}: the process that reads it was ended from outside (signal '
                             '9), perhaps for want of memory'):
                    list(blocks)
            else:
                blocks.close()
            assert set(children()) == before


@pytest.mark.parametrize('why', ['no process can be started', 'no Python', 'small'])
def test_a_thread_reads_where_a_process_cannot_or_need_not(tmp_path, monkeypatch, why):
    bag = write_recording(tmp_path / 'bag', [MESSAGES])

    def refuse(*_args, **_options):
        raise OSError(11, 'Resource temporarily unavailable')

    monkeypatch.setattr(*{
        'no process can be started': (subprocess, 'Popen', refuse),
        'no Python': (sys, 'executable', '/bin/true'),
        'small': (reading_process, 'WORTHWHILE_BYTES', 1 << 26)}[why])
    before = children()
    with open_recording(bag) as recording:
        blocks = read_blocks(recording, choose_topic(recording))
        first = next(blocks)
        assert threads() > 0
        assert children() == before
        assert_same(MESSAGES, joined([first, *blocks]))


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


@given(st.lists(st.tuples(st.integers(1, 9), st.sampled_from(['a', 'b'])), min_size=1,
                max_size=30),
       st.integers(1, 20))
def test_joined_blocks_hold_the_same_messages(sizes, messages):
    blocks, first = [], 0
    for size, frame_id in sizes:
        blocks.append((block(size, frame_id, first), first))
        first += size
    assert list(larger_blocks(iter([]), messages)) == []
    after = list(larger_blocks(iter(blocks), messages))
    assert_same(joined([item for item, _ in blocks]), joined([item for item, _ in after]))
    assert [item.frame_id for item, _ in after for _ in range(len(item))] == [
        frame_id for size, frame_id in sizes for _ in range(size)]
    assert all(len(item) < messages + 9 for item, _ in after)
    positions = [position for _, position in after]
    assert positions == sorted(positions)
