# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Names of the programs that `imu_allan.writers.filters` writes configurations for.

They stand alone so that the command knows them without loading numerics.
"""

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
    'kf_gins': 'KF-GINS',
    'ob_gins': 'OB_GINS',
    'navego': 'NaveGo',
    'psins': 'PSINS',
    'gazebo': 'Gazebo',
    'rotors': 'RotorS',
    'matlab': 'MATLAB imuSensor',
    'airsim': 'AirSim',
    'autoware': 'Autoware imu_corrector',
    'drivers': 'drivers',
    'state_space': 'a filter of your own',
    'state_space_cpp': 'a filter of your own, C++',
}
"""By name in the command: as its authors write it."""
