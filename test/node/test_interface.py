# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""--help says what the nodes offer."""

import os
import re
import subprocess
import sys

from imu_allan.node.interface import CHARACTERIZATION, help_text, Interface, SIMULATOR
import pytest
from ros_harness import ENTRY_POINTS, Ros

TERMS = ('noise_density', 'bias_instability', 'rate_random_walk', 'filter_random_walk')
NODES = {'imu_allan_node': ('imu_allan', CHARACTERIZATION),
         'imu_simulator': ('imu_simulator', SIMULATOR)}


@pytest.mark.parametrize('program', ENTRY_POINTS)
def test_help_describes_a_node_without_starting_ros(program: str) -> None:
    start = (f'import sys; from {ENTRY_POINTS[program]} import main; status = main(); '
             'print("rclpy" in sys.modules); sys.exit(status)')
    for option in ('--help', '-h'):
        done = subprocess.run([sys.executable, '-c', start, option], capture_output=True,
                              text=True, check=True)
        text = help_text(NODES[program][1])
        assert done.stdout == f'{text}\nFalse\n'
        assert text.startswith(f'usage: {program} ')
        for setting in NODES[program][1].settings:
            assert f'  {setting.name} (' in text


def expanded(interface: Interface, node: str) -> set[str]:
    names = set()
    for entries in (interface.subscribed, interface.published, interface.services):
        for written, _, _ in entries:
            for name in re.sub(r'(\S+)/low, \.\.\.(/high)', r'\1/low, \1\2', written).split(', '):
                names |= {name.replace('~', node).replace('SENSOR', sensor).replace('TERM', term)
                          for sensor in ('gyro', 'accel') for term in TERMS}
    return names


@pytest.mark.parametrize('program', ENTRY_POINTS)
def test_what_help_names_is_what_the_node_has(ros: Ros, program: str) -> None:
    node, interface = NODES[program]
    ros.start(program)
    own = (node, ros.namespace)

    def offered() -> set[str]:
        # A node that is not known yet has nothing.
        if own not in ros.node.get_node_names_and_namespaces():
            return set()
        found = [*ros.node.get_publisher_names_and_types_by_node(*own),
                 *ros.node.get_subscriber_names_and_types_by_node(*own),
                 *ros.node.get_service_names_and_types_by_node(*own)]
        return {name.removeprefix(f'{ros.namespace}/') for name, _ in found}

    # Nothing is measured of the tuned walk.
    wanted = {name for name in expanded(interface, node)
              if 'filter_random_walk/interval' not in name}
    ros.until(lambda: wanted <= offered())
    unnamed = {name for name in offered() - wanted if 'parameter' not in name}
    assert unnamed <= {'/rosout', f'{node}/get_type_description', '/clock'}


@pytest.mark.parametrize('program', ENTRY_POINTS)
def test_help_whose_reader_has_seen_enough_ends_without_a_word(program: str) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    start = f'import sys; from {ENTRY_POINTS[program]} import main; sys.exit(main())'
    done = subprocess.run([sys.executable, '-c', start, '--help'], stdout=writer,
                          stderr=subprocess.PIPE, text=True, check=False)
    os.close(writer)
    assert (done.returncode, done.stderr) == (141, '')
