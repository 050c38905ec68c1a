# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Names of the programs that `imu_allan.writers.filters` writes configurations for.

They stand alone so that the command knows them without loading numerics.
"""

from difflib import get_close_matches

from imu_allan.errors import printable, shorten

CONSUMER_TITLES: dict[str, str] = {
    'kalibr': 'Kalibr',
    'openvins': 'OpenVINS',
    'orb_slam3': 'ORB-SLAM3',
    'vins_fusion': 'VINS-Fusion',
    'lio_sam': 'LIO-SAM',
    'fast_lio': 'FAST-LIO',
    'gtsam': 'GTSAM',
    'basalt': 'Basalt',
    'msckf_vio': 'MSCKF-VIO',
    'robot_localization': 'robot_localization',
    'px4': 'PX4',
    'ardupilot': 'ArduPilot',
    'vins_fusion_midpoint': 'VINS-Fusion, midpoint',
    'lio_sam_ros1': 'LIO-SAM, ROS 1',
    'isaac_ros_vslam': 'Isaac ROS Visual SLAM',
    'okvis2': 'OKVIS2',
    'kimera': 'Kimera-VIO',
    'maplab': 'maplab',
    'rovio': 'ROVIO',
    'svo_pro': 'SVO Pro',
    'rtabmap': 'RTAB-Map',
    'point_lio': 'Point-LIO',
    'fast_livo2': 'FAST-LIVO2',
    'glim': 'GLIM',
    'fusioncore': 'FusionCore',
    'kf_gins': 'KF-GINS',
    'ob_gins': 'OB_GINS',
    'navego': 'NaveGo',
    'psins': 'PSINS',
    'gazebo': 'Gazebo',
    'rotors': 'RotorS',
    'matlab': 'MATLAB imuSensor',
    'airsim': 'AirSim',
    'pegasus': 'Pegasus Simulator',
    'autoware': 'Autoware imu_corrector',
    'drivers': 'drivers',
    'plain': 'a filter of your own, numbers alone',
    'state_space': 'a filter of your own, matrices',
    'state_space_cpp': 'a filter of your own, matrices in C++',
}
"""By name in the command: as its authors write it."""

FAMILIES: dict[str, tuple[str, ...]] = {
    'a filter of your own': ('plain', 'state_space', 'state_space_cpp', 'gtsam'),
    'cameras': ('kalibr', 'openvins', 'vins_fusion', 'vins_fusion_midpoint', 'orb_slam3', 'basalt',
                'kimera', 'okvis2', 'msckf_vio', 'maplab', 'rovio', 'svo_pro', 'rtabmap',
                'isaac_ros_vslam'),
    'lidars': ('lio_sam', 'lio_sam_ros1', 'fast_lio', 'fast_livo2', 'point_lio', 'glim'),
    'wheels and satellites': ('robot_localization', 'fusioncore', 'autoware', 'drivers', 'kf_gins',
                              'ob_gins', 'navego', 'psins'),
    'autopilots': ('px4', 'ardupilot'),
    'simulators': ('gazebo', 'rotors', 'pegasus', 'airsim', 'matlab')}
"""Every name once, the usual ones first."""
_ALIASES = {
    'camera_imu': 'kalibr', 'open_vins': 'openvins', 'vins': 'vins_fusion',
    'vins_mono': 'vins_fusion', 'vinsfusion': 'vins_fusion', 'vins_fusion_ros2': 'vins_fusion',
    'orbslam3': 'orb_slam3', 'orb_slam': 'orb_slam3', 'orbslam': 'orb_slam3',
    'liosam': 'lio_sam', 'fastlio': 'fast_lio', 'fast_lio2': 'fast_lio', 'fastlio2': 'fast_lio',
    'fastlivo2': 'fast_livo2', 'fast_livo': 'fast_livo2', 'pointlio': 'point_lio',
    'okvis': 'okvis2', 'kimera_vio': 'kimera', 'msckf': 'msckf_vio', 'svo': 'svo_pro',
    'rtab_map': 'rtabmap', 'isaac': 'isaac_ros_vslam', 'isaac_ros_visual_slam': 'isaac_ros_vslam',
    'ekf': 'robot_localization', 'ukf': 'robot_localization', 'ekf_node': 'robot_localization',
    'robot_localisation': 'robot_localization', 'px4_autopilot': 'px4', 'ekf2': 'px4',
    'apm': 'ardupilot', 'arducopter': 'ardupilot', 'ekf3': 'ardupilot', 'gz': 'gazebo',
    'gz_sim': 'gazebo', 'ignition': 'gazebo', 'pegasus_simulator': 'pegasus',
    'isaac_sim': 'pegasus', 'imu_sensor': 'matlab', 'yaml': 'plain', 'numbers': 'plain',
    'own': 'plain'}
"""What people call them besides."""


def consumer_called(text: str) -> str:
    """
    Return the name of a consumer for what a user calls it, in capitals or not.

    Raises
    ------
    KeyError
        If none is called so; the message says where all are named, and which are near.

    """
    name = '_'.join(text.casefold().replace('-', ' ').replace('_', ' ').split())
    found = name if name in CONSUMER_TITLES else _ALIASES.get(name)
    if found is not None:
        return found
    near = get_close_matches(name, [*CONSUMER_TITLES, *_ALIASES], n=3, cutoff=0.7)
    meant = ' or '.join(dict.fromkeys(_ALIASES.get(word, word) for word in near))
    raise KeyError(f'no consumer is called {shorten(printable(repr(text)), 60)}'
                   + (f'; did you mean {meant}? imu_allan' if meant else '; imu_allan')
                   + ' export --list names all')


def consumers_by_family() -> str:
    """Return a list of the consumers for the terminal."""
    width = max(map(len, CONSUMER_TITLES))
    return '\n\n'.join('\n'.join([f'{family}:', *(
        f'  {name:<{width}}  {CONSUMER_TITLES[name]}' for name in names)])
        for family, names in FAMILIES.items())
