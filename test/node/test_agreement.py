# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The node and a recording of the same topic must give the same numbers."""

from collections.abc import Mapping
import json
from typing import Any

import imu_allan
from imu_allan.cdr import blocks_from_messages
from imu_allan.recordings.write import write_recording
from imu_allan.sensor.noise_model import load_model
from imu_allan.sensor.simulated_imu import SimulatedImu
import numpy as np
from ros_harness import Ros
from std_msgs.msg import String

RATE_HZ = 20.0
SAMPLES = 13_000
"""More than ten minutes, without which there is no backtest."""
MODEL = """
gyro: {noise_density: 0.01 deg/s/sqrt(Hz), bias_instability: 10 deg/h}
accel: {noise_density: 100 ug/sqrt(Hz), rate_random_walk: 1e-4 m/s^3/sqrt(Hz)}
"""


def numbers(document: Any, path: str = '') -> dict[str, float]:
    if isinstance(document, Mapping):
        return {key: value for name, item in document.items()
                for key, value in numbers(item, f'{path}.{name}').items()}
    if isinstance(document, list):
        return {key: value for i, item in enumerate(document)
                for key, value in numbers(item, f'{path}[{i}]').items()}
    return {path: document} if isinstance(document, (int, float)) else {}


def backtests(document: Any) -> dict[str, Any]:
    return {name: axis['backtest'] for name, axis in document['axes'].items()}


def test_node_and_recording_agree_to_1e_9_on_what_was_published(ros: Ros) -> None:
    model = ros.folder / 'model.yaml'
    model.write_text(MODEL)
    recorder = ros.recorder()
    ros.start('imu_allan_node', {'publish_period': 1.0}, shared_memory=True)
    simulator = ros.start('imu_simulator', {
        'model': str(model), 'rate': RATE_HZ, 'duration': SAMPLES / RATE_HZ, 'speed': 0.0,
        'seed': 11, 'wait_for_subscriptions': 2}, shared_memory=True)
    messages: list[bytes] = []
    receive_ns: list[np.ndarray[Any, Any]] = []

    def all_recorded() -> bool:
        batch = recorder.take()
        messages.extend(batch.messages)
        receive_ns.append(batch.receive_ns)
        return len(messages) == SAMPLES

    ros.until(all_recorded)
    assert simulator.wait() == 0
    live = ros.saved_with(SAMPLES)
    assert all(axis['backtest'] for axis in live['axes'].values())
    published = ros.listen(String, 'imu_allan/result')
    ros.until(lambda: published and backtests(json.loads(published[-1].data)) == backtests(live))
    path = write_recording(ros.folder / 'recording',
                           blocks_from_messages(messages, np.concatenate(receive_ns)),
                           topic=ros.name('imu/data_raw'))
    offline = imu_allan.analyze(path).to_dict()
    for part in ('timeline', 'axes'):
        left, right = numbers(live[part]), numbers(offline[part])
        assert left.keys() == right.keys()
        assert len(left) > (5 if part == 'timeline' else 500)
        for key, value in left.items():
            assert abs(value - right[key]) <= 1e-9 * abs(right[key]), key
    assert live['source']['frame_id'] == offline['source']['frame_id']
    assert live['source']['start_time'] == offline['source']['start_time']
    # And what was published is what the model gives for this seed.
    drawn = SimulatedImu(load_model(model), RATE_HZ, 11).draw(SAMPLES)
    [block] = blocks_from_messages(messages, np.concatenate(receive_ns))
    np.testing.assert_array_equal(block.samples, drawn)
