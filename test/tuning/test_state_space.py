# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The state space against numerical integrals of the processes, and in a Kalman filter."""

from dataclasses import replace

from drifting_axes import axis_of
from imu_allan.tuning.kalman import steady_covariance
from imu_allan.tuning.state_space import state_space
import numpy as np
import pytest
from whole_lines import refused


def integrated(kernel, step, points=2000):
    """Variance of the mean over a step, and covariance of it with start and end."""
    time = (np.arange(points) + 0.5) * step / points
    return (float(kernel(time[:, None], time[None, :]).mean()), float(kernel(0.0, time).mean()),
            float(kernel(step, time).mean()))


@pytest.mark.parametrize('step', [0.05, 1.0, 20.0])
@pytest.mark.parametrize('time', [0.3, 8.0, 5000.0])
def test_a_process_has_the_moments_of_its_integral_over_the_step(step, time):
    sigma = 2.0
    mean, start, end = integrated(lambda u, v: sigma**2 * np.exp(-np.abs(u - v) / time), step)
    space = state_space(axis_of(0.0, 0.0, ((sigma, time),)), step)
    e, a = space.transition[0, 0], space.observation[0, 0]
    assert e == pytest.approx(np.exp(-step / time))
    assert sigma**2 * a == pytest.approx(start, rel=1e-4)
    assert space.measurement[0, 0] + sigma**2 * a**2 == pytest.approx(mean, rel=1e-4)
    assert space.cross[0, 0] + sigma**2 * e * a == pytest.approx(end, rel=1e-4)
    assert space.process[0, 0] == pytest.approx(sigma**2 * (1 - e**2))
    assert space.initial[0, 0] == sigma**2


def test_the_rest_of_a_slow_process_keeps_its_digits():
    """What is left over of a mean far shorter than the process must not be rounding error."""
    space = state_space(axis_of(0.0, 0.0, ((1.0, 1e6),)), 0.1)
    assert space.measurement[0, 0] == pytest.approx(2 / 3 * 1e-7, rel=1e-6)


def test_the_random_walk_has_the_moments_of_its_integral_over_the_step():
    step, walk = 4.0, 3.0
    mean, start, end = integrated(lambda u, v: walk**2 * np.minimum(u, v), step)
    space = state_space(axis_of(0.0, walk), step)
    assert start == 0
    assert space.measurement[0, 0] == pytest.approx(mean, rel=1e-3)
    assert space.cross[0, 0] == pytest.approx(end, rel=1e-3)
    assert space.process[0, 0] == pytest.approx(walk**2 * step)
    assert space.transition[0, 0] == space.observation[0, 0] == 1


def test_white_noise_and_lines_stand_in_the_measurement():
    space = state_space(axis_of(2.0, tones=((0.25, 3.0),)), 2.0)
    # sinc^2(1/2) = (2/pi)^2
    assert space.measurement[0, 0] == pytest.approx(4 / 2 + 9 / 2 * (2 / np.pi) ** 2)


def test_a_bias_that_does_not_move_is_known_in_the_end():
    space = state_space(axis_of(1e-3, 0.0, ((4e-4, 20.0),)), 1.0)
    assert steady_covariance(space)[1, 1] == pytest.approx(0, abs=1e-20)


@pytest.mark.parametrize(('step', 'line'), [
    (0.1, 'step_s 0.1 s is below 0.4 s, the band edge. This recording does not know how the '
     'sensor drifts faster; choose a longer step'),
    (3600.0, 'step_s 3600 s is beyond 100 s, a third of the recording. It does not know how the '
     'sensor drifts over longer; choose a shorter step')])
def test_a_step_that_is_not_known_is_refused(step, line):
    axis = axis_of(1.0, known=(0.4, 100.0))
    assert state_space(axis, 100.0).step_s == 100.0
    with refused(line):
        state_space(axis, step)


def test_an_axis_without_a_drift_model_is_reported():
    axis = replace(axis_of(1.0), drift_model=None)
    with refused('this axis has no drift model (it is constant, too short, or from a result of '
                 'an older version): analyze the recording again'):
        state_space(axis, 1.0)
