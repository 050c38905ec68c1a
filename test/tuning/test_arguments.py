# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What a caller may hand over by mistake, for every number that tuning takes."""

from fractions import Fraction

from drifting_axes import axis_of
import imu_allan
from imu_allan.errors import ImuAllanError
from imu_allan.tuning.arguments import LONGEST_S, SHORTEST_S
from imu_allan.tuning.tune import optimum
from imu_allan.writers.filters import Wishes
import numpy as np
import pytest

AXIS = axis_of(1e-3, 1e-5)
NO_NUMBERS = [None, 'text', '1', b'1', 1j, [1.0], {}, np.ones(2), 'x\n' * 10_000]
OUT_OF_RANGE = [0, -1.0, float('nan'), float('inf'), -float('inf'), 1e-31, 1e31, 10**400]

TIMES = {
    'aiding_interval_s': lambda time: imu_allan.tune(AXIS, time, 1e9),
    'coast_s': lambda time: imu_allan.tune(AXIS, 1e-6, time),
    'correlation_time_s': lambda time: imu_allan.assess(AXIS, 1e-3, 1e-5, correlation_time_s=time),
    'step_s': lambda time: imu_allan.state_space(AXIS, time),
    'horizons_s': lambda time: imu_allan.predicted_drift(AXIS, [1.0, time]),
    'calibration_s': lambda time: imu_allan.predicted_drift(AXIS, [1.0], time),
    'aiding_s': lambda time: Wishes(aiding_s=time),
}
NUMBERS = {
    'noise_density': lambda number: imu_allan.assess(AXIS, number, 1e-5),
    'random_walk': lambda number: imu_allan.assess(AXIS, 1e-3, number),
    'inflate N': lambda number: Wishes(inflate={'N': number}),
    'rate_hz': lambda number: Wishes(rate_hz=number),
}
# These may be left out.
OPTIONAL = {'correlation_time_s', 'aiding_s', 'rate_hz'}


@pytest.mark.parametrize('value', NO_NUMBERS + OUT_OF_RANGE, ids=lambda value: repr(value)[:12])
@pytest.mark.parametrize('name', [*TIMES, *NUMBERS])
def test_what_is_no_number_in_range_is_one_line_that_names_the_argument(name, value):
    if value is None and name in OPTIONAL:
        return
    with pytest.raises(ImuAllanError) as error:
        (TIMES | NUMBERS)[name](value)
    text = str(error.value)
    assert text.startswith(f'{name} must be ')
    assert '\n' not in text
    assert len(text) < 160


@pytest.mark.parametrize('value', [None, 'text', '1', b'12', 1.0, np.array(1.0)],
                         ids=lambda value: repr(value))
def test_horizons_are_a_sequence(value):
    with pytest.raises(ImuAllanError, match=r'^horizons_s must be a sequence of '):
        imu_allan.predicted_drift(AXIS, value)


@pytest.mark.parametrize('number', [np.float32(1), np.int64(1), Fraction(1), 1])
def test_any_kind_of_real_number_is_one(number):
    assert imu_allan.tune(AXIS, number) == imu_allan.tune(AXIS, 1.0)
    assert type(imu_allan.state_space(AXIS, number).step_s) is float
    assert imu_allan.predicted_drift(AXIS, [number], number) == imu_allan.predicted_drift(
        AXIS, [1.0], 1.0)


@pytest.mark.parametrize('function', [imu_allan.tune, optimum, imu_allan.predicted_drift,
                                      lambda axis: imu_allan.assess(axis, 1.0, 1.0),
                                      lambda axis: imu_allan.state_space(axis, 1.0)])
@pytest.mark.parametrize('axis', [None, 'gyro_x', 1.0, {}, np.ones(3)], ids=repr)
def test_what_is_no_axis_is_told(function, axis):
    with pytest.raises(TypeError, match=r'^expected an axis of a result, such as '):
        function(axis)


@pytest.mark.parametrize('inflate', [None, 'N=2', 2.0, [('N', 2.0)]])
def test_factors_are_a_mapping(inflate):
    with pytest.raises(ImuAllanError, match=r'^inflate takes factors of N and K'):
        Wishes(inflate=inflate)


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('known_s', [200.0, 1e4])
def test_the_ends_of_what_is_taken_give_numbers(known_s):
    """A filter that is corrected every microsecond forgets less than a double shows beside 1."""
    axis = axis_of(1e-3, 1e-5, ((3e-4, 30.0),), known=(0.1, known_s),
                   quantity='linear_acceleration')
    for aiding, coast in ((SHORTEST_S, LONGEST_S), (SHORTEST_S, SHORTEST_S),
                          (LONGEST_S, LONGEST_S)):
        for bias in ('random_walk', 'gauss_markov'):
            for conservative in (False, True):
                found = imu_allan.tune(axis, aiding, coast, bias, conservative)
                assert np.isfinite(found.consistency).all()
        assert np.isfinite(optimum(axis, aiding, coast)).all()
        forecast = imu_allan.predicted_drift(axis, [aiding, coast], coast)
        assert np.isfinite([*forecast.integral, *forecast.position]).all()
        assert np.isfinite([*forecast.integral_ci95, *forecast.position_ci95]).all()
