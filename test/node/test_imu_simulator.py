# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
import json
from pathlib import Path
import time

import imu_allan
from imu_allan.cdr import batches_of
from imu_allan.recordings.messages.imus_in import IMU_MESSAGES
from imu_allan.recordings.write import write_recording
from imu_allan.sensor.noise_model import load_model
from imu_allan.sensor.simulated_imu import SimulatedImu
import numpy as np
import pytest
from std_msgs.msg import String

MODEL = Path(__file__).parents[2] / 'config' / 'consumer_mems.yaml'
RATE_HZ = 20.0
SAMPLES = 13_000
"""More than ten minutes, without which there is no backtest."""


class Recording:
    """What a subscription has received so far."""

    def __init__(self, subscription):
        self._subscription = subscription
        self.blocks = []

    def __len__(self):
        batch = self._subscription.take()
        self.blocks += IMU_MESSAGES.decoder()(
            batches_of(batch.messages, batch.receive_ns), lambda _, error: pytest.fail(str(error)))
        return sum(map(len, self.blocks))

    def __getattr__(self, part):
        return np.concatenate([getattr(block, part) for block in self.blocks])


@pytest.fixture
def recording(ros):
    return Recording(ros.recorder())


def test_at_full_speed_all_samples_reach_a_slow_subscriber_and_the_simulator_ends(ros, recording):
    simulator = ros.start('imu_simulator', {
        'model': str(MODEL), 'rate': 400.0, 'duration': 75.0, 'speed': 0.0, 'seed': 7,
        'frame_id': 'some_imu'})
    counts = [0]
    while counts[-1] < 30_000:
        # Longer than the writer waits for the reader before it gives up on a sample.
        for _ in range(5):
            ros.executor.spin_once(timeout_sec=0.05)
        counts.append(len(recording))
        assert simulator.running or simulator.popen.returncode == 0
    assert simulator.wait() == 0
    assert max(np.diff(counts)) < 20_000
    np.testing.assert_array_equal(recording.header_ns - recording.header_ns[0],
                                  np.rint(np.arange(30_000) / 400.0 * 1e9).astype(np.int64))
    model = load_model(MODEL)
    np.testing.assert_array_equal(recording.samples, SimulatedImu(model, 400.0, 7).draw(30_000))
    assert {block.frame_id for block in recording.blocks} == {'some_imu'}


def test_samples_leave_at_their_own_time_in_real_time_and_twice_as_fast(ros):
    recordings = {}
    for speed in (1.0, 2.0):
        topic = f'imu_at_{speed:.0f}'
        recordings[speed] = Recording(ros.recorder(topic))
        ros.start('imu_simulator', {'model': 'tactical_mems', 'rate': 100.0, 'speed': speed,
                                    'duration': 2.0 * speed, 'wait_for_subscriptions': 1},
                  remaps={'imu/data_raw': topic, '__node': topic})
    for speed, recording in recordings.items():
        count = round(200 * speed)
        ros.until(lambda recording=recording, count=count: len(recording) == count)
        header_s, receive_s = recording.header_ns * 1e-9, recording.receive_ns * 1e-9
        assert header_s[-1] - header_s[0] == pytest.approx((count - 1) / 100.0)
        late_s = receive_s - header_s / speed
        # A busy computer holds samples up, but not all of them, and no clock runs faster or
        # slower for it: some of each half are as early as the earliest.
        assert np.ptp([half.min() for half in np.array_split(late_s, 2)]) < 0.1
        assert np.quantile(late_s - late_s.min(), 0.2) < 0.05


def test_a_signal_ends_a_simulator_whose_subscriber_takes_nothing(ros):
    subscription = ros.recorder()
    simulator = ros.start('imu_simulator', {'rate': 1000.0, 'speed': 0.0})
    ros.until(lambda: 'publishing' in simulator.log)
    # It waits in the middle of a publication now.
    time.sleep(1.0)
    # After so long `ros2 launch` signals again.
    assert simulator.stop(within_s=5.0) == 0
    assert subscription.take().messages


def test_a_model_that_is_not_there_is_one_line(ros):
    simulator = ros.start('imu_simulator', {'model': 'no_such_imu'})
    assert simulator.wait() == 1
    assert simulator.log == (
        'imu_simulator: parameter model: no_such_imu: no such file, and no model of that name is '
        'shipped; give the path of a noise model YAML file\n')


def backtests(document):
    return {name: axis['backtest'] for name, axis in document['axes'].items()}


def test_node_and_recording_agree_to_the_last_bit_on_what_was_published(ros, recording):
    model = ros.folder / 'model.yaml'
    model.write_text(
        'gyro: {noise_density: 0.01 deg/s/sqrt(Hz), bias_instability: 10 deg/h}\n'
        'accel: {noise_density: 100 ug/sqrt(Hz), rate_random_walk: 1e-4 m/s^3/sqrt(Hz)}\n')
    ros.start('imu_allan_node', {'publish_period': 1.0}, shared_memory=True)
    simulator = ros.start('imu_simulator', {
        'model': str(model), 'rate': RATE_HZ, 'duration': SAMPLES / RATE_HZ, 'speed': 0.0,
        'seed': 11, 'wait_for_subscriptions': 2}, shared_memory=True)
    ros.until(lambda: len(recording) == SAMPLES)
    assert simulator.wait() == 0
    live = ros.saved_with(SAMPLES)
    assert all(axis['backtest'] for axis in live['axes'].values())
    published = ros.listen(String, 'imu_allan/result')
    ros.until(lambda: published and backtests(json.loads(published[-1].data)) == backtests(live))
    path = write_recording(ros.folder / 'recording', recording.blocks,
                           topic=ros.name('imu/data_raw'))
    offline = json.loads(imu_allan.analyze(path).to_json())
    for part in ('timeline', 'axes'):
        assert live[part] == offline[part]
    for key in ('frame_id', 'start_time'):
        assert live['source'][key] == offline['source'][key]
