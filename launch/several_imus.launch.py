# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Start a node for each IMU of a list.

ros2 launch imu_allan several_imus.launch.py imus:='front=/front/imu rear=/rear/imu/data_raw' .
"""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, ThisLaunchFileDir


def generate_launch_description() -> LaunchDescription:
    """Describe what can be chosen; everything else is as in imu_allan.launch.py."""
    return LaunchDescription([
        DeclareLaunchArgument('imus', description='NAMESPACE=TOPIC of each IMU, with spaces '
                                                  'between them'),
        DeclareLaunchArgument('state_dir', default_value='',
                              description='Folder of a state file for each IMU; empty keeps '
                                          'nothing'),
        OpaqueFunction(function=start)])


def start(context: LaunchContext) -> list[IncludeLaunchDescription]:
    """Start a node for each IMU, with a state file of its own."""
    folder = LaunchConfiguration('state_dir').perform(context)
    included = []
    for namespace, topic in topics(LaunchConfiguration('imus').perform(context)).items():
        state = f'{folder}/{namespace.strip("/").replace("/", "_")}.state' if folder else ''
        included.append(IncludeLaunchDescription(
            PythonLaunchDescriptionSource([ThisLaunchFileDir(), '/imu_allan.launch.py']),
            launch_arguments={'namespace': namespace, 'imu_topic': topic,
                              'state_file': state}.items()))
    return included


def topics(imus: str) -> dict[str, str]:
    """Read ``front=/front/imu rear=/rear/imu/data_raw``: topic by namespace."""
    found: dict[str, str] = {}
    for word in imus.split():
        namespace, equals, topic = word.partition('=')
        if not (namespace and equals and topic):
            raise RuntimeError(f'imus: {word!r} is not NAMESPACE=TOPIC, such as front=/front/imu')
        if namespace in found:
            raise RuntimeError(f'imus: two IMUs in the namespace {namespace}')
        found[namespace] = topic
    return found
