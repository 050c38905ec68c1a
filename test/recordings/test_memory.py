# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Memory that does not depend on the length of a recording."""

from collections.abc import Iterator
from pathlib import Path
import subprocess
import sys

from bags import block
from imu_allan.block import ImuBlock
from imu_allan.recordings.write import write_recording
import pytest
from repeated import slow

# VmHWM, since ru_maxrss of a child begins with what its parent had.
READ = r"""
import re, sys
from imu_allan.recordings import open_recording, read_blocks
with open_recording(sys.argv[1]) as recording:
    count = sum(len(block) for block in read_blocks(recording, '/imu/data_raw'))
print(count, re.search(r'VmHWM:\s+(\d+)', open('/proc/self/status').read())[1])
"""


def blocks(messages: int) -> Iterator[ImuBlock]:
    for first in range(0, messages, 10_000):
        yield block(10_000, first=first)


def resident_kib(path: Path, messages: int) -> int:
    output = subprocess.run([sys.executable, '-c', READ, str(path)], check=True,
                            capture_output=True, text=True).stdout.split()
    assert int(output[0]) == messages
    return int(output[1])


@pytest.mark.skipif(not sys.platform.startswith('linux'), reason='needs /proc')
@pytest.mark.parametrize(('storage', 'compression'),
                         [('mcap', 'zstd'), slow('mcap', ''), ('sqlite3', '')])
def test_eight_times_the_length_takes_the_same_memory(tmp_path, storage, compression):
    resident = []
    for messages in (50_000, 400_000):
        path = write_recording(tmp_path / str(messages), blocks(messages), storage=storage,
                               compression=compression)
        resident.append(resident_kib(path, messages))
    assert resident[1] < resident[0] + 8 * 1024
    assert resident[1] < 150 * 1024
