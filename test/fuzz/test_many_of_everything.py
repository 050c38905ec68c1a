# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Many gaps, motions, files, remarks and lines: time grows with their number, memory does not."""

from collections.abc import Callable, Iterator
import json
from pathlib import Path

from bags import mcap_written, serialized
from imu_allan.analysis import analyze
from imu_allan.block import ImuBlock
from imu_allan.cdr import encode_imu_rows
from imu_allan.recordings.write import write_recording
from mcap.writer import CompressionType
from measured_command import run
import numpy as np
import pytest
from repeated import slow

START_S = 5.0
"""CPU time of a command that does nothing else, on a slow computer."""
LARGEST_KB = 300_000


def at_rest(first: int, count: int) -> np.ndarray:
    samples = np.random.default_rng(first).normal(0, 0.01, (count, 6))
    samples[:, 5] += 9.8
    return samples


def block(numbers: np.ndarray, samples: np.ndarray) -> ImuBlock:
    stamps = (10**18 + numbers * 10**7).astype(np.int64)
    return ImuBlock(stamps, stamps, samples, np.zeros((len(stamps), 2), bool), 'imu')


def with_gaps(folder: Path, count: int) -> Path:
    """Write a recording with so many gaps of 0.2 s, eight messages between two."""
    def blocks() -> Iterator[ImuBlock]:
        for first in range(0, 8 * count, 8000):
            numbers = np.arange(first, first + 8000)
            yield block(numbers + 20 * (numbers // 8), at_rest(first, 8000))

    return write_recording(folder / 'gaps', blocks())


def with_motion(folder: Path, count: int) -> Path:
    """Write a recording that is shaken so many times for 0.3 s, ten seconds apart."""
    def blocks() -> Iterator[ImuBlock]:
        for first in range(0, 1000 * count, 10_000):
            numbers = np.arange(first, first + 10_000)
            samples = at_rest(first, 10_000)
            shaken = numbers % 1000 < 30
            samples[shaken] += np.sin(numbers[shaken, None] * 0.7) * [.5, .4, .3, 2, 1.5, 1]
            yield block(numbers, samples)

    return write_recording(folder / 'motion', blocks())


def with_files(folder: Path, count: int) -> Path:
    """Write a bag that is split into so many files of ten messages."""
    bag = folder / 'split'
    bag.mkdir()
    for number in range(count):
        messages = block(np.arange(10 * number, 10 * number + 10), at_rest(number, 10))
        with mcap_written(bag / f'a_{number}.mcap', compression=CompressionType.NONE) as write:
            for stamp, row in serialized(messages):
                write('/imu', stamp, row)
    return bag


def with_topics(folder: Path, count: int) -> Path:
    """Write a recording of so many topics, 200 messages of each in turn."""
    rows = [encode_imu_rows(block(np.arange(200), at_rest(number, 200)))
            for number in range(count)]
    with mcap_written(folder / 'topics.mcap', compression=CompressionType.NONE) as write:
        for place in range(200):
            for number, messages in enumerate(rows):
                write(f'/imu_{number}', place, messages[place])
    return folder / 'topics.mcap'


@pytest.mark.parametrize(('written', 'count', 'each_s'), [
    (with_gaps, 1000, 0.002),
    slow(with_gaps, 100_000, 0.002),
    slow(with_motion, 3000, 0.006),
    slow(with_files, 20_000, 0.003),
    slow(with_topics, 300, 0.3)])
def test_a_recording_of_many_parts_costs_the_process_time_in_proportion(
        tmp_path: Path, written: Callable[[Path, int], Path], count: int, each_s: float) -> None:
    path = written(tmp_path, count)
    _, out, error, seconds, kilobytes = run(
        'analyze', path, '--no-progress', *['--all-topics'][:written is with_topics],
        patience_s=3600.0)
    assert 'Traceback' not in error
    print(f'{written.__name__} {count}: {seconds:.1f} s of CPU, {kilobytes / 1000:.0f} MB')
    assert seconds < START_S + each_s * count
    assert kilobytes < LARGEST_KB
    # Of thousands the first are listed, in the file and on the page; a topic has its line.
    assert len(out + error) < (150 * count if written is with_topics else 20_000)


@pytest.mark.parametrize('count', [2000, slow(100_000)])
@pytest.mark.parametrize('kind', ['warnings', 'tones'])
def test_a_result_of_many_remarks_or_lines_is_used_in_time(tmp_path: Path, kind: str,
                                                           count: int) -> None:
    path = write_recording(tmp_path / 'a', iter([block(np.arange(3000), at_rest(0, 3000))]))
    document = json.loads(analyze(path).to_json())
    if kind == 'warnings':
        document['warnings'] = [{'code': f'c{number}', 'message': f'{number} of many'}
                                for number in range(count)]
    else:
        document['axes']['gyro_x']['tones'] = [
            {'frequency_hz': 0.001 + number * 49 / count, 'amplitude': 1e-5}
            for number in range(count)]
    (tmp_path / 'result.json').write_text(json.dumps(document))
    (tmp_path / 'limits.yaml').write_text('gyro: {noise_density: 1 deg/sqrt(h)}\n')
    verbs = [('check', tmp_path / 'result.json', '--spec', tmp_path / 'limits.yaml')]
    if count > 2000:
        verbs += [('report', tmp_path / 'result.json', '--output', tmp_path / 'out', '--format',
                   'png'), ('export', tmp_path / 'result.json', '--for', 'kalibr')]
    for verb in verbs:
        status, out, error, seconds, kilobytes = run(*verb, patience_s=3600.0)
        print(f'{kind} {count}: {verb[0]} {seconds:.1f} s of CPU, {kilobytes / 1000:.0f} MB')
        assert status in (0, 3, 4), error
        assert 'Traceback' not in error
        assert seconds < START_S + 0.001 * count
        assert kilobytes < LARGEST_KB
        assert len(out + error) < 20_000
