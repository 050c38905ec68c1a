# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The consumers: what writes their configuration, what corrects them, what bias they model."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
import os
from pathlib import Path

from imu_allan.errors import ImuAllanError, printable, shorten
from imu_allan.result import Result
from imu_allan.tuning.tune import Bias
from imu_allan.wording import listed
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

CAMERA = Aiding(0.05, 'camera frames at 20 Hz')
LIDAR = Aiding(0.1, 'lidar scans at 10 Hz')
SATELLITES = Aiding(1.0, 'satellite fixes at 1 Hz')
AUTOPILOT = Aiding(0.2, 'satellite fixes of an autopilot at 5 Hz')
SIMULATION = Aiding(1.0, 'a simulation shall drift like the sensor from a second on', 600.0)
ESTIMATOR = Aiding(0.1, 'an estimator at 10 Hz')
NO_BIAS = Aiding(None, 'the consumer has no bias state')
_HEADING, _BEGINNING = b', by imu_allan ', 16384
"""What every configuration says of itself, in its first bytes."""


@dataclass(frozen=True)
class FilterConfig:
    """
    A configuration file for one consumer.

    Attributes
    ----------
    name : str
        Suggested file name, different for every consumer.
    text : str

    """

    name: str
    text: str


@dataclass(frozen=True)
class Consumer:
    """
    A program that wants to know how noisy an IMU is.

    Attributes
    ----------
    write : callable
        Makes the text of the configuration of the numbers.
    file : str
        Suggested name of it, different for every consumer.
    aiding : Aiding
        What usually corrects it.
    bias : {'random_walk', 'gauss_markov'}
        What it takes the bias for.
    one_time : bool
        Whether it has one correlation time for all axes.
    share : {'axis', 'sensor', 'both', 'model'}
        What has numbers of its own in its file.

    """

    write: Callable[[Numbers], str]
    file: str
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
    Consumer(visual.kalibr, 'imu.yaml', CAMERA),
    Consumer(visual.openvins, 'kalibr_imu_chain.yaml', CAMERA),
    Consumer(visual.orb_slam3, 'orb_slam3_imu.yaml', CAMERA),
    Consumer(visual.vins_fusion, 'vins_fusion_imu.yaml', CAMERA),
    Consumer(lidar.lio_sam, 'lio_sam_imu.yaml', LIDAR),
    Consumer(lidar.fast_lio, 'fast_lio_imu.yaml', LIDAR),
    Consumer(graphs.gtsam, 'gtsam_imu.yaml', ESTIMATOR),
    Consumer(visual.basalt, 'basalt_imu.json', CAMERA, share='axis'),
    Consumer(visual.msckf_vio, 'msckf_vio_noise.yaml', CAMERA),
    Consumer(drivers.robot_localization, 'imu_covariance.yaml', NO_BIAS),
    Consumer(autopilots.px4, 'px4_imu.params', AUTOPILOT),
    Consumer(autopilots.ardupilot, 'ardupilot_imu.params', AUTOPILOT),
    Consumer(visual.vins_fusion_midpoint, 'vins_fusion_midpoint_imu.yaml', CAMERA),
    Consumer(lidar.lio_sam_ros1, 'lio_sam_ros1_imu.yaml', LIDAR),
    Consumer(visual.isaac_ros_vslam, 'isaac_ros_vslam_imu.yaml', CAMERA),
    Consumer(visual.okvis2, 'okvis2_imu.yaml', CAMERA),
    Consumer(visual.kimera, 'kimera_imu.yaml', CAMERA),
    Consumer(visual.maplab, 'maplab_imu.yaml', CAMERA),
    Consumer(visual.rovio, 'rovio_imu.info', CAMERA, share='axis'),
    Consumer(visual.svo_pro, 'svo_pro_imu.yaml', CAMERA),
    Consumer(visual.rtabmap, 'rtabmap_imu.yaml', CAMERA),
    Consumer(lidar.point_lio, 'point_lio_imu.yaml', LIDAR),
    Consumer(lidar.fast_livo2, 'fast_livo2_imu.yaml', LIDAR),
    Consumer(lidar.glim, 'glim_sensors.json', LIDAR, share='both'),
    Consumer(drivers.fusioncore, 'fusioncore_imu.yaml', SATELLITES),
    Consumer(satellites.kf_gins, 'kf_gins_imu.yaml', SATELLITES, 'gauss_markov', one_time=True,
             share='axis'),
    Consumer(satellites.ob_gins, 'ob_gins_imu.yaml', SATELLITES, 'gauss_markov', one_time=True),
    Consumer(satellites.navego, 'navego_imu.m', SATELLITES, 'gauss_markov', share='axis'),
    Consumer(satellites.psins, 'psins_imuerr.m', SATELLITES, 'gauss_markov', share='axis'),
    Consumer(simulators.gazebo, 'gazebo_imu.sdf', SIMULATION, 'gauss_markov', share='axis'),
    Consumer(simulators.rotors, 'rotors_imu.xml', SIMULATION, 'gauss_markov'),
    Consumer(simulators.matlab, 'imu_sensor.m',
             replace(NO_BIAS, reason='imuSensor models white noise, flicker and walk itself')),
    Consumer(simulators.airsim, 'airsim_imu.json', SIMULATION),
    Consumer(simulators.pegasus, 'pegasus_imu.py', SIMULATION, 'gauss_markov', one_time=True),
    Consumer(drivers.autoware, 'imu_corrector.param.yaml', NO_BIAS),
    Consumer(drivers.drivers, 'imu_drivers.yaml', NO_BIAS),
    Consumer(graphs.plain, 'imu_noise.yaml', ESTIMATOR, share='axis'),
    Consumer(graphs.state_space, 'state_space.json', ESTIMATOR, share='model'),
    Consumer(graphs.state_space_cpp, 'state_space.hpp', ESTIMATOR, share='model'),
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
    return FilterConfig(known.file, known.write(numbers))


def left_from_before(path: str | os.PathLike[str]) -> str:
    """
    Say what is to be said of a file in the place of a configuration that cannot be made.

    It is left alone: who knows whose it is, or of which result. But beside a new result it looks
    like one of that.

    Parameters
    ----------
    path : path
        Where the configuration was to go.

    Returns
    -------
    str
        The end of a message; empty where nothing stands there.

    """
    if not Path(path).is_file():
        return ''
    return f'; {printable(path)} stands there from before and was not replaced'


def left_from_earlier(folder: str | os.PathLike[str], exports: Sequence[str] = ()) -> str:
    """
    Say which configurations in a folder are not of the result that was saved there last.

    They are left alone, but beside a new result they look like those of it.

    Parameters
    ----------
    folder : path
        Where a result was saved.
    exports : sequence of str, optional
        Consumers whose configurations belong to that.

    Returns
    -------
    str
        Empty where there are none; what stands under the name of a configuration and was not
        written by this program is none.

    """
    folder = Path(folder)
    old = [consumer for name, consumer in CONSUMERS.items()
           if name not in exports and _is_configuration(folder / consumer.file)]
    if not old:
        return ''
    files = listed([consumer.file for consumer in old])
    again = ' '.join(f'--for {consumer.name}' for consumer in old)
    return (f'{printable(str(folder))}: {files} {"is" if len(old) == 1 else "are"} of an earlier '
            f'result and {"was" if len(old) == 1 else "were"} not replaced; {again} writes '
            f'{"it" if len(old) == 1 else "them"} anew')


def _is_configuration(path: Path) -> bool:
    if not path.is_file():
        return False
    try:
        with path.open('rb') as file:
            return _HEADING in file.read(_BEGINNING)
    except OSError:
        # What this user cannot read no filter of theirs takes for new.
        return False
