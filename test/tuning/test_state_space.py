# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""State space and predicted drift against integrals of the processes, and in a Kalman filter."""

from dataclasses import replace

from exact_results import axis_of
from imu_allan.noise.simulate import simulate
from imu_allan.tuning.backtest import run_filters
from imu_allan.tuning.forecast import predicted_drift
from imu_allan.tuning.state_space import state_space
import numpy as np
import pytest
from whole_lines import refused

KNOWN = axis_of(1.0, known=(0.4, 100.0))
BEFORE, AFTER, POINTS = 7.0, 20.0, 2700


def integrated(kernel, step):
    """Variance of the mean over a step, and covariance of it with start and end."""
    time = (np.arange(2000) + 0.5) * step / 2000
    return (float(kernel(time[:, None], time[None, :]).mean()), float(kernel(0.0, time).mean()),
            float(kernel(step, time).mean()))


@pytest.mark.parametrize('step', [0.05, 20.0])
@pytest.mark.parametrize('time', [0.3, 5000.0])
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


def test_the_random_walk_has_the_moments_of_its_integral_and_the_measurement_the_rest():
    step, walk = 4.0, 3.0
    mean, start, end = integrated(lambda u, v: walk**2 * np.minimum(u, v), step)
    space = state_space(axis_of(0.0, walk), step)
    assert start == 0
    assert space.measurement[0, 0] == pytest.approx(mean, rel=1e-3)
    assert space.cross[0, 0] == pytest.approx(end, rel=1e-3)
    assert space.process[0, 0] == pytest.approx(walk**2 * step)
    assert space.transition[0, 0] == space.observation[0, 0] == 1
    # White noise and a line, of which sinc^2(1/2) = (2/pi)^2 is left.
    space = state_space(axis_of(2.0, tones=((0.25, 3.0),)), 2.0)
    assert space.measurement[0, 0] == pytest.approx(4 / 2 + 9 / 2 * (2 / np.pi) ** 2)


@pytest.mark.parametrize(('axis', 'step', 'line'), [
    (KNOWN, 0.005, 'step_s 0.005 s is below 0.01 s, the shortest averaging time of this '
     'recording; choose a longer step'),
    (KNOWN, 3600.0, 'step_s 3600 s is beyond 100 s, a third of the recording. It does not know '
     'how the sensor drifts over longer; choose a shorter step'),
    (replace(KNOWN, drift_model=None), 1.0, 'this axis has no drift model (it is constant, too '
     'short, or from a result of an older version): analyze the recording again')])
def test_a_step_or_a_drift_that_is_not_known_is_refused(axis, step, line):
    assert state_space(KNOWN, 100.0).step_s == 100.0
    with refused(line):
        state_space(axis, step)


def test_above_the_band_of_the_drift_model_a_measurement_has_the_noise_of_the_curve():
    axis = axis_of(1.0, 0.1, known=(0.4, 100.0))
    louder = replace(axis, curve=replace(axis.curve, adev=tuple(2 * np.array(axis.curve.adev))))
    assert state_space(axis, 0.04).measurement == pytest.approx(1 / 0.04, rel=1e-3)
    assert state_space(louder, 0.04).measurement == pytest.approx(4 / 0.04, rel=1e-3)
    assert state_space(louder, 0.4).measurement == pytest.approx(1 / 0.4, rel=1e-2)


def test_innovations_of_a_true_model_are_white_and_of_the_predicted_size():
    terms = {'noise_density': 1e-3, 'rate_random_walk': 2e-5,
             'gauss_markov': {'sigma': 4e-4, 'correlation_time_s': 20.0}}
    samples = simulate(terms, 200_000, 10.0, seed=5)
    space = state_space(axis_of(1e-3, 2e-5, ((4e-4, 20.0),)), 1.0)
    found = run_filters([space], [samples.reshape(-1, 10).mean(axis=1)])
    z = (found.innovation[0] / np.sqrt(found.variance[0]))[1:]
    assert np.mean(z**2) == pytest.approx(1, abs=0.03)
    for lag in (1, 2, 5, 20):
        assert abs(np.mean(z[lag:] * z[:-lag])) < 0.03


def test_many_filters_run_as_each_does_alone():
    spaces = [state_space(axis_of(1e-3, 1e-5, ((4e-4, 20.0), (1e-4, 90.0))), 1.0),
              state_space(axis_of(2e-3), 1.0)]
    series = np.stack([simulate({'noise_density': 1e-3}, 50, 1.0, seed) for seed in (1, 2)])
    both = run_filters(spaces, series, {30})
    for lane, space in enumerate(spaces):
        alone = run_filters([space], series[lane:lane + 1], {30})
        n = len(space.transition)
        np.testing.assert_array_equal(both.innovation[lane], alone.innovation[0])
        np.testing.assert_allclose(both.variance[lane], alone.variance[0], rtol=1e-14)
        for together, own in zip(both.before[30], alone.before[30], strict=True):
            inside = (slice(n),) * own[0].ndim
            np.testing.assert_allclose(together[lane][inside], own[0], rtol=1e-12)
            assert not together[lane][n:].any()


def by_quadrature(kernel, position=False):
    """Root of the variance of what is integrated after zero, calibrated before."""
    step = (BEFORE + AFTER) / POINTS
    u = -BEFORE + (np.arange(POINTS) + 0.5) * step
    weight = np.where(u > 0, AFTER - u if position else 1.0,
                      -(AFTER**2 / 2 if position else AFTER) / BEFORE)
    return float(np.sqrt(weight @ kernel(u[:, None], u[None, :]) @ weight) * step)


def white(u, v):
    return (u == v) * 4.0 * POINTS / (BEFORE + AFTER)


def walk(u, v):
    return 0.09 * np.where(u * v > 0, np.minimum(np.abs(u), np.abs(v)), 0)


def markov(time):
    return lambda u, v: 0.25 * np.exp(-np.abs(u - v) / time)


@pytest.mark.parametrize(('terms', 'kernel'), [
    ({'noise_density': 2.0}, white), ({'walk': 0.3}, walk),
    *(({'processes': ((0.5, time),)}, markov(time)) for time in (0.8, 15.0, 300.0, 1e4))])
def test_angle_and_position_are_those_of_the_integrated_covariance(terms, kernel):
    axis = axis_of(**terms, quantity='linear_acceleration')
    forecast = predicted_drift(axis, [AFTER], BEFORE)
    assert forecast.integral[0] == pytest.approx(by_quadrature(kernel), rel=2e-3)
    assert forecast.position[0] == pytest.approx(by_quadrature(kernel, True), rel=2e-3)


def test_the_band_holds_the_value_and_widens_with_the_horizon():
    forecast = predicted_drift(axis_of(1e-3, 1e-5), [1.0, 60.0, 2000.0])
    widths = [high / low for low, high in forecast.integral_ci95]
    assert widths == sorted(widths)
    for value, (low, high) in zip(forecast.integral, forecast.integral_ci95, strict=True):
        assert low < value < high
    # A gyroscope has no position.
    assert forecast.position is forecast.position_ci95 is None
    assert predicted_drift(axis_of(1e-3)).horizons_s == (1.0, 10.0, 60.0, 600.0)
