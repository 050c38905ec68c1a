# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Real nodes that listen to the messages of other packages, built and sourced."""

import importlib
import json
from pathlib import Path
import sys
from typing import Any

from built_messages import build
from imu_allan import analyze
from imu_allan.recordings import RecordingOptions
from mcap.reader import make_reader
import pytest
from rclpy.qos import QoSProfile
from ros_harness import Ros
from std_srvs.srv import Trigger
from test_accepted_sources import COUNT, SOURCES

FOREIGN = ('px4 combined', 'px4 vehicle', 'vectornav', 'vectornav common', 'sbg', 'sbg short',
           'adi', 'leo', 'unitree', 'depthai', 'flat', 'nested', 'named fields')


@pytest.mark.slow
@pytest.mark.parametrize('name', FOREIGN)
def test_a_node_reads_every_type_that_is_known_like_its_recording(
        ros: Ros, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    source = SOURCES[name](ros.folder)
    [(kind, definition)] = source.kinds.items()
    package, _, base = kind.split('/')
    sourced = build(ros.folder / 'workspace', definition, kind)
    monkeypatch.syspath_prepend(sourced['PYTHONPATH'].split(':')[0])
    for module in [module for module in sys.modules if module.partition('.')[0] == package]:
        monkeypatch.delitem(sys.modules, module)
    message_class = getattr(importlib.import_module(f'{package}.msg'), base)
    node = ros.start('imu_allan_node', {
        'imu_type': kind, 'publish_period': 0.5,
        **{f'{key}_field': value for key, value in source.options.items()}}, env=sourced)
    publisher = ros.node.create_publisher(message_class, ros.name('imu/data_raw'),
                                          QoSProfile(depth=COUNT))
    ros.until(lambda: publisher.get_subscription_count() == 1)
    with source.path.open('rb') as file:
        for _, _, message in make_reader(file).iter_messages():
            publisher.publish(message.data)

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
