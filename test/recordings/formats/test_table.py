# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Columns of a log and messages with the same fields give the same samples."""

from imu_allan.cdr import MalformedImu
from imu_allan.recordings.formats.table import table_block
from imu_allan.recordings.messages.imu_fields import Burst, ImuFields, Stamp, Vector
import numpy as np

STAMPS = (Stamp('timestamp', 1000),)
TIMES = {'timestamp': np.array([1000, 2000, 3000], np.uint64)}


def samples(fields: ImuFields, columns: dict[str, np.ndarray]) -> np.ndarray:
    def refuse(_: int, error: MalformedImu) -> None:
        raise error

    return table_block({**TIMES, **columns}, fields, np.ones(6), refuse).samples


def test_a_factor_a_scale_and_a_duration_all_count():
    columns = {name: np.array([8, 16, -24], np.int16) for name in 'xyz'}
    columns |= {'scale': np.array([2.0, 4.0, 8.0], np.float32),
                'dt': np.array([500_000, 1_000_000, 0], np.uint32)}
    vector = Vector(('x', 'y', 'z'), factor=0.25, scale='scale', per='dt')
    assert samples(ImuFields(None, vector, STAMPS), columns)[:, 3:].tolist()[:2] == [
        [8.0] * 3, [16.0] * 3]
    assert np.isnan(samples(ImuFields(vector, None, STAMPS), columns)[2, :3]).all()


def test_a_factor_counts_in_a_burst():
    columns = {f'{axis}[{number}]': np.array([8, 16, 32], np.int16) * (number + 1)
               for axis in 'xyz' for number in range(2)}
    columns |= {'samples': np.array([2, 1, 2], np.uint8), 'dt': np.full(3, 100, np.float32)}
    vector = Vector(('x', 'y', 'z'), factor=0.25)
    fields = ImuFields(vector, None, STAMPS, burst=Burst('samples', 'dt'))
    assert samples(fields, columns)[:, 0].tolist() == [2, 4, 4, 8, 16]
