# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The same messages are recognised in another recording, whatever their stamps."""

from imu_allan.block import ImuBlock
from imu_allan.recordings.same_recording import Fingerprint
import numpy as np
import pytest

COUNT = 20_000


def recording(stamps, samples, rows=slice(None)):
    stamps, samples = stamps[rows], samples[rows]
    fingerprint = Fingerprint()
    list(fingerprint.watch([ImuBlock(stamps, stamps, samples,
                                     np.zeros((len(stamps), 2), np.bool_), 'imu')]))
    return fingerprint


@pytest.fixture(scope='module')
def samples():
    return np.random.default_rng(0).normal(size=(COUNT, 6))


@pytest.mark.parametrize('batch', [1, 5])
@pytest.mark.parametrize('rows', [slice(5001, None), np.delete(np.arange(COUNT), 6000)],
                         ids=['part from within a batch', 'one lost'])
def test_a_part_is_recognised_where_batches_share_a_stamp(samples, batch, rows):
    stamps = 10**18 + np.arange(COUNT) // batch * batch * 10_000_000
    assert recording(stamps, samples).shares_messages_with(recording(stamps, samples, rows))


@pytest.mark.parametrize('batch', [1, 2, 8, 100, COUNT])
@pytest.mark.parametrize('step', [1, 2])
def test_coarse_values_of_one_batch_are_not_the_same_by_chance(samples, batch, step):
    stamps = 10**18 + np.arange(COUNT) // batch * batch * 10_000_000
    coarse = np.round(samples / step) * step
    coarse[:, 3:] = np.nan
    assert not recording(stamps, coarse).shares_messages_with(recording(stamps, coarse[::-1]))


def test_stamps_that_are_all_equal_take_no_memory(samples):
    stamps = np.full(COUNT, 7)
    fingerprint = Fingerprint()
    block = ImuBlock(stamps, stamps, samples, np.zeros((COUNT, 2), np.bool_), 'imu')
    list(fingerprint.watch([block] * 20))
    # The limit and one block more.
    assert fingerprint.kept <= 2**18 + COUNT
