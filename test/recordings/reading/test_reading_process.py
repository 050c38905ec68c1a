# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Reading in a process of its own: the same messages, and no process left behind."""

from dataclasses import replace
from itertools import groupby
import os
from pathlib import Path
import signal
import subprocess
import sys
import threading

from bags import assert_same, block, FailingRecording, joined
from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError
from imu_allan.finding import Finding
from imu_allan.recordings import choose_topic, open_recording, read_blocks
from imu_allan.recordings.reading import reading_process
from imu_allan.recordings.write import write_recording
import pytest
from whole_lines import refused

MESSAGES = block(50_000)


@pytest.fixture(autouse=True)
def every_recording_is_worth_a_process(monkeypatch):
    monkeypatch.setattr(reading_process, 'WORTHWHILE_BYTES', 0)


def state_and_parent(process: int | str) -> tuple[str, int]:
    """Return what the system says of a process; of one that is gone what it says of a zombie."""
    try:
        state, parent, *_ = Path(f'/proc/{process}/stat').read_text().rpartition(')')[2].split()
    except OSError:
        return 'Z', 0
    return state, int(parent)


@pytest.fixture(scope='module')
def long_bag(tmp_path_factory) -> Path:
    """Return a recording that is still being read for a while, which nobody changes."""
    return write_recording(tmp_path_factory.mktemp('long') / 'bag', [block(400_000)],
                           compression='')


def children(of: int | None = None) -> list[int]:
    return [int(folder.name) for folder in Path('/proc').glob('[0-9]*')
            if state_and_parent(folder.name)[1] == (of or os.getpid())]


def read_here(path: Path) -> tuple[ImuBlock, list[Finding]]:
    with open_recording(path) as recording:
        blocks = [block for block, _ in recording.decoded(choose_topic(recording))]
        return joined(blocks), recording.remarks


def read_beside(path: Path) -> tuple[ImuBlock, list[Finding]]:
    before = children()
    with open_recording(path) as recording:
        blocks = read_blocks(recording, choose_topic(recording))
        [_] = set(children()) - set(before)
        taken = joined(list(blocks))
        assert children() == before
        return taken, recording.remarks


@pytest.mark.parametrize(('storage', 'compression'), [
    ('mcap', 'zstd'), ('mcap', 'lz4'), ('mcap', ''), ('sqlite3', '')])
def test_the_messages_are_those_that_this_process_reads(tmp_path, storage, compression):
    bag = write_recording(tmp_path / 'bag', [MESSAGES], storage=storage, compression=compression)
    after, remarks = read_beside(bag)
    assert_same(MESSAGES, after)
    assert remarks == []


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


def test_whoever_stops_early_leaves_no_process(long_bag):
    before = children()
    with open_recording(long_bag) as recording:
        blocks = read_blocks(recording, choose_topic(recording))
        next(blocks)
        assert len(children()) == len(before) + 1
        blocks.close()
        assert children() == before


def test_a_process_ended_from_outside_is_one_clear_error(long_bag):
    before = set(children())
    with open_recording(long_bag) as recording:
        blocks = read_blocks(recording, choose_topic(recording))
        next(blocks)
        [child] = set(children()) - before
        os.kill(child, signal.SIGKILL)
        with refused(f'{long_bag}: the process that reads it was ended from outside (signal 9), '
                     'perhaps for want of memory'):
            list(blocks)
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
        assert any(thread.name.startswith('imu_allan') for thread in threading.enumerate())
        assert children() == before
        assert_same(MESSAGES, joined([first, *blocks]))
