# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Reading in a process or thread of its own: the same messages, nothing left, little memory."""

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
from imu_allan.errors import ImuAllanError
from imu_allan.recordings import choose_topic, open_recording, read_blocks, reading
from imu_allan.recordings.reading import larger_blocks, read_ahead
from imu_allan.recordings.write import write_recording
from processes import python
import pytest
from repeated import slow
from whole_lines import refused

MESSAGES = block(50_000)


@pytest.fixture(autouse=True)
def every_recording_is_worth_a_process(monkeypatch):
    monkeypatch.setattr(reading, 'WORTHWHILE_BYTES', 0)


def children():
    found = []
    for process in Path('/proc').glob('[0-9]*'):
        # One may end meanwhile.
        with suppress(OSError):
            _, parent, *_ = (process / 'stat').read_text().rpartition(')')[2].split()
            if int(parent) == os.getpid():
                found.append(int(process.name))
    return found


def threads():
    return sum(thread.name.startswith('imu_allan') for thread in threading.enumerate())


@pytest.mark.parametrize(('storage', 'compression'), [
    ('mcap', 'zstd'), ('mcap', ''), ('sqlite3', '')])
def test_messages_are_as_written_and_a_frame_id_begins_a_block(tmp_path, storage, compression):
    parts = [replace(MESSAGES.part(slice(a, b)), frame_id=name)
             for a, b, name in [(0, 10, 'one'), (10, 40_000, 'two'), (40_000, 50_000, 'three')]]
    bag = write_recording(tmp_path / 'bag', parts, storage=storage, compression=compression)
    before = children()
    with open_recording(bag) as recording:
        blocks = read_blocks(recording, choose_topic(recording))
        assert len(children()) == len(before) + 1
        after = groupby(blocks, lambda block: block.frame_id)
        for part, (_, found) in zip(parts, after, strict=True):
            assert_same(part, joined(found))
        assert children() == before
        assert recording.remarks == []


@pytest.mark.parametrize('read', [
    reading.read_in_process,
    lambda recording, topic: read_ahead(larger_blocks(recording.decoded(topic)))],
    ids=['process', 'thread'])
@pytest.mark.parametrize('error', [
    ImuAllanError('bag: this and that'), OSError(5, 'Input/output error'),
    ZeroDivisionError('a defect')], ids=lambda error: type(error).__name__)
def test_an_exception_comes_after_the_blocks_before_it(read, error):
    taken = []
    with pytest.raises(type(error)) as caught:
        taken.extend(block for block, _ in read(FailingRecording(MESSAGES, error), '/imu'))
    assert str(caught.value) == str(error)
    assert_same(MESSAGES, joined(taken))
    assert threads() == 0
    if isinstance(error, ZeroDivisionError) and read is reading.read_in_process:
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


@pytest.mark.parametrize('why', ['no process can be started', 'small'])
def test_a_thread_reads_where_a_process_cannot_or_need_not(tmp_path, monkeypatch, why):
    bag = write_recording(tmp_path / 'bag', [MESSAGES])

    def refuse(*_args, **_options):
        raise OSError(11, 'Resource temporarily unavailable')

    monkeypatch.setattr(*{
        'no process can be started': (subprocess, 'Popen', refuse),
        'small': (reading, 'WORTHWHILE_BYTES', 1 << 26)}[why])
    before = children()
    with open_recording(bag) as recording:
        blocks = read_blocks(recording, choose_topic(recording))
        first = next(blocks)
        assert threads() > 0
        assert children() == before
        assert_same(MESSAGES, joined([first, *blocks]))


def test_a_consumer_that_stops_early_ends_the_thread_and_closes_the_source():
    closed = []

    def endless():
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


# VmHWM, since ru_maxrss of a child begins with what its parent had.
READ = r"""
import re, sys
from imu_allan.recordings import open_recording, read_blocks
with open_recording(sys.argv[1]) as recording:
    [topic] = recording.topics
    count = sum(len(block) for block in read_blocks(recording, topic.name))
print(count, re.search(r'VmHWM:\s+(\d+)', open('/proc/self/status').read())[1])
"""


def blocks(messages):
    for first in range(0, messages, 10_000):
        yield block(10_000, first=first)


def bag(storage, compression):
    return lambda path, messages: write_recording(
        path, blocks(messages), storage=storage, compression=compression)


def ulog(path, messages):
    """Write the messages of a short log again and again."""
    pytest.importorskip('pyulog')
    from test_px4_ulog import combined, COUNT, framed, write

    form, made = combined()
    data = write(path, {'sensor_combined': (form, made)}).read_bytes()
    head = len(data) - COUNT * len(framed(b'D', b'--' + made[0]))
    path.write_bytes(data[:head] + data[head:] * (messages // COUNT))
    return path


@pytest.mark.usefixtures('children_unmeasured')
@pytest.mark.skipif(not sys.platform.startswith('linux'), reason='needs /proc')
@pytest.mark.parametrize(('write', 'few', 'more_kib'), [
    (bag('mcap', 'zstd'), 50_000, 8_000), slow(bag('mcap', ''), 50_000, 8_000),
    # pyulog took three times the size of the file.
    (bag('sqlite3', ''), 50_000, 8_000), (ulog, 200_000, 5_000)])
def test_eight_times_the_length_takes_the_same_memory(tmp_path, write, few, more_kib):
    resident = []
    for messages in (few, 8 * few):
        path = write(tmp_path / str(messages), messages)
        count, most = python('-c', READ, path, check=True).stdout.split()
        assert int(count) == messages
        resident.append(int(most))
    assert resident[1] < resident[0] + more_kib
    assert resident[1] < 150 * 1024
