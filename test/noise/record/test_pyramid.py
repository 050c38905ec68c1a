# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from imu_allan.noise.record.pyramid import OVERLAP, Pyramid
import numpy as np
import pytest

RECORD = np.random.default_rng(3).standard_normal((2, 700))


def second_differences(samples, size, stride):
    """Return the differences of neighbouring sums of `size` samples."""
    phase = np.concatenate((np.zeros((2, 1)), np.cumsum(samples, axis=1)), axis=1)
    return (phase[:, 2 * size:] - 2 * phase[:, size:-size] + phase[:, :-2 * size])[:, ::stride]


@pytest.mark.parametrize('parts', [[700], [1] * 700, [3, 250, 1, 446], [15, 16, 17, 652]])
def test_every_octave_holds_the_differences_at_an_eighth_of_its_size(parts):
    pyramid = Pyramid(2)
    for part in np.split(RECORD, np.cumsum(parts)[:-1], axis=1):
        pyramid.absorb(part)
    assert OVERLAP == 8
    for octave, count in enumerate(pyramid.counts.tolist()):
        size = 2**octave
        if 2 * size > RECORD.shape[1]:
            assert count == 0
            continue
        expected = second_differences(RECORD, size, max(1, size // 8))
        assert count == expected.shape[1]
        np.testing.assert_allclose(pyramid.sums[octave], np.sum(expected**2, axis=1))
