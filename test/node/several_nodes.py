# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Nodes for several IMUs in one process, as an application of its own would have them.

Arguments: class of the executor, folder for files, namespaces. Without namespaces it tells whether
that executor calls the timer of an ordinary node at all.
"""

import os
import sys
import threading
import time

from imu_allan.node.characterization_node import CharacterizationNode
import rclpy
from rclpy.executors import (
    Executor,
    ExternalShutdownException,
    MultiThreadedExecutor,
    SingleThreadedExecutor,
)
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
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
    if not namespaces:
        probe = Node('probe')
        probe.create_timer(0.1, lambda: (print('ticks', flush=True), os._exit(0)))
        threading.Thread(target=lambda: (time.sleep(5), os._exit(1)), daemon=True).start()
        executor.add_node(probe)
        executor.spin()
    nodes = [CharacterizationNode(namespace=namespace, parameter_overrides=overrides(
        folder, f'{namespace}/imu/data_raw')) for namespace in namespaces]
    for node in nodes:
        executor.add_node(node)
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        for node in nodes:
            node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main(*sys.argv[1:])
