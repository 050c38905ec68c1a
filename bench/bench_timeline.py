# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
CPU time of the timeline per message, in nanoseconds: clean and faulty, offline and live.

Beside it stands the time of one copy of the same samples, as a measure of the machine.

    python bench/bench_timeline.py [--messages 1000000] [--rate 1000]
"""

import argparse
import time

from imu_allan.block import ImuBlock
from imu_allan.timeline import TimelineOptions, TimelineStage
import numpy as np
from numpy.typing import NDArray

START_NS = 1_700_000_000_000_000_000


def messages(count: int, rate_hz: float, kind: str) -> ImuBlock:
    """Give messages of an IMU at rest, with the faults of `kind`."""
    noise = np.random.default_rng(1)
    places = np.arange(count)
    if 'drops' in kind:
        places = places[noise.random(count) >= 0.01]
    interval_ns = 1e9 / rate_hz
    late = np.zeros(len(places))
    if 'jitter' in kind:
        late = noise.exponential(0.15 * interval_ns, len(places))
    # One message after the other: a late one holds up the next.
    least = np.arange(len(places)) * 0.01 * interval_ns
    header = START_NS + np.rint(
        np.maximum.accumulate(places * interval_ns + late - least) + least).astype(np.int64)
    samples = noise.normal(size=(len(places), 6)) * 0.01
    samples[:, 5] += 9.81
    return ImuBlock(header, header + noise.integers(0, 100_000, len(header)), samples,
                    np.zeros((len(header), 2), dtype=bool), 'imu_link')


def cpu_ns_per_message(block: ImuBlock, size: int, motion: str) -> float:
    """Push the messages in blocks of `size`; give the CPU time of each."""
    blocks = [block.part(slice(first, first + size)) for first in range(0, len(block), size)]
    stage = TimelineStage(TimelineOptions(motion='keep' if motion == 'keep' else 'exclude'))
    begin = time.process_time()
    for part in blocks:
        stage.push(part)
    stage.flush()
    return (time.process_time() - begin) / len(block) * 1e9


def cpu_ns_per_copy(samples: NDArray[np.float64]) -> float:
    """Copy the samples in windows; give the CPU time of each row."""
    begin = time.process_time()
    for first in range(0, len(samples), 4096):
        samples[first:first + 4096].copy()
    return (time.process_time() - begin) / len(samples) * 1e9


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--messages', type=int, default=1_000_000)
    parser.add_argument('--rate', type=float, default=1000.0)
    options = parser.parse_args()
    print(f'{options.messages} messages at {options.rate:g} Hz, CPU ns per message, best of 5')
    for kind in ('clean', 'drops', 'jitter', 'jitter and drops'):
        block = messages(options.messages, options.rate, kind)
        for size, motion in ((16384, 'exclude'), (16384, 'keep'), (50, 'exclude')):
            best = min(cpu_ns_per_message(block, size, motion) for _ in range(5))
            print(f'{kind:17s} blocks of {size:5d}, motion {motion:8s}{best:8.0f}')
    print(f'one copy of the samples {min(cpu_ns_per_copy(block.samples) for _ in range(5)):29.0f}')


if __name__ == '__main__':
    main()
