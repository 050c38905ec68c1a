# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Real nodes that listen to the messages of other packages, built and sourced."""

from collections.abc import Callable
from functools import cache
import importlib
import json
from pathlib import Path
import sys
import time
from typing import Any

from built_messages import build
from imu_allan import analyze
from imu_allan.recordings import RecordingOptions
from mcap.reader import make_reader
import pytest
from rclpy.qos import QoSProfile
from ros_harness import Ros
from std_srvs.srv import Trigger
from test_accepted_sources import COUNT, Source, SOURCES, STEP_US

FOREIGN = ('px4 combined', 'px4 vehicle', 'vectornav', 'vectornav common', 'sbg', 'sbg short',
           'adi', 'leo', 'unitree', 'depthai', 'flat', 'nested', 'named fields')


@pytest.fixture(scope='module')
def sources(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Source]:
    """Write a recording of every type."""
    return {name: SOURCES[name](tmp_path_factory.mktemp('source')) for name in FOREIGN}


@pytest.fixture(scope='module')
def sourced(sources: dict[str, Source], tmp_path_factory: pytest.TempPathFactory
            ) -> Callable[[str], dict[str, str]]:
    """Build a package with all its types at its first use: a process loads it once."""
    @cache
    def workspace(package: str) -> dict[str, str]:
        found = build(tmp_path_factory.mktemp('workspace'), package, {
            kind: text for source in sources.values() for kind, text in source.kinds.items()
            if kind.startswith(f'{package}/')})
        sys.path.insert(0, found['PYTHONPATH'].split(':')[0])
        return found

    return workspace


@pytest.mark.slow
@pytest.mark.parametrize('name', FOREIGN)
def test_a_node_reads_every_type_that_is_known_like_its_recording(
        ros: Ros, name: str, sources: dict[str, Source],
        sourced: Callable[[str], dict[str, str]]) -> None:
    source = sources[name]
    [kind] = source.kinds
    package, _, base = kind.split('/')
    environment = sourced(package)
    message_class = getattr(importlib.import_module(f'{package}.msg'), base)
    node = ros.start('imu_allan_node', {
        'imu_type': kind, 'publish_period': 0.5,
        **{f'{key}_field': value for key, value in source.options.items()}}, env=environment)
    publisher = ros.node.create_publisher(message_class, ros.name('imu/data_raw'),
                                          QoSProfile(depth=COUNT))
    ros.until(lambda: publisher.get_subscription_count() == 1)
    with source.path.open('rb') as file:
        for _, _, message in make_reader(file).iter_messages():
            publisher.publish(message.data)
            if name == 'unitree':
                # It has no stamp: when it comes is all that is known of its time.
                time.sleep(STEP_US * 1e-6)

    def saved() -> Any:
        response = ros.call(Trigger, 'imu_allan/save')
        if not response.success:
            return None
        document = json.loads(Path(response.message.splitlines()[0]).read_text())
        return document if document['timeline']['samples'] == COUNT else None

    document = ros.until(saved)
    assert node.stop() == 0
    result = analyze(source.path, reading=RecordingOptions(**source.options))
    assert list(document['axes']) == list(result.axes)
    for axis, recorded in result.axes.items():
        found = document['axes'][axis]
        assert found['mean'] == pytest.approx(recorded.mean, rel=1e-9)
        if document['source']['clock'] == 'header':
            assert found['coefficients']['noise_density']['value'] == pytest.approx(
                recorded.coefficients['noise_density'].value, rel=1e-9)
    assert (document['source']['clock'] == 'header') == (name != 'unitree')
