# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Start imu_allan_node: ros2 launch imu_allan imu_allan.launch.py imu_topic:=/imu/data_raw ."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
    """Describe the node and what can be chosen about it."""
    parameters = PathJoinSubstitution([FindPackageShare('imu_allan'), 'config', 'imu_allan.yaml'])
    return LaunchDescription([
        DeclareLaunchArgument('namespace', default_value='',
                              description='Namespace of the node and of relative topics'),
        DeclareLaunchArgument('params_file', default_value=parameters,
                              description='Parameter file'),
        DeclareLaunchArgument('imu_topic', default_value='imu/data_raw',
                              description='Topic of the sensor_msgs/Imu messages'),
        DeclareLaunchArgument('use_sim_time', default_value='false', choices=['true', 'false'],
                              description='Stamp diagnostics by /clock'),
        Node(
            package='imu_allan', executable='imu_allan_node', name='imu_allan',
            namespace=LaunchConfiguration('namespace'), output='screen',
            parameters=[LaunchConfiguration('params_file'), {
                'use_sim_time': ParameterValue(LaunchConfiguration('use_sim_time'),
                                               value_type=bool)}],
            remappings=[('imu/data_raw', LaunchConfiguration('imu_topic'))],
            # The node saves before it ends; launch would kill it after five seconds.
            sigterm_timeout='30', sigkill_timeout='30'),
    ])
