# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Time of a small recording from start to end, with result, configurations, pictures and page.

The command is started as a user starts it, interpreter and imports included; what it takes without
`--output` stands beside it, so that the share of the pictures can be seen in the same run. The
processor time of all its processes is what other work on the computer changes least; of the wall
time the least is nearest to that of an idle one.

    python bench/bench_report.py [--repeats 5]
"""

import argparse
import os
from pathlib import Path
from statistics import median
import subprocess
import sys
import tempfile
import time

ROOT = Path(__file__).resolve().parents[1]
COMMAND = [sys.executable, '-m', 'imu_allan']


def seconds(*arguments: str) -> tuple[float, float]:
    """Return how long a command takes, and the processor time of it and its children."""
    begin, before = time.perf_counter(), os.times()
    subprocess.run([*COMMAND, *arguments], check=True, stdout=subprocess.DEVNULL)
    after = os.times()
    return time.perf_counter() - begin, (after.children_user + after.children_system
                                         - before.children_user - before.children_system)


def main() -> None:
    """Print the medians."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n\n')[0].strip())
    parser.add_argument('--repeats', type=int, default=5)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        recording = str(Path(folder) / 'at_rest')
        subprocess.run([*COMMAND, 'simulate', str(ROOT / 'config' / 'consumer_mems.yaml'),
                        '--rate', '100', '--duration', '10min', '--output', recording],
                       check=True, stdout=subprocess.DEVNULL)
        table, whole = [], []
        for _ in range(args.repeats):
            table.append(seconds('analyze', recording))
            whole.append(seconds('analyze', recording, '--output', str(Path(folder) / 'out')))
    print('60,000 samples at 100 Hz, from start to end: wall time, least and median; processor')
    for what, runs in (('table alone', table), ('with pictures, page and all files', whole)):
        wall, processor = zip(*runs, strict=True)
        print(f'  {what:<33} {min(wall):.2f} s  {median(wall):.2f} s  {median(processor):.2f} s')
    ratio = median(p for _, p in whole) / median(p for _, p in table)
    print(f'  processor time with pictures and page: {ratio:.2f} of that of the table')


if __name__ == '__main__':
    main()
