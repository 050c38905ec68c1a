# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Nodes for several IMUs in one process, as an application of its own would have them.

Arguments: class of the executor, folder for files, namespaces.
"""

import sys

from imu_allan.node.characterization_node import CharacterizationNode
import rclpy
from rclpy.executors import (
    Executor,
    ExternalShutdownException,
    MultiThreadedExecutor,
    SingleThreadedExecutor,
)
from rclpy.experimental import EventsExecutor
from rclpy.parameter import Parameter

EXECUTORS: dict[str, type[Executor]] = {
    'SingleThreadedExecutor': SingleThreadedExecutor,
    'MultiThreadedExecutor': MultiThreadedExecutor,
    'EventsExecutor': EventsExecutor}


def overrides(folder: str, topic: str) -> list[Parameter]:
    """Give the parameters of a node."""
    qos = f'qos_overrides.{topic}.subscription'
    return [Parameter(name, value=value) for name, value in {
        'publish_period': 0.5, 'state_file': '', 'output_dir': folder,
        f'{qos}.reliability': 'reliable', f'{qos}.history': 'keep_all'}.items()]


def main(executor_name: str, folder: str, *namespaces: str) -> None:
    """Spin."""
    rclpy.init()
    executor = EXECUTORS[executor_name]()
    nodes = [CharacterizationNode(namespace=namespace, parameter_overrides=overrides(
        folder, f'{namespace}/imu/data_raw')) for namespace in namespaces]
    for node in nodes:
        executor.add_node(node)
    try:
        while rclpy.ok():
            # The `spin` of an EventsExecutor calls nothing in the wheels of rclpy 7.1.6.
            executor.spin_once(1.0)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        for node in nodes:
            node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main(*sys.argv[1:])
