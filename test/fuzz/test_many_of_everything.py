# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Very many gaps: time grows with their number, memory does not."""

from collections.abc import Iterator
from pathlib import Path

from imu_allan.block import ImuBlock
from imu_allan.recordings.write import write_recording
from measured_command import run
import numpy as np
import pytest
from repeated import slow

START_S = 5.0
"""CPU time of a command that does nothing else, on a slow computer."""
LARGEST_KB = 300_000


def block(numbers: np.ndarray) -> ImuBlock:
    """Give messages at rest at places of a grid of 100 Hz."""
    samples = np.random.default_rng(numbers[0]).normal(0, 0.01, (len(numbers), 6))
    samples[:, 5] += 9.8
    stamps = (10**18 + numbers * 10**7).astype(np.int64)
    return ImuBlock(stamps, stamps, samples, np.zeros((len(stamps), 2), bool), 'imu')


def with_gaps(count: int) -> Iterator[ImuBlock]:
    """Give so many gaps of 0.2 s, eight messages between two."""
    for first in range(0, 8 * count, 8000):
        numbers = np.arange(first, first + 8000)
        yield block(numbers + 20 * (numbers // 8))


@pytest.mark.parametrize('count', [1000, slow(100_000)])
def test_a_recording_of_many_parts_costs_the_process_time_in_proportion(
        tmp_path: Path, count: int) -> None:
    path = write_recording(tmp_path / 'gaps', with_gaps(count))
    _, out, error, seconds, kilobytes = run('analyze', path, '--no-progress', patience_s=3600.0)
    assert 'Traceback' not in error
    print(f'{count} gaps: {seconds:.1f} s of CPU, {kilobytes / 1000:.0f} MB')
    assert seconds < START_S + 0.002 * count
    assert kilobytes < LARGEST_KB
    # Of thousands the first are listed, in the file and on the page.
    assert len(out + error) < 20_000
