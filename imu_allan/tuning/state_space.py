# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The drift model as a state space of the mean rate over a step, exact for any step.

Integration over a step T gives, for a process of variance s^2 and correlation time tau, with
``e = exp(-T/tau)`` and ``a = (tau/T)(1 - e)``: transition e, observation a, process s^2 (1 - e^2),
cross s^2 a (1 - e), measurement s^2 (2 (tau/T)(1 - a) - a^2). A random walk is a process of
infinite tau, whose s^2 is K^2 tau/2: 1, 1, K^2 T, K^2 T/2 and K^2 T/3. White noise adds N^2/T to
the measurement, a line of amplitude A adds A^2/2 sinc^2.
"""

from dataclasses import dataclass, replace
from math import inf

from imu_allan.arrays import Array
from imu_allan.errors import ImuAllanError, positive_time
from imu_allan.noise.drift_model import drift_avar
from imu_allan.noise.gauss_markov_means import on_mean, rest_of_mean
from imu_allan.noise.terms import line_power
from imu_allan.result import AxisResult, DriftModel, Tone
import numpy as np


@dataclass(frozen=True, eq=False)
class StateSpace:
    """
    ``x' = transition x + w``, ``y = observation x + v``: y the mean rate over one step.

    Attributes
    ----------
    step_s : float
        Duration of the step, in seconds.
    transition : ndarray, shape (n, n)
        The states are the Gauss-Markov processes by increasing correlation time, then the random
        walk, all in the unit of a sample.
    observation : ndarray, shape (1, n)
    process : ndarray, shape (n, n)
        E[w w'].
    measurement : ndarray, shape (1, 1)
        E[v v].
    cross : ndarray, shape (n, 1)
        E[w v]: what moves a state during the step also moves the mean over the step.
    initial : ndarray, shape (n, n)
        Covariance of x before the first step. For a process it is the stationary variance; for the
        random walk, which is the unknown bias, a million times the variance of the first mean.

    Examples
    --------
    A filter that follows the bias of a gyroscope at rest and predicts it:

    >>> import numpy as np
    >>> import imu_allan
    >>> rates = imu_allan.simulate({'noise_density': 1e-3, 'rate_random_walk': 1e-5},
    ...                            60_000, 100.0)
    >>> axis = imu_allan.characterize(rates, 100.0)
    >>> s = imu_allan.state_space(axis, step_s=1.0)
    >>> x, P = np.zeros(len(s.transition)), s.initial
    >>> nis = []
    >>> for y in rates.reshape(-1, 100).mean(axis=1):
    ...     innovation = y - s.observation @ x
    ...     S = s.observation @ P @ s.observation.T + s.measurement
    ...     gain = (s.transition @ P @ s.observation.T + s.cross) / S
    ...     x = s.transition @ x + gain @ innovation
    ...     P = s.transition @ P @ s.transition.T + s.process - gain @ S @ gain.T
    ...     nis.append(float(innovation[0] ** 2 / S[0, 0]))
    >>> bool(0.85 < np.mean(nis) < 1.15)
    True

    """

    step_s: float
    transition: Array
    observation: Array
    process: Array
    measurement: Array
    cross: Array
    initial: Array


def drift_model_of(axis: AxisResult) -> DriftModel:
    """Return the drift model of an axis; ImuAllanError if it has none."""
    if not isinstance(axis, AxisResult):
        raise TypeError(f"expected an axis of a result, such as result.axes['gyro_x'], not "
                        f'{type(axis).__name__}')
    if axis.drift_model is None:
        raise ImuAllanError('this axis has no drift model (it is constant, too short, or from a '
                            'result of an older version): analyze the recording again')
    return axis.drift_model


def state_space(axis: AxisResult, step_s: float) -> StateSpace:
    """
    Return the state space of the mean rate over steps of a given length.

    Parameters
    ----------
    axis : AxisResult
        An axis object of a result, with a drift model.
    step_s : float
        Duration of the step in seconds, not below one sample interval.

    Returns
    -------
    StateSpace
        Exact for a step t. A process of (8) of docs/statistics.md decays by ``exp(-t/T)``, enters
        the mean with w(t/T) of (9) and is driven by ``sigma^2 (1 - exp(-2 t/T))``. The random walk
        is driven by ``K^2 t``. The mean has ``N^2/t + K^2 t/3`` of its own, besides what the
        processes add.

    Raises
    ------
    ImuAllanError
        If the axis has no drift model, or the model does not cover the step.

    Examples
    --------
    >>> import imu_allan
    >>> rates = imu_allan.simulate({'noise_density': 1e-3}, 60_000, 100.0)
    >>> space = imu_allan.state_space(imu_allan.characterize(rates, 100.0), step_s=0.5)
    >>> space.observation.shape[0]
    1

    """
    model = drift_model_of(axis)
    step_s = positive_time('step_s', step_s)
    shortest_s = min([model.from_s, *axis.curve.tau_s[:1]])
    # It may be off by the rounding of a rate.
    if step_s < shortest_s * (1 - 1e-6):
        raise ImuAllanError(f'step_s {step_s:g} s is below {shortest_s:g} s, the shortest '
                            'averaging time of this recording; choose a longer step')
    if step_s > model.to_s * (1 + 1e-6):
        raise ImuAllanError(f'step_s {step_s:g} s is beyond {model.to_s:g} s, a third of the '
                            'recording. It does not know how the sensor drifts over longer; '
                            'choose a shorter step')
    space = space_of(model, axis.tones, step_s)
    return replace(space, measurement=space.measurement + above_band(axis, step_s))


def above_band(axis: AxisResult, interval_s: float) -> float:
    """Return the measured Allan variance in excess of the model, where that does not reach."""
    curve, model = axis.curve, drift_model_of(axis)
    if interval_s >= model.from_s * (1 - 1e-6) or not curve.tau_s:
        return 0.0
    measured = np.exp(2 * np.interp(np.log(interval_s), np.log(curve.tau_s),
                                    np.log(np.maximum(curve.adev, 1e-300))))
    return max(float(measured) - float(drift_avar(model, axis.tones, interval_s)), 0.0)


def over_step(driving: Array, time_s: Array, step_s: float | Array
              ) -> tuple[Array, Array, Array, Array, Array]:
    """
    Return transition, observation, process, cross and measurement of processes over a step.

    `driving`: squared driving density, ``2 s^2/tau`` or K^2. `time_s`: correlation time; infinite
    for a random walk.
    """
    added, x = driving * step_s, step_s / time_s
    a = on_mean(1.0, x)
    some = np.where(x > 0, x, 1.0)
    rest = np.where(x > 0, 1.5 * rest_of_mean(1.0, some) / some, 1.0)
    return np.exp(-x), a, added * on_mean(1.0, 2 * x), added / 2 * a**2, added / 3 * rest


def space_of(model: DriftModel, tones: tuple[Tone, ...], step_s: float) -> StateSpace:
    """Return the state space of a drift model and tones, for any step."""
    variance = np.array([process.sigma**2 for process in model.processes])
    time_s = np.array([process.correlation_time_s for process in model.processes])
    transition, observation, process, cross, rest = over_step(
        np.append(2 * variance / time_s, model.rate_random_walk**2), np.append(time_s, inf),
        step_s)
    measurement = (model.noise_density**2 / step_s + float(line_power(tones, step_s))
                   + float(rest.sum()))
    # In units of the variance of a measurement: one of these removes it, and a double keeps ten
    # digits.
    unknown = 1e6 * (measurement + float(variance.sum()))
    return StateSpace(step_s, np.diag(transition), observation[None], np.diag(process),
                      np.array([[measurement]]), cross[:, None],
                      np.diag(np.append(variance, unknown)))
