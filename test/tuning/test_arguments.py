# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What a caller may hand over by mistake, for every number that tuning takes."""


from drifting_axes import axis_of
import imu_allan
from imu_allan.tuning.arguments import LONGEST_S, SHORTEST_S
from imu_allan.tuning.tune import optimum
from imu_allan.writers.filters import ExportOptions
import numpy as np
import pytest
from whole_lines import refused

AXIS = axis_of(1e-3, 1e-5)
NO_NUMBERS = [(None, 'None'), ('1', "'1'"), (True, 'True'), (np.ones(2), 'array([1., 1.])'),
              ('x\n' * 10_000, "'" + 9 * 'x\\n' + 'x…n' + 9 * 'x\\n' + "'")]
NOT_POSITIVE = [(0, '0'), (float('nan'), 'nan'), (10**400, 'inf')]
OUT_OF_RANGE = [(1e-31, '1e-31'), (1e31, '1e+31')]

TIMES = {
    'aiding_interval_s': [lambda time: imu_allan.tune(AXIS, time, 1e9),
                          lambda time: optimum(AXIS, time, 1e9),
                          lambda time: imu_allan.assess(AXIS, 1e-3, 1e-5, time, 1e9)],
    'coast_s': [lambda time: imu_allan.tune(AXIS, 1e-6, time),
                lambda time: optimum(AXIS, 1e-6, time),
                lambda time: imu_allan.assess(AXIS, 1e-3, 1e-5, 1e-6, time)],
    'correlation_time_s': [
        lambda time: imu_allan.assess(AXIS, 1e-3, 1e-5, correlation_time_s=time),
        lambda time: imu_allan.tune(AXIS, bias='gauss_markov', correlation_time_s=time)],
    'step_s': [lambda time: imu_allan.state_space(AXIS, time)],
    'horizons_s': [lambda time: imu_allan.predicted_drift(AXIS, [1.0, time])],
    'calibration_s': [lambda time: imu_allan.predicted_drift(AXIS, [1.0], time)],
    'aiding_s': [lambda time: ExportOptions(aiding_s=time)],
}
NUMBERS = {
    'noise_density': [lambda number: imu_allan.assess(AXIS, number, 1e-5)],
    'random_walk': [lambda number: imu_allan.assess(AXIS, 1e-3, number)],
    'inflate N': [lambda number: ExportOptions(inflate={'N': number})],
    'rate_hz': [lambda number: ExportOptions(rate_hz=number)],
}
# These may be left out.
OPTIONAL = {'correlation_time_s', 'aiding_s', 'rate_hz'}


@pytest.mark.parametrize('name', [*TIMES, *NUMBERS])
def test_what_is_no_number_in_range_is_one_line_that_names_the_argument(name):
    positive, between, unit = (
        ('a positive time', 'between a microsecond and a hundred years', ' s') if name in TIMES
        else ('above zero', 'between 1e-30 and 1e+30', ''))
    said = [*((value, f'{positive}, not {shown}') for value, shown in NO_NUMBERS),
            *((value, f'{positive}, not {shown}{unit}') for value, shown in NOT_POSITIVE),
            *((value, f'{between}, not {shown}{unit}') for value, shown in OUT_OF_RANGE)]
    for value, line in said:
        for takes in (TIMES | NUMBERS)[name] if value is not None or name not in OPTIONAL else ():
            with refused(f'{name} must be {line}'):
                takes(value)


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
