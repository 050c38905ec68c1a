# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Names of message types that show what a topic holds."""

IMU_TYPES = frozenset({'sensor_msgs/msg/Imu', 'sensor_msgs/Imu'})
"""Type names in ROS 2 and ROS 1."""

TEMPERATURE_TYPES = frozenset({'sensor_msgs/msg/Temperature', 'sensor_msgs/Temperature'})


def may_hold_imu(type_name: str) -> bool:
    """Return whether messages of a type might hold IMU samples, judged by its name."""
    # None of the types of ROS itself, other than Imu, holds IMU samples.
    of_ros = frozenset({
        'action_msgs', 'actionlib_msgs', 'builtin_interfaces', 'diagnostic_msgs', 'geometry_msgs',
        'lifecycle_msgs', 'map_msgs', 'nav_msgs', 'rcl_interfaces', 'rosbag2_interfaces',
        'rosgraph_msgs', 'sensor_msgs', 'shape_msgs', 'statistics_msgs', 'std_msgs', 'stereo_msgs',
        'tf', 'tf2_msgs', 'trajectory_msgs', 'unique_identifier_msgs', 'visualization_msgs'})
    return type_name.partition('/')[0] not in of_ros
