# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A recording in, a result out: where it begins."""

from imu_allan.analysis import analyze
from imu_allan.errors import ImuAllanError
from imu_allan.noise.simulate import simulate
import numpy as np
import pytest

RATE = 5.0
TIME = np.arange(36_000) / RATE


@pytest.fixture
def written(tmp_path):
    def write(settling):
        noise = simulate({'noise_density': 1e-3, 'bias_instability': 1e-3}, len(TIME), RATE, 1)
        path = tmp_path / 'imu.csv'
        np.savetxt(path, np.column_stack((TIME, noise + settling)), fmt='%.9g', delimiter=',',
                   header='time_s,gyro_x', comments='')
        return path
    return write


def test_start_auto_leaves_out_the_warm_up(written):
    path = written(0.02 * np.exp(-TIME / 500))
    cold, warm = analyze(path), analyze(path, start_s='auto')
    [told] = [one.message for one in warm.warnings if one.code == 'start_auto']
    assert told.endswith(' were left out: the sensor warmed up')
    assert 20 <= float(told.split()[2]) <= 50
    assert cold.axes['gyro_x'].trend.warm_up is not None
    assert warm.axes['gyro_x'].trend.warm_up is None
    assert 3000 < warm.timeline.duration_s < 6000
    assert not warm.axes['gyro_x'].coefficients['rate_random_walk'].observable


def test_start_auto_leaves_nothing_out_where_nothing_settles(written):
    result = analyze(written(0.0), start_s='auto')
    [told] = [one.message for one in result.warnings if one.code == 'start_auto']
    assert told == 'no warm-up was found: the recording is used from its beginning'
    assert result.timeline.duration_s == pytest.approx(7200, abs=1)


def test_start_auto_is_refused_for_several_recordings(written):
    path = written(0.0)
    with pytest.raises(ImuAllanError, match='of several give the time to leave out'):
        analyze([path, path], start_s='auto')
