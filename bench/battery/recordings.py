# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Real recordings at rest, whole, by halves and by quarters.

Nobody knows their coefficients. Where intervals are honest, the chi-square of a coefficient
between quarters is one per degree of freedom, and the whole does not contradict both halves.
"""

from collections.abc import Iterator, Sequence
import os
from pathlib import Path
import sys

from battery import doors
from battery.doors import Answer, Said
from battery.sensors import Array, B, K, N
import numpy as np

QUANTITY = {'gyro': 'angular_velocity', 'accel': 'linear_acceleration'}


def axes() -> Iterator[tuple[str, str, Array, float]]:
    """
    Give recording, axis, samples and rate of everything at rest below IMU_ALLAN_DATA.

    Those are two ADIS16405 where the folder holds them, beside others in motion; else all.
    """
    from imu_allan.recordings import choose_topic, open_recording, read_blocks, recordings_in
    folder = os.environ.get('IMU_ALLAN_DATA')
    if not folder:
        print('IMU_ALLAN_DATA names no folder: no real recordings', file=sys.stderr)
        return
    known = sorted(path for path in Path(folder).glob('adis16405_*') if path.is_dir())
    for path in known or recordings_in(folder):
        with open_recording(path) as recording:
            blocks = list(read_blocks(recording, choose_topic(recording)))
        samples = np.concatenate([block.samples for block in blocks])
        stamps = np.concatenate([block.header_ns for block in blocks])
        rate_hz = (len(stamps) - 1) / (float(stamps[-1] - stamps[0]) * 1e-9)
        names = [f'{sensor} {letter}' for sensor in QUANTITY for letter in 'xyz']
        absent = np.concatenate([block.absent for block in blocks]).any(axis=0).repeat(3)
        for name, column in zip(np.array(names)[~absent], samples.T[~absent], strict=True):
            yield path.name, str(name), np.ascontiguousarray(column), rate_hz


def of_axis(path: str, name: str, samples: Array, rate_hz: float) -> list[dict[str, object]]:
    """Characterize a whole axis, its halves and its quarters."""
    sensor = name.partition(' ')[0]

    def parts(count: int) -> list[Answer]:
        return [doors.of_samples(part, rate_hz, QUANTITY[sensor])
                for part in np.array_split(samples, count)]

    [whole], halves, quarters = parts(1), parts(2), parts(4)
    terms: dict[str, dict[str, object]] = {}
    for key in (N, B, K):
        chi_square, freedom = disagreement([one.terms[key] for one in quarters])
        mine = whole.terms[key]
        terms[key] = {'value': mine.value, 'interval': mine.interval, 'bound': mine.bound,
                      'chi_square': chi_square, 'freedom': freedom,
                      'contradicts': contradicts(mine, [one.terms[key] for one in halves])}
    answers = [whole, *halves, *quarters]
    return [{'part': 'recordings', 'family': sensor, 'case': f'{path} {name}', 'seed': 0,
             'cpu_s': sum(one.cpu_s for one in answers) / len(answers), 'codes': whole.codes,
             'terms': terms}]


def disagreement(found: Sequence[Said]) -> tuple[float, int]:
    """Return chi-square and degrees of freedom of the values that there are."""
    seen = [(one.value, one.interval) for one in found
            if one.value is not None and one.interval is not None]
    if len(seen) < 2:
        return 0.0, 0
    value = np.array([one for one, _ in seen])
    low, high = np.array([interval for _, interval in seen]).T
    mean = float(np.average(value, weights=(high - low)**-2.0))
    for _ in range(20):
        # An interval is not symmetric: what counts is its side towards the mean.
        error = np.where(value > mean, value - low, high - value) / 1.96
        mean = float(np.average(value, weights=error**-2.0))
    return float((((value - mean) / error)**2).sum()), len(value) - 1


def contradicts(whole: Said, halves: Sequence[Said]) -> bool | None:
    """Whether a value lies outside the intervals of both halves, or above their bounds."""
    if whole.value is None:
        return None
    return all(not half.interval[0] <= whole.value <= half.interval[1]
               if half.interval is not None
               else half.bound is not None and whole.value > half.bound for half in halves)
