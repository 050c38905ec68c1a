# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A DDS domain for this test run, and in it a namespace for every test."""

from collections.abc import Iterator
import contextlib
import importlib.util
from itertools import count
import os
from pathlib import Path
import random
import signal
import tempfile
from typing import Any

import pytest

if importlib.util.find_spec('rclpy') is None:
    # pytest collects nothing here: every test of this folder needs ROS.
    collect_ignore_glob = ['*']
else:
    import fcntl

    import rclpy
    from ros_harness import Health, Heard, Ros


# By default a participant that missed the first announcements waits three seconds for the next,
# and one that was killed is remembered for twenty. A few samples may wait three seconds for the
# heartbeat that has them acknowledged.
_EAGER = """<?xml version="1.0" encoding="UTF-8"?>
<profiles xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <participant profile_name="eager" is_default_profile="true">
    <rtps><builtin><discovery_config>
      <leaseDuration><sec>8</sec></leaseDuration>
      <leaseAnnouncement><sec>1</sec></leaseAnnouncement>
      <initialAnnouncements>
        <count>100</count><period><nanosec>50000000</nanosec></period>
      </initialAnnouncements>
    </discovery_config></builtin></rtps>
  </participant>
  <data_writer profile_name="insistent" is_default_profile="true">
    <times><heartbeatPeriod><nanosec>50000000</nanosec></heartbeatPeriod></times>
  </data_writer>
</profiles>
"""
_NAMESPACES = (f'/test{number}' for number in count(1))


@pytest.fixture(scope='session')
def ros_context(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Give a context in a domain that no other test run on this computer uses."""
    first = random.randrange(101)
    for offset in range(101):
        domain = 1 + (first + offset) % 101
        name = f'imu_allan_test_domain_{os.getuid()}_{domain}'
        lock = (Path(tempfile.gettempdir()) / name).open('wb')
        with contextlib.suppress(OSError):
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            break
        lock.close()
    else:
        pytest.fail('no free ROS domain')
    # A shell that runs the tests in the background has them, and their nodes, ignore some.
    for number in (signal.SIGINT, signal.SIGHUP, signal.SIGQUIT):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, signal.SIG_DFL)
    before = dict(os.environ)
    folder = tmp_path_factory.mktemp('ros')
    (folder / 'eager.xml').write_text(_EAGER)
    os.environ.update(ROS_DOMAIN_ID=str(domain), ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST',
                      ROS_LOG_DIR=str(folder),
                      # A killed process would leave its shared memory behind.
                      FASTDDS_BUILTIN_TRANSPORTS='UDPv4',
                      FASTDDS_DEFAULT_PROFILES_FILE=str(folder / 'eager.xml'),
                      FASTRTPS_DEFAULT_PROFILES_FILE=str(folder / 'eager.xml'))
    context = rclpy.context.Context()
    rclpy.init(context=context, domain_id=domain)
    yield context
    context.try_shutdown()
    os.environ.clear()
    os.environ.update(before)
    lock.close()


@contextlib.contextmanager
def in_namespace(context: Any, folder: Path) -> Iterator[Any]:
    harness = Ros(context, folder, next(_NAMESPACES))
    yield harness
    harness.close()


@pytest.fixture
def ros(ros_context: Any, tmp_path: Path) -> Iterator[Any]:
    """Give a test its namespace, its node and the means to start processes."""
    with in_namespace(ros_context, tmp_path) as harness:
        yield harness


@pytest.fixture(scope='module')
def shared_ros(ros_context: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Give the tests of a file one namespace, for processes that they share."""
    with in_namespace(ros_context, tmp_path_factory.mktemp('shared')) as harness:
        yield harness


@pytest.fixture
def heard() -> Any:
    return Heard()


@pytest.fixture
def health(ros: Any) -> Any:
    return Health(ros)
