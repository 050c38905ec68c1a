# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Start imu_allan_node: ros2 launch imu_allan imu_allan.launch.py imu_topic:=/imu/data_raw ."""

from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

TEXTS = {
    'gyro_topic': 'Topic of the gyroscope, for an IMU on two topics',
    'accel_topic': 'Topic of the accelerometer, for an IMU on two topics',
    'state_file': 'File that keeps the state of the run over crashes and restarts; none keeps '
                  'nothing',
    'output_dir': 'Folder that ~/save and shutdown write to',
    'spec_file': 'Datasheet to check the IMU against',
    'reference': 'Earlier result to compare the IMU with',
    'temperature_topic': "Topic of the IMU's thermometer",
}
"""Parameters that an argument sets where it is not empty; else the parameter file does."""
NOTHING = 'none'
"""As an argument it makes a parameter empty: ros2 launch takes no empty one."""


def generate_launch_description() -> LaunchDescription:
    """Describe the node and what can be chosen about it."""
    parameters = PathJoinSubstitution([FindPackageShare('imu_allan'), 'config', 'imu_allan.yaml'])
    return LaunchDescription([
        DeclareLaunchArgument('name', default_value='imu_allan', description='Name of the node'),
        DeclareLaunchArgument('namespace', default_value='',
                              description='Namespace of the node and of relative topics'),
        DeclareLaunchArgument('params_file', default_value=parameters,
                              description='Parameter file'),
        DeclareLaunchArgument('imu_topic', default_value='imu/data_raw',
                              description='Topic of the sensor_msgs/Imu messages'),
        *(DeclareLaunchArgument(name, default_value='', description=text)
          for name, text in TEXTS.items()),
        DeclareLaunchArgument('log_level', default_value='info',
                              choices=['debug', 'info', 'warn', 'error', 'fatal'],
                              description='Lowest severity that is logged'),
        DeclareLaunchArgument('respawn', default_value='true', choices=['true', 'false'],
                              description='Restart the node if it ends unexpectedly'),
        DeclareLaunchArgument('use_sim_time', default_value='false', choices=['true', 'false'],
                              description='Stamp diagnostics by /clock'),
        OpaqueFunction(function=start)])


def start(context: LaunchContext) -> list[Node]:
    """Start the node with what was chosen."""
    def chosen(name: str) -> str:
        return str(LaunchConfiguration(name).perform(context))

    file = Path(chosen('params_file')).expanduser()
    if not file.is_file():
        # launch would go on with the defaults.
        raise RuntimeError(f'params_file {file}: no such file')
    texts = {name: '' if chosen(name) == NOTHING else chosen(name)
             for name in TEXTS if chosen(name)}
    return [Node(
        package='imu_allan', executable='imu_allan_node', name=chosen('name'),
        namespace=chosen('namespace'), output='screen',
        parameters=[str(file), {'use_sim_time': chosen('use_sim_time') == 'true', **texts}],
        remappings=[('imu/data_raw', chosen('imu_topic'))],
        arguments=['--ros-args', '--log-level', chosen('log_level')],
        respawn=chosen('respawn') == 'true', respawn_delay=2.0,
        # The node saves before it ends; launch would kill it after five seconds.
        sigterm_timeout='30', sigkill_timeout='30')]
