# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A simulated IMU and the node that characterizes it: ros2 launch imu_allan demo.launch.py ."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

NAMESPACE = '/imu_allan_demo'


def generate_launch_description() -> LaunchDescription:
    """Describe both nodes and what can be chosen about them."""
    subscription = f'qos_overrides.{NAMESPACE}/imu/data_raw.subscription'
    return LaunchDescription([
        DeclareLaunchArgument('model', default_value='consumer_mems',
                              description='Noise model: a file, or the name of a shipped one'),
        DeclareLaunchArgument('rate', default_value='100.0',
                              description='Samples per simulated second'),
        DeclareLaunchArgument('speed', default_value='0.0',
                              description='Simulated seconds per second; 0 is as fast as it goes'),
        DeclareLaunchArgument('duration', default_value='10800.0',
                              description='Simulated seconds; 0 is without end'),
        Node(
            package='imu_allan', executable='imu_simulator', namespace=NAMESPACE,
            output='screen', parameters=[{
                # A path is no YAML: all that follows ' #' would be a comment.
                'model': ParameterValue(LaunchConfiguration('model'), value_type=str),
                **{name: ParameterValue(LaunchConfiguration(name), value_type=float)
                   for name in ('rate', 'speed', 'duration')}}]),
        Node(
            package='imu_allan', executable='imu_allan_node', name='imu_allan',
            namespace=NAMESPACE, output='screen', parameters=[{
                'publish_period': 1.0,
                # The simulated clock is right at any speed.
                'clock': 'header',
                # The simulator at full speed waits for subscribers that take every sample.
                f'{subscription}.reliability': 'reliable',
                f'{subscription}.history': 'keep_all'}],
            sigterm_timeout='30', sigkill_timeout='30'),
    ])
