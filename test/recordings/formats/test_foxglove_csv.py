# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Plot data as Foxglove exports it: a path after the other, a number a line."""

from csv import DictReader

from bags import read, refusal, said
from imu_allan.recordings import open_recording
import numpy as np

HEAD = 'elapsed time,receive time,header.stamp,topic,value'
COUNT = 200
START = 1_700_000_000
SAMPLES = np.sin(np.arange(COUNT)[:, np.newaxis] * np.arange(1, 7))
FIELDS = [f'{name}.{axis}' for name in ('angular_velocity', 'linear_acceleration')
          for axis in 'xyz']


def stamp(number, later_ns=0):
    time = number * 5_000_000 + later_ns
    return f'{START + time // 10**9}.{time % 10**9:09d}'


def write(path, topics, more='', headers=True):
    lines = [HEAD] + [
        f'{n / 200},{stamp(n, 1234)},{stamp(n) if headers else ""},{topic}.{field},'
        f'{float(SAMPLES[n, column]) * scale!r}'
        for topic, scale in topics.items() for column, field in enumerate(FIELDS)
        for n in range(COUNT)]
    path.write_text('\n'.join(lines) + more)
    return path


def test_the_lines_of_a_message_come_together_to_the_bit(tmp_path):
    path = write(tmp_path / 'plot_data.csv', {'/imu': 1.0, '/other/imu': 0.5})
    with open_recording(path) as recording:
        assert [(topic.name, topic.count) for topic in recording.topics] == [
            ('/imu', COUNT), ('/other/imu', COUNT)]
    for topic, scale in (('/imu', 1.0), ('/other/imu', 0.5)):
        messages, remarks = read(path, topic)
        assert messages.samples.tobytes() == (SAMPLES * scale).tobytes()
        assert remarks == []
    with path.open() as file:
        rows = [row for row in DictReader(file) if row['topic'] == '/imu.angular_velocity.x']
    assert messages.header_ns.tolist() == [
        int(row['header.stamp'].replace('.', '')) for row in rows]
    assert messages.receive_ns.tolist() == [
        int(row['receive time'].replace('.', '')) for row in rows]


def test_messages_received_at_once_are_distinguished_by_their_stamps(tmp_path):
    path = write(tmp_path / 'pairs.csv', {'/imu': 1.0})
    head, *rows = [line.split(',') for line in path.read_text().split('\n')]
    for number, cells in enumerate(rows):
        cells[1] = stamp(number % COUNT // 2 * 2)
    path.write_text('\n'.join(map(','.join, [head, *rows])))
    messages, remarks = read(path, '/imu')
    assert messages.samples.tobytes() == SAMPLES.tobytes()
    assert remarks == []
    # What nothing tells apart is counted.
    twins = [[*cells[:-1], '7.0'] for cells in rows if cells[0] == '0.0']
    path.write_text('\n'.join(map(','.join, [head, *rows, *twins])))
    messages, [remark] = read(path, '/imu')
    assert messages.samples.tolist() == [[7.0] * 6, *SAMPLES[1:].tolist()]
    assert remark == said(path, 'merged_messages', count=1)


def test_what_is_missing_or_no_number_is_reported(tmp_path):
    path = write(tmp_path / 'a.csv', {'/imu': 1.0}, '\n1,2,3\n1,x,,/imu.angular_velocity.x,5\n'
                 '1,1700000000.0,,/imu.orientation.x,5\n', headers=False)
    lines = path.read_text().split('\n')
    del lines[1 + 2 * COUNT + 7]
    path.write_text('\n'.join(lines))
    messages, remarks = read(path)
    assert np.argwhere(np.isnan(messages.samples)).tolist() == [[7, 2]]
    assert not messages.header_ns.any()
    assert remarks == [said(path, 'malformed_messages', what='line', count=2)]


def test_a_plot_of_something_else_says_what_to_plot(tmp_path):
    assert refusal(tmp_path / 'a.csv', HEAD + '\n0,1.0,,/odom.x,3\n') == (
        'no path in it is an axis of an IMU; plot paths such as /imu.angular_velocity.x and '
        'export them')
