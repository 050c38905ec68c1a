# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Time and memory of `imu_allan analyze`, whole process, over a plain pass through the same file.

The plain pass is a process of its own that reads and decompresses every chunk with the library
imu_allan uses (MCAP), or fetches every row (sqlite3), and looks at nothing. Both alternate, so
that what else the machine does falls on both; the medians of the ratios are printed beside the
limits that they are held to. With --base another checkout takes its turn, too: a loss of some per
cent is seen by whoever causes it. An uncompressed MCAP has two plain passes: over its bytes, chunk
by chunk, and over its messages, record by record with the library of the format, which takes so
long that it is timed once, on one eighth of the messages. Memory is the largest resident size of
any one process, at one eighth of the messages and at all of them.

    python bench/bench_analyze.py                       # 10.8 million messages: 1 kHz for 3 h
    python bench/bench_analyze.py --messages 1000000 --base ../older
"""

import argparse
import os
from pathlib import Path
import shutil
from statistics import median
import subprocess
import sys
import tempfile
import time

from bench_reading import plain_mcap_pass, plain_records_pass, plain_sqlite_pass, white_noise
from imu_allan.recordings.write import write_recording

ROOT = Path(__file__).resolve().parents[1]
KINDS = (('mcap', 'zstd', 1.5), ('mcap', '', None), ('sqlite3', '', 1.3))
"""Containers, and how many times as long as the plain pass they may take."""
_BY_A_THREAD = """
import sys
from imu_allan.cli.main import main
from imu_allan.recordings import reading
reading.WORTHWHILE_BYTES = sys.maxsize
sys.exit(main())
"""
MOST_CPU_US, MOST_MB = 3.5, 100
"""Processor time of ten messages of a zstd MCAP, and resident memory, at most."""


def measured(command: list[str], checkout: Path = ROOT) -> tuple[float, float, float]:
    """Wall and processor time in seconds, and largest resident size in MB, of a process."""
    begin = time.perf_counter()
    # Python looks into the current folder first, which may be another checkout.
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, cwd=checkout,
                               env={**os.environ, 'PYTHONPATH': str(checkout)})
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.perf_counter() - begin
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f'{" ".join(command)} failed')
    return wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--messages', type=int, default=10_800_000)
    parser.add_argument('--repeats', type=int, default=3)
    parser.add_argument('--plain-pass', metavar='PATH', help=argparse.SUPPRESS)
    parser.add_argument('--records', action='store_true', help=argparse.SUPPRESS)
    parser.add_argument('--base', metavar='CHECKOUT', type=Path,
                        help='another checkout of imu_allan, which takes its turn')
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
                rows = []
                for _ in range(options.repeats):
                    base, _, _ = measured(plain)
                    wall, cpu, peak = measured([*analyze, str(bag)])
                    older = (measured([*analyze, str(bag)], options.base.resolve())
                             if options.base else (wall, cpu, peak))
                    rows.append((wall, wall / base, cpu, peak, wall / older[0], cpu / older[1]))
                wall, ratio, cpu, memory[messages], *to_base = map(
                    median, zip(*rows, strict=True))
                limits = (f' (limit {aim:g})' if aim else '',
                          f' (limit {MOST_CPU_US:g})' if compression else '')
                print(f'{name:12} {messages:>10} messages: {wall:.2f} s, {ratio:.2f} x plain pass'
                      f'{limits[0]}; processor {1e7 * cpu / messages:.2f} us per ten{limits[1]}; '
                      f'{memory[messages]:.0f} MB (limit {MOST_MB})', flush=True)
                if options.base:
                    print(f'{name:12} {messages:>10} messages: over {options.base}: '
                          f'{to_base[0]:.2f} wall, {to_base[1]:.2f} processor', flush=True)
                if (storage, compression) == ('mcap', 'zstd') and messages == options.messages:
                    wall, *_ = measured([sys.executable, '-c', _BY_A_THREAD, 'analyze', str(bag)])
                    print(f'{name:12} {messages:>10} messages: read by a thread instead of a '
                          f'process {wall:.2f} s', flush=True)
                if (storage, compression) == ('mcap', '') and messages < options.messages:
                    base, *_ = measured([*plain, '--records'])
                    print(f'{name:12} {messages:>10} messages: record by record {base:.2f} s, of '
                          f'which imu_allan takes {wall / base:.3f}', flush=True)
                shutil.rmtree(bag)
            small, large = memory.values()
            print(f'{name:12} memory at eight times the length: {large / small:.2f} times')
    return 0


if __name__ == '__main__':
    sys.exit(main())
