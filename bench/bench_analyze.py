# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Time and memory of `imu_allan analyze`, whole process, over a plain pass through the same file.

The plain pass is a process of its own that reads and decompresses every chunk with the library
imu_allan uses (MCAP), or fetches every row (sqlite3), and looks at nothing. Both alternate, so
that what else the machine does falls on both; the medians of the ratios are printed. An
uncompressed MCAP has two plain passes: over its bytes, chunk by chunk, and over its messages,
record by record with the library of the format, which takes so long that it is timed once, on one
eighth of the messages. Memory is the largest resident size of any one process, at one eighth of
the messages and at all of them.

    python bench/bench_analyze.py                       # 10.8 million messages: 1 kHz for 3 h
    python bench/bench_analyze.py --messages 1000000
"""

import argparse
from importlib.util import find_spec
import os
from pathlib import Path
import shutil
from statistics import median
import subprocess
import sys
import tempfile
import time

from bench_reading import (
    plain_mcap_pass,
    plain_records_pass,
    plain_sqlite_pass,
    white_noise,
)
from imu_allan.recordings.write import write_recording

KINDS = (('mcap', 'zstd', 2.0), ('mcap', '', 3.0), ('sqlite3', '', 3.0))
_BY_A_THREAD = """
import sys
from imu_allan.cli.main import main
from imu_allan.recordings.reading import reading_process
reading_process.WORTHWHILE_BYTES = sys.maxsize
sys.exit(main())
"""
_PEER = """
import sys
from pathlib import Path
import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
with AnyReader([Path(sys.argv[1])],
               default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
    rows = []
    for connection, _, raw in reader.messages():
        m = reader.deserialize(raw, connection.msgtype)
        w, a = m.angular_velocity, m.linear_acceleration
        rows.append((w.x, w.y, w.z, a.x, a.y, a.z))
samples = np.array(rows)
if sys.argv[2] == 'allantools':
    import allantools
    for axis in samples.T:
        allantools.oadev(axis, rate=1000, data_type='freq', taus='octave')
else:
    import allan_variance
    tau, avar = allan_variance.compute_avar(samples, 0.001)
    allan_variance.estimate_parameters(tau, avar)
"""


def measured(command: list[str]) -> tuple[float, float]:
    """Wall time in seconds and largest resident size in MB of a process."""
    begin = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.perf_counter() - begin
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f'{" ".join(command)} failed')
    return wall, usage.ru_maxrss / 1024


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--messages', type=int, default=10_800_000)
    parser.add_argument('--repeats', type=int, default=3)
    parser.add_argument('--plain-pass', metavar='PATH', help=argparse.SUPPRESS)
    parser.add_argument('--records', action='store_true', help=argparse.SUPPRESS)
    parser.add_argument('--peers', type=int, metavar='MESSAGES', default=300_000,
                        help='time peers fed by rosbags, on so many messages (0: none)')
    options = parser.parse_args()
    if options.plain_pass:
        file = Path(options.plain_pass)
        (plain_records_pass if options.records else plain_sqlite_pass if file.suffix == '.db3'
         else plain_mcap_pass)(file)
        return 0
    analyze = [sys.executable, '-m', 'imu_allan', 'analyze']
    with tempfile.TemporaryDirectory() as folder:
        for storage, compression, aim in KINDS:
            name = f'{storage} {compression or "plain"}'
            memory = {}
            for messages in (options.messages // 8, options.messages):
                bag = Path(folder) / f'{storage}_{compression}_{messages}'
                write_recording(bag, white_noise(messages), storage=storage,
                                compression=compression)
                [file] = (path for path in bag.iterdir() if path.suffix != '.yaml')
                plain = [sys.executable, __file__, '--plain-pass', str(file)]
                ours, ratios, peaks = [], [], []
                for _ in range(options.repeats):
                    base, _ = measured(plain)
                    wall, peak = measured([*analyze, str(bag)])
                    ours.append(wall)
                    ratios.append(wall / base)
                    peaks.append(peak)
                memory[messages] = median(peaks)
                print(f'{name:12} {messages:>10} messages: {median(ours):7.2f} s, '
                      f'{median(ratios):.2f} x plain pass (aim {aim:g}), '
                      f'{1e6 * median(ours) / messages:.2f} us a message, '
                      f'{median(peaks):.0f} MB', flush=True)
                if (storage, compression) == ('mcap', 'zstd') and messages == options.messages:
                    wall, _ = measured([sys.executable, '-c', _BY_A_THREAD, 'analyze', str(bag)])
                    print(f'{name:12} {messages:>10} messages: read by a thread instead of a '
                          f'process {wall:.2f} s', flush=True)
                if (storage, compression) == ('mcap', '') and messages < options.messages:
                    base, _ = measured([*plain, '--records'])
                    print(f'{name:12} {messages:>10} messages: record by record {base:.2f} s, of '
                          f'which imu_allan takes {median(ours) / base:.3f}', flush=True)
                shutil.rmtree(bag)
            small, large = memory.values()
            print(f'{name:12} memory at eight times the length: {large / small:.2f} times')
        if options.peers:
            bag = Path(folder) / 'peers'
            write_recording(bag, white_noise(options.peers), storage='mcap', compression='zstd')
            ours, _ = measured([*analyze, str(bag)])
            print(f'{options.peers} messages: imu_allan {ours:.2f} s')
            for peer in ('allantools', 'allan_variance'):
                if find_spec(peer) is None:
                    print(f'  {peer}: not installed; pip install {peer.replace("_", "-")}')
                    continue
                wall, peak = measured([sys.executable, '-c', _PEER, str(bag), peer])
                print(f'  rosbags + {peer:15} {wall:7.2f} s = {wall / ours:.0f} times, '
                      f'{peak:.0f} MB')
    return 0


if __name__ == '__main__':
    sys.exit(main())
