# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Many recordings at once: how well the cores are used, and what an archive costs.

Recordings of one hour at 200 Hz, each with noise of its own, are analyzed by one process, by as
many as there are cores (`--jobs`), and by the workers of a Dask cluster on this machine. Pictures
and pages are written, too. Efficiency is the processor time of all processes over the wall time of
all cores. An archive of 10,000 hours is extrapolated from the processor time.

    python bench/bench_archive.py [--hours 8]
"""

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import subprocess
import sys
import tempfile

from bench_report import seconds
from imu_allan.block import ImuBlock
from imu_allan.noise.simulate import simulate
from imu_allan.recordings.write import write_recording
import numpy as np

RATE_HZ, HOUR_S = 200, 3600
"""Of each recording."""


def hour(seed: int) -> Iterator[ImuBlock]:
    """Yield the messages of one recording, in the steps of a 16-bit output."""
    samples = np.stack([
        simulate({'noise_density': 1e-4, 'bias_instability': 2e-5}, RATE_HZ * HOUR_S, RATE_HZ,
                 6 * seed + axis) for axis in range(6)], axis=1)
    step = np.pi / 180 / 131
    stamps = 1_700_000_000_000_000_000 + np.arange(len(samples)) * (1_000_000_000 // RATE_HZ)
    yield ImuBlock(stamps, stamps, np.round(samples / step) * step,
                   np.zeros((len(samples), 2), np.bool_), 'imu_link')


@contextmanager
def cluster(workers: int) -> Iterator[str]:
    """Run a Dask scheduler and workers on this machine, and yield the address."""
    port = 18786
    address = f'tcp://127.0.0.1:{port}'
    dask = [sys.executable, '-m', 'dask']
    commands = [[*dask, 'scheduler', '--host', '127.0.0.1', '--port', str(port),
                 '--no-dashboard'],
                [*dask, 'worker', address, '--nworkers', str(workers), '--nthreads', '1',
                 '--no-dashboard']]
    started = [subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
               for command in commands]
    try:
        yield address
    finally:
        for process in reversed(started):
            process.terminate()
            process.wait()


def main() -> None:
    """Print one line for each way."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n\n')[0].strip())
    parser.add_argument('--hours', type=int, default=8, help='recordings of one hour')
    hours, cores = parser.parse_args().hours, len(os.sched_getaffinity(0))
    with tempfile.TemporaryDirectory() as folder:
        files = [write_recording(Path(folder, f'unit{number}'), hour(number), storage='mcap',
                                 compression='zstd') for number in range(hours)]
        print(f'{hours} recordings of an hour at {RATE_HZ} Hz, on {cores} cores')
        for jobs in dict.fromkeys((1, cores)):
            wall, processor = seconds('analyze', *map(str, files), '--jobs', str(jobs),
                                      '--output', str(Path(folder, f'jobs{jobs}')))
            print(f'  --jobs {jobs}: {wall:.1f} s, processor {processor:.1f} s, efficiency '
                  f'{processor / wall / jobs:.2f}; 10,000 h: {processor / hours / 0.36:.1f} h of '
                  'processor time', flush=True)
        with cluster(cores) as address:
            wall, _ = seconds('analyze', *map(str, files), '--dask', address,
                              '--output', str(Path(folder, 'dask')))
        print(f'  --dask with {cores} workers: {wall:.1f} s')


if __name__ == '__main__':
    main()
