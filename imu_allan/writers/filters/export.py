# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The consumers: what writes their configuration, what corrects them, what bias they model."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from imu_allan.errors import ImuAllanError, printable, shorten
from imu_allan.result import Result
from imu_allan.tuning.tune import Bias
from imu_allan.writers.consumer_names import CONSUMER_TITLES
from imu_allan.writers.filters import (
    autopilots,
    drivers,
    graphs,
    lidar,
    satellites,
    simulators,
    visual,
)
from imu_allan.writers.filters.chosen_numbers import Aiding, Numbers, Share, Wishes
from imu_allan.writers.filters.layout import FilterConfig

CAMERA = Aiding(0.05, 'camera frames at 20 Hz')
LIDAR = Aiding(0.1, 'lidar scans at 10 Hz')
SATELLITES = Aiding(1.0, 'satellite fixes at 1 Hz')
AUTOPILOT = Aiding(0.2, 'satellite fixes of an autopilot at 5 Hz')
SIMULATION = Aiding(1.0, 'a simulation shall drift like the sensor from a second on', 600.0)
ESTIMATOR = Aiding(0.1, 'an estimator at 10 Hz')
NO_BIAS = Aiding(None, 'the consumer has no bias state')


@dataclass(frozen=True)
class Consumer:
    """
    A program that wants to know how noisy an IMU is.

    Attributes
    ----------
    write : callable
        Makes the configuration of the numbers.
    aiding : Aiding
        What usually corrects it.
    bias : {'random_walk', 'gauss_markov'}
        What it takes the bias for.
    one_time : bool
        Whether it has one correlation time for all axes.
    share : {'axis', 'sensor', 'both', 'model'}
        What has numbers of its own in its file.

    """

    write: Callable[[Numbers], FilterConfig]
    aiding: Aiding
    bias: Bias = 'random_walk'
    one_time: bool = False
    share: Share = 'sensor'

    @property
    def name(self) -> str:
        """Name in the command."""
        return self.write.__name__

    @property
    def title(self) -> str:
        """Return the name as its authors write it."""
        return CONSUMER_TITLES[self.name]

    def __call__(self, result: Result, rate_hz: float | None = None) -> FilterConfig:
        """Return the configuration with tuned numbers."""
        return export(result, self.name, rate_hz)


_CONSUMERS = (
    Consumer(visual.kalibr, CAMERA),
    Consumer(visual.openvins, CAMERA),
    Consumer(visual.orb_slam3, CAMERA),
    Consumer(visual.vins_fusion, CAMERA),
    Consumer(lidar.lio_sam, LIDAR),
    Consumer(lidar.fast_lio, LIDAR),
    Consumer(graphs.gtsam, ESTIMATOR),
    Consumer(visual.basalt, CAMERA, share='axis'),
    Consumer(visual.msckf_vio, CAMERA),
    Consumer(drivers.robot_localization, NO_BIAS),
    Consumer(autopilots.px4, AUTOPILOT),
    Consumer(autopilots.ardupilot, AUTOPILOT),
    Consumer(visual.vins_fusion_midpoint, CAMERA),
    Consumer(lidar.lio_sam_ros1, LIDAR),
    Consumer(visual.isaac_ros_vslam, CAMERA),
    Consumer(visual.okvis2, CAMERA),
    Consumer(visual.kimera, CAMERA),
    Consumer(visual.maplab, CAMERA),
    Consumer(visual.rovio, CAMERA, share='axis'),
    Consumer(visual.svo_pro, CAMERA),
    Consumer(visual.rtabmap, CAMERA),
    Consumer(lidar.point_lio, LIDAR),
    Consumer(lidar.fast_livo2, LIDAR),
    Consumer(lidar.glim, LIDAR, share='both'),
    Consumer(satellites.kf_gins, SATELLITES, 'gauss_markov', one_time=True, share='axis'),
    Consumer(satellites.ob_gins, SATELLITES, 'gauss_markov', one_time=True),
    Consumer(satellites.navego, SATELLITES, 'gauss_markov', share='axis'),
    Consumer(satellites.psins, SATELLITES, 'gauss_markov', share='axis'),
    Consumer(simulators.gazebo, SIMULATION, 'gauss_markov', share='axis'),
    Consumer(simulators.rotors, SIMULATION, 'gauss_markov'),
    Consumer(simulators.matlab,
             replace(NO_BIAS, reason='imuSensor models white noise, flicker and walk itself')),
    Consumer(simulators.airsim, SIMULATION),
    Consumer(drivers.autoware, NO_BIAS),
    Consumer(drivers.drivers, NO_BIAS),
    Consumer(graphs.state_space, ESTIMATOR, share='model'),
    Consumer(graphs.state_space_cpp, ESTIMATOR, share='model'),
)
CONSUMERS: dict[str, Consumer] = {consumer.name: consumer for consumer in _CONSUMERS}


def export(result: Result, consumer: str, rate_hz: float | None = None,
           wishes: Wishes = Wishes()) -> FilterConfig:  # noqa: B008
    """
    Write the configuration of a filter.

    Parameters
    ----------
    result : Result
        Where the numbers come from.
    consumer : str
        One of `CONSUMERS`.
    rate_hz : float, optional
        Rate at which the consumer takes samples or predicts, for those whose numbers depend on
        it: by default the sample rate of the result, for an autopilot the usual prediction rate.
    wishes : Wishes, optional
        Tuned for the consumer's usual corrections when left out.

    Returns
    -------
    FilterConfig

    Raises
    ------
    ImuAllanError
        If `consumer` is not known, or needs a rate and the result has none, or the result has no
        number for it.
    TypeError
        If `result` is no result or `wishes` are none.

    """
    if not isinstance(result, Result):
        raise TypeError('expected a result, such as imu_allan.load_result gives, not '
                        f'{type(result).__name__}')
    if not isinstance(wishes, Wishes):
        raise TypeError(f'expected Wishes, not {type(wishes).__name__}')
    if not isinstance(consumer, str) or consumer not in CONSUMERS:
        raise ImuAllanError(f'no configuration is known for '
                            f'{shorten(printable(repr(consumer)), 60)}; '
                            f'known are {", ".join(CONSUMERS)}')
    known = CONSUMERS[consumer]
    if rate_hz is not None:
        wishes = replace(wishes, rate_hz=rate_hz)
    numbers = Numbers(result, consumer, known.title, known.aiding, known.bias, wishes,
                      known.one_time, known.share)
    return known.write(numbers)
