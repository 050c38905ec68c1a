# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Wall time of a small recording from start to end, with result, configurations, pictures and page.

The command is started as a user starts it, interpreter and imports included; what it takes without
`--output` stands beside it, so that the share of the pictures can be seen in the same run.

    python bench/bench_report.py [--repeats 5]
"""

import argparse
from pathlib import Path
from statistics import median
import subprocess
import sys
import tempfile
import time

ROOT = Path(__file__).resolve().parents[1]
COMMAND = [sys.executable, '-m', 'imu_allan']


def seconds(*arguments: str) -> float:
    """Return how long a command takes."""
    begin = time.perf_counter()
    subprocess.run([*COMMAND, *arguments], check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - begin


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
    print('60,000 samples at 100 Hz, from start to end:')
    print(f'  table alone                       {median(table):.2f} s')
    print(f'  with pictures, page and all files {median(whole):.2f} s '
          f'(pictures and page {median(whole) - median(table):.2f} s)')


if __name__ == '__main__':
    main()
