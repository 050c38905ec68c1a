# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Memory that does not depend on the length of a recording."""

import sys

from bags import block
from imu_allan.recordings.write import write_recording
from processes import python
import pytest
from repeated import slow

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
