# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The columns of a log of an autopilot to blocks of samples.

A table is one array of equal length a column. Which columns are the samples, and how they are
scaled, is said by `imu_allan.recordings.messages.imu_fields`, as for messages.
"""

from collections.abc import Mapping
from typing import Any

from imu_allan.block import ImuBlock
from imu_allan.recordings.messages.imu_fields import Burst, ImuFields, Vector
import numpy as np
from numpy.typing import NDArray

Table = Mapping[str, NDArray[Any]]


def fastest(rates: Mapping[str, float], partner: Mapping[str, str]) -> tuple[str, ...]:
    """
    Choose the topic, or the pair of gyroscope and accelerometer, with the highest rate.

    Parameters
    ----------
    rates : mapping of str to float
        In Hz by topic; ``name.1`` is the second sensor of its kind.
    partner : mapping of str to str
        The accelerometer that belongs to each gyroscope on a topic of its own.

    """
    choices: dict[tuple[str, ...], float] = {}
    for name, rate in rates.items():
        base, dot, number = name.partition('.')
        if base in partner:
            other = f'{partner[base]}{dot}{number}'
            if other in rates:
                choices[name, other] = rate
        elif base not in partner.values():
            choices[(name,)] = rate
    return max(choices, key=lambda names: choices[names], default=())


def table_times(table: Table, fields: ImuFields) -> NDArray[np.int64]:
    """Return the times of all samples in nanoseconds."""
    stamp = next(stamp for stamp in fields.stamps if stamp.path in table)
    times = table[stamp.path].astype(np.int64) * stamp.unit_ns
    if fields.burst is None:
        return times
    before, kept = _within_burst(table, fields.burst, _width(table, fields))
    return (times[:, np.newaxis] - before)[kept]


def _width(table: Table, fields: ImuFields) -> int:
    [(_, vector)] = fields.vectors()
    return sum(name.startswith(f'{vector.paths[0]}[') for name in table)


def _within_burst(table: Table, burst: Burst, width: int,
                  ) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return how long before the stamp each sample of a burst is, and which are filled."""
    filled = table[burst.samples].astype(np.int64)[:, np.newaxis]
    number = np.arange(width)
    step_ns = np.nan_to_num(table[burst.step_us].astype(np.float64))[:, np.newaxis] * 1e3
    return np.rint((filled - 1 - number) * step_ns).astype(np.int64), number < filled


def table_block(table: Table, fields: ImuFields, factors: NDArray[np.float64]) -> ImuBlock:
    """Return all samples, times `factors` of shape (6,); the stamps are the receive time, too."""
    times = table_times(table, fields)
    samples = np.zeros((len(times), 6))
    absent = np.ones((len(times), 2), np.bool_)
    for first, vector in fields.vectors():
        samples[:, first:first + 3] = _vector(table, fields, vector)
        absent[:, first // 3] = False
    return ImuBlock(times, times, samples * factors, absent, '')


def _vector(table: Table, fields: ImuFields, vector: Vector) -> NDArray[np.float64]:
    if fields.burst is not None:
        width = _width(table, fields)
        _, kept = _within_burst(table, fields.burst, width)
        columns = [np.stack([table[f'{path}[{number}]'] for number in range(width)], axis=1)[kept]
                   for path in vector.paths]
        scale = (np.ones(kept.shape) if vector.scale is None else
                 np.broadcast_to(table[vector.scale].astype(np.float64)[:, None], kept.shape))
        return np.stack(columns, axis=1) * scale[kept][:, np.newaxis]
    values = np.stack([table[path] for path in vector.paths], axis=1).astype(np.float64)
    if vector.scale is not None:
        values *= table[vector.scale].astype(np.float64)[:, np.newaxis]
    if vector.per:
        seconds = table[vector.per].astype(np.float64) * 1e-6
        seconds[seconds == 0] = np.nan
        values /= seconds[:, np.newaxis]
    return values
