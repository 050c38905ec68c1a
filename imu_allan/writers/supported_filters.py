# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Table of the programs that need the noise figures of an IMU.

The module imports no numerics, so that the command line can list them quickly. It uses tuples,
which take a third of the time of dataclasses to define at every start.
"""

from difflib import get_close_matches
from typing import Literal, NamedTuple

from imu_allan.errors import printable, shorten


class Aiding(NamedTuple):
    """
    Measurements that usually correct a consumer.

    Attributes
    ----------
    interval_s : float or None
        Interval in seconds; None for a consumer without a bias state, which gets the measured
        noise density.
    reason : str
    coast_s : float
        The longest unaided time in seconds; by default an outage in a tunnel.

    """

    interval_s: float | None
    reason: str
    coast_s: float = 60.0


CAMERA = Aiding(0.05, 'camera frames at 20 Hz')
LIDAR = Aiding(0.1, 'lidar scans at 10 Hz')
SATELLITES = Aiding(1.0, 'satellite fixes at 1 Hz')
AUTOPILOT = Aiding(0.2, 'satellite fixes of an autopilot at 5 Hz')
SIMULATION = Aiding(1.0, 'a simulation shall drift like the sensor from a second on', 600.0)
ESTIMATOR = Aiding(0.1, 'an estimator at 10 Hz')
NO_BIAS = Aiding(None, 'the consumer has no bias state')


class Consumer(NamedTuple):
    """
    A program that needs the noise figures of an IMU.

    Attributes
    ----------
    title : str
        Name as its authors write it.
    file : str
        Suggested name of its configuration file, unique among consumers.
    aiding : Aiding
        Measurements that usually correct it.
    bias : {'random_walk', 'gauss_markov'}
        How it models the bias.
    share : {'axis', 'sensor', 'both', 'model'}
        Which parts have separate numbers in the file. With 'sensor' they are those of its worst
        axis; with 'both' the sensors share the larger random walk. With 'model' the file holds the
        drift models themselves.
    one_time : bool
        Whether all axes share one correlation time.
    predicts_hz : float or None
        Rate of its predictions; None for the sample rate.
    per_message : bool
        Whether its numbers refer to a message, each sensor at the rate of its topic.

    """

    title: str
    file: str
    aiding: Aiding
    bias: Literal['random_walk', 'gauss_markov'] = 'random_walk'
    share: Literal['axis', 'sensor', 'both', 'model'] = 'sensor'
    one_time: bool = False
    predicts_hz: float | None = None
    per_message: bool = False


FAMILIES: dict[str, dict[str, Consumer]] = {
    'cameras': {
        'kalibr': Consumer('Kalibr', 'imu.yaml', CAMERA),
        'openvins': Consumer('OpenVINS', 'kalibr_imu_chain.yaml', CAMERA),
        'vins_fusion': Consumer('VINS-Fusion', 'vins_fusion_imu.yaml', CAMERA),
        'vins_fusion_midpoint': Consumer('VINS-Fusion, midpoint', 'vins_fusion_midpoint_imu.yaml',
                                         CAMERA),
        'orb_slam3': Consumer('ORB-SLAM3', 'orb_slam3_imu.yaml', CAMERA),
        'basalt': Consumer('Basalt', 'basalt_imu.json', CAMERA, share='axis'),
        'kimera': Consumer('Kimera-VIO', 'kimera_imu.yaml', CAMERA),
        'okvis2': Consumer('OKVIS2', 'okvis2_imu.yaml', CAMERA),
        'msckf_vio': Consumer('MSCKF-VIO', 'msckf_vio_noise.yaml', CAMERA),
        'maplab': Consumer('maplab', 'maplab_imu.yaml', CAMERA),
        'rovio': Consumer('ROVIO', 'rovio_imu.info', CAMERA, share='axis'),
        'svo_pro': Consumer('SVO Pro', 'svo_pro_imu.yaml', CAMERA),
        'rtabmap': Consumer('RTAB-Map', 'rtabmap_imu.yaml', CAMERA),
        'isaac_ros_vslam': Consumer('Isaac ROS Visual SLAM', 'isaac_ros_vslam_imu.yaml', CAMERA)},
    'lidars': {
        'lio_sam': Consumer('LIO-SAM', 'lio_sam_imu.yaml', LIDAR),
        'lio_sam_ros1': Consumer('LIO-SAM, ROS 1', 'lio_sam_ros1_imu.yaml', LIDAR),
        'fast_lio': Consumer('FAST-LIO', 'fast_lio_imu.yaml', LIDAR),
        'fast_livo2': Consumer('FAST-LIVO2', 'fast_livo2_imu.yaml', LIDAR),
        'point_lio': Consumer('Point-LIO', 'point_lio_imu.yaml', LIDAR),
        'glim': Consumer('GLIM', 'glim_sensors.json', LIDAR, share='both')},
    'wheels and satellites': {
        'robot_localization': Consumer('robot_localization', 'imu_covariance.yaml', NO_BIAS,
                                       per_message=True),
        'fusioncore': Consumer('FusionCore', 'fusioncore_imu.yaml', SATELLITES),
        'autoware': Consumer('Autoware imu_corrector', 'imu_corrector.param.yaml', NO_BIAS,
                             per_message=True),
        'drivers': Consumer('drivers', 'imu_drivers.yaml', NO_BIAS, per_message=True),
        'kf_gins': Consumer('KF-GINS', 'kf_gins_imu.yaml', SATELLITES, 'gauss_markov', 'axis',
                            one_time=True),
        'ob_gins': Consumer('OB_GINS', 'ob_gins_imu.yaml', SATELLITES, 'gauss_markov',
                            one_time=True),
        'navego': Consumer('NaveGo', 'navego_imu.m', SATELLITES, 'gauss_markov', 'axis'),
        'psins': Consumer('PSINS', 'psins_imuerr.m', SATELLITES, 'gauss_markov', 'axis')},
    'autopilots': {
        # The default of EKF2_PREDICT_US is 10000; EKF_TARGET_DT in AP_NavEKF3_core.h is 0.012 s.
        'px4': Consumer('PX4', 'px4_imu.params', AUTOPILOT, predicts_hz=100.0),
        'ardupilot': Consumer('ArduPilot', 'ardupilot_imu.params', AUTOPILOT, predicts_hz=83.0)},
    'simulators': {
        'gazebo': Consumer('Gazebo', 'gazebo_imu.sdf', SIMULATION, 'gauss_markov', 'axis'),
        'rotors': Consumer('RotorS', 'rotors_imu.xml', SIMULATION, 'gauss_markov'),
        'pegasus': Consumer('Pegasus Simulator', 'pegasus_imu.py', SIMULATION, 'gauss_markov',
                            one_time=True),
        'airsim': Consumer('AirSim', 'airsim_imu.json', SIMULATION),
        'matlab': Consumer('MATLAB imuSensor', 'imu_sensor.m', Aiding(
            None, 'imuSensor models white noise, flicker and random walk itself'))},
    'a filter of your own': {
        'plain': Consumer('a filter of your own, numbers alone', 'imu_noise.yaml', ESTIMATOR,
                          share='axis'),
        'gtsam': Consumer('GTSAM', 'gtsam_imu.yaml', ESTIMATOR),
        'state_space': Consumer('a filter of your own, matrices', 'state_space.json', ESTIMATOR,
                                share='model'),
        'state_space_cpp': Consumer('a filter of your own, matrices in C++', 'state_space.hpp',
                                    ESTIMATOR, share='model')}}
"""Consumers by their name in the command, the most common ones first."""
CONSUMERS = {name: consumer for family in FAMILIES.values() for name, consumer in family.items()}
_ALIASES = {
    'camera_imu': 'kalibr', 'vins': 'vins_fusion', 'vins_mono': 'vins_fusion',
    'vins_fusion_ros2': 'vins_fusion', 'orb_slam': 'orb_slam3', 'fast_lio2': 'fast_lio',
    'fast_livo': 'fast_livo2', 'okvis': 'okvis2', 'kimera_vio': 'kimera', 'msckf': 'msckf_vio',
    'svo': 'svo_pro', 'isaac': 'isaac_ros_vslam', 'isaac_ros_visual_slam': 'isaac_ros_vslam',
    'ekf': 'robot_localization', 'ukf': 'robot_localization', 'ekf_node': 'robot_localization',
    'robot_localisation': 'robot_localization', 'px4_autopilot': 'px4', 'ekf2': 'px4',
    'apm': 'ardupilot', 'arducopter': 'ardupilot', 'ekf3': 'ardupilot', 'gz': 'gazebo',
    'gz_sim': 'gazebo', 'ignition': 'gazebo', 'pegasus_simulator': 'pegasus',
    'isaac_sim': 'pegasus', 'imu_sensor': 'matlab', 'yaml': 'plain', 'numbers': 'plain',
    'own': 'plain'}
"""Alternative names."""


def _letters(name: str) -> str:
    """Return a name as it is looked up: vins-fusion, VINS Fusion and vinsfusion are the same."""
    return ''.join(name.casefold().replace('-', ' ').replace('_', ' ').split())


_NAMES = {_letters(word): name
          for word, name in (*zip(CONSUMERS, CONSUMERS, strict=True), *_ALIASES.items())}


def consumer_called(text: str) -> str:
    """Return the canonical name of a consumer, however it is spelled; KeyError names others."""
    letters = _letters(text)
    if letters in _NAMES:
        return _NAMES[letters]
    near = get_close_matches(letters, _NAMES, n=3, cutoff=0.7)
    names = ' or '.join(dict.fromkeys(_NAMES[word] for word in near))
    meant = f'did you mean {names}? ' if near else ''
    raise KeyError(f'no consumer is called {shorten(printable(repr(text)), 60)}; {meant}imu_allan '
                   'export --list names all')


def consumers_by_family() -> str:
    """Return a list of the consumers for the terminal."""
    width = max(map(len, CONSUMERS))
    return '\n\n'.join('\n'.join([f'{family}:', *(
        f'  {name:<{width}}  {consumer.title}' for name, consumer in consumers.items())])
        for family, consumers in FAMILIES.items())
