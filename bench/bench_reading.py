# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Time of reading recordings, over a plain pass through the same file in the same run.

Wall time is what a user waits for, processor time what it costs where the second core is busy.

The plain pass of an MCAP file reads and decompresses every chunk with the library that imu_allan
uses and looks at nothing; that of a sqlite3 bag fetches every row. Passes alternate, so that what
else the machine does falls on both; the medians of the ratios are printed.

    python bench/bench_reading.py [--messages 1000000] [--repeats 7]
"""

import argparse
from collections.abc import Callable, Iterator
from contextlib import closing
import os
from pathlib import Path
import sqlite3
import tempfile
import time

from imu_allan.block import ImuBlock
from imu_allan.recordings import choose_topic, open_recording, read_blocks
from imu_allan.recordings.write import write_recording
from mcap.data_stream import ReadDataStream
from mcap.reader import make_reader
from mcap.records import Chunk
import numpy as np
import zstandard

_STEP = 1 / 1024 / 16.4
KINDS = (('mcap', 'zstd'), ('mcap', ''), ('sqlite3', ''))


def white_noise(messages: int, rate_hz: float = 1000.0) -> Iterator[ImuBlock]:
    """
    Yield blocks of white noise in all six axes at an even rate, in the steps of a 16-bit output.

    Steps matter: a real sensor's doubles repeat and compress; drawn at full precision they would
    not, and decompressing would cost next to nothing.
    """
    noise = np.random.default_rng(1)
    for start in range(0, messages, 1 << 14):
        index = np.arange(start, min(start + (1 << 14), messages), dtype=np.int64)
        stamps = 1_700_000_000_000_000_000 + index * round(1e9 / rate_hz)
        yield ImuBlock(
            stamps, stamps + noise.integers(0, 100_000, len(index)),
            np.round(noise.normal(size=(len(index), 6)) * 20) * _STEP,
            np.zeros((len(index), 2), np.bool_), 'imu_link')


def read_all(path: Path) -> int:
    """Messages read through imu_allan."""
    with open_recording(path) as recording:
        return sum(len(block) for block in read_blocks(recording, choose_topic(recording)))


def plain_mcap_pass(path: Path) -> int:
    """Bytes of all chunks, read and decompressed."""
    plain = 0
    with path.open('rb') as file:
        for index in make_reader(file).get_summary().chunk_indexes:
            file.seek(index.chunk_start_offset + 9)
            chunk = Chunk.read(ReadDataStream(file))
            if chunk.compression == 'zstd':
                plain += len(zstandard.decompress(chunk.data, chunk.uncompressed_size))
            else:
                plain += len(chunk.data)
    return plain


def plain_records_pass(path: Path) -> int:
    """Messages of an MCAP file, record by record as its library gives them, none decoded."""
    with path.open('rb') as file:
        return sum(1 for _ in make_reader(file).iter_messages(log_time_order=False))


def plain_sqlite_pass(path: Path) -> int:
    """Messages of all rows, fetched one by one."""
    with closing(sqlite3.connect(path)) as database:
        return sum(1 for _ in database.execute(
            'SELECT timestamp, data FROM messages ORDER BY id'))


def seconds(run: Callable[[Path], int], path: Path) -> tuple[float, float]:
    """Wall and processor time of one run, that of processes it started included."""
    wall, processor = time.perf_counter(), sum(os.times()[:4])
    run(path)
    return time.perf_counter() - wall, sum(os.times()[:4]) - processor


def main() -> None:
    """Print one line for each container."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--messages', type=int, default=1_000_000)
    parser.add_argument('--repeats', type=int, default=7)
    options = parser.parse_args()
    print(f'{options.messages} messages, medians of {options.repeats} runs')
    with tempfile.TemporaryDirectory(prefix='bench_reading_') as folder:
        for storage, compression in KINDS:
            name = f'{storage} {compression}'.strip()
            bag = write_recording(
                Path(folder, name), white_noise(options.messages), storage=storage,
                compression=compression)
            [file] = (path for path in bag.iterdir() if path.suffix != '.yaml')
            plain = plain_sqlite_pass if storage == 'sqlite3' else plain_mcap_pass
            times = np.array([(seconds(plain, file), seconds(read_all, bag))
                              for _ in range(options.repeats)])
            wall, processor = np.median(times[:, 1] / times[:, 0], axis=0)
            passed, read = np.median(times[:, :, 0], axis=0)
            print(f'{name:10s} plain pass {passed:6.3f} s   blocks {read:6.3f} s   '
                  f'ratio {wall:5.2f} wall, {processor:5.2f} processor')


if __name__ == '__main__':
    main()
