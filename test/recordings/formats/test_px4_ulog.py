# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""PX4 logs, written field by field as the ULog specification says, and by pyulog itself."""

from struct import pack

from bags import assert_same, read, refusal, said
from imu_allan import analyze
from imu_allan.recordings import open_recording
import numpy as np
import pytest

pyulog = pytest.importorskip('pyulog')

COUNT = 400
TIMES_US = 5_000_000 + 4_000 * np.arange(COUNT)
SAMPLES = np.sin(np.arange(COUNT)[:, np.newaxis] * np.arange(1, 7)).astype(np.float32)
COMBINED = ('sensor_combined', 'uint64_t timestamp;float[3] gyro_rad;uint32_t gyro_integral_dt;'
            'int32_t accelerometer_timestamp_relative;float[3] accelerometer_m_s2;')
FIFO = ('uint64_t timestamp;uint64_t timestamp_sample;uint32_t device_id;float dt;float scale;'
        'uint8_t samples;int16_t[4] x;int16_t[4] y;int16_t[4] z;')
ONE = ('uint64_t timestamp;uint64_t timestamp_sample;uint32_t device_id;float x;float y;float z;')
THIN = ('(px4_msgs/msg/SensorCombined); 1 Hz are too thin; set SDLOG_PROFILE in the autopilot '
        '(bit 4: high rate; bits 8 and 9: FIFOs of gyroscope and accelerometer) and record again')
LACKS = ('(px4_msgs/msg/SensorCombined); px4_msgs/msg/SensorCombined has no field gyro_rad in the '
         'definition that comes with it; name the fields with --gyro and --accel')


def framed(kind, body):
    return pack('<H', len(body)) + kind + body


def write(path, topics):
    data = b'ULog\x01\x12\x35\x01' + pack('<Q', 0) + framed(b'B', bytes(40))
    for name, (form, _) in topics.items():
        data += framed(b'F', f'{name}:{form}'.encode())
    for number, name in enumerate(topics):
        data += framed(b'A', pack('<BH', 0, number) + name.encode())
    for number, (_, messages) in enumerate(topics.values()):
        for message in messages:
            data += framed(b'D', pack('<H', number) + message)
    path.write_bytes(data)
    return path


def combined(step=1):
    return COMBINED[1], [
        pack('<Q3fIi3f', TIMES_US[n] * step, *SAMPLES[n, :3], 4000, 0, *SAMPLES[n, 3:])
        for n in range(COUNT)]


def one(columns, step_us=4_000):
    return ONE, [pack('<QQI3f', 90 + n * step_us, n * step_us + 1, 7, *SAMPLES[n, columns])
                 for n in range(COUNT)]


def fifo():
    return FIFO, [pack('<QQIffB12h', 9, 1_000_000 + 500 * n, 7, 125.0, 0.5, 4, *range(n, n + 12))
                  for n in range(COUNT)]


@pytest.mark.parametrize(('name', 'content'), [
    ('sensor_combined', combined()), ('sensor_gyro', one(slice(0, 3))),
    ('sensor_gyro_fifo', fifo())], ids=['combined', 'gyro', 'fifo'])
def test_a_log_that_pyulog_writes_is_read_equally(tmp_path, name, content):
    first = write(tmp_path / 'a.ulg', {name: content})
    pyulog.ULog(str(first)).write_ulog(str(tmp_path / 'b.ulg'))
    messages = read(first)[0]
    assert_same(read(tmp_path / 'b.ulg')[0], messages)
    if name == 'sensor_combined':
        assert messages.samples.tobytes() == SAMPLES.astype(np.float64).tobytes()
        assert messages.header_ns.tolist() == (TIMES_US * 1000).tolist()


def test_the_topic_or_pair_with_the_highest_rate_is_chosen(tmp_path):
    path = write(tmp_path / 'a.ulg', {
        'sensor_combined': combined(), 'sensor_gyro': one(slice(0, 3), 1_000),
        'sensor_accel': one(slice(3, 6), 2_000)})
    result = analyze(path)
    assert result.source.topic == 'sensor_gyro, sensor_accel'
    [chosen] = [remark for remark in result.warnings if remark.code == 'chosen_topic']
    assert chosen == said(
        path, 'chosen_topic', topics=3, others=['sensor_combined'],
        chosen=['sensor_gyro', 'sensor_accel'], reason=chosen.values['reason'])
    assert analyze(path, 'sensor_combined').source.topic == 'sensor_combined'


def test_a_burst_that_is_none_is_left_out_and_reported(tmp_path):
    form, messages = fifo()
    messages[7] = pack('<QQIffB12h', 9, 1_003_500, 7, float('nan'), 0.5, 4, *range(12))
    messages[9] = pack('<QQIffB12h', 9, 1_004_500, 7, 125.0, 0.5, 200, *range(12))
    path = write(tmp_path / 'a.ulg', {'sensor_gyro_fifo': (form, messages)})
    found, [remark] = read(path)
    whole, _ = read(write(tmp_path / 'b.ulg', {'sensor_gyro_fifo': fifo()}))
    kept = ~np.isin(np.arange(len(whole)) // 4, [7, 9])
    assert found.header_ns.tolist() == whole.header_ns[kept].tolist()
    assert found.samples.tobytes() == whole.samples[kept].tobytes()
    assert remark == said(path, 'malformed_messages', what='message', count=2,
                          topic='sensor_gyro_fifo', type='px4_msgs/msg/SensorGyroFifo',
                          first=remark.values['first'])


def test_a_topic_of_bursts_that_are_none_is_passed_over_with_the_reason(tmp_path):
    bursts = FIFO, [pack('<QQIffB12h', 9, 1_000_000 + 500 * n, 7, 125.0, 0.5, 0, *range(12))
                    for n in range(COUNT)]
    path = write(tmp_path / 'a.ulg', {'sensor_combined': combined(), 'sensor_gyro_fifo': bursts})
    with open_recording(path) as recording:
        assert [topic.name for topic in recording.topics] == ['sensor_combined']
        assert recording.reasons['sensor_gyro_fifo'].startswith('samples is not 1 to 4')


@pytest.mark.parametrize(('form', 'said'), [
    ('float[3] gyro_rad;int32_t dt;float[3] accelerometer_m_s2;',
     '(px4_msgs/msg/SensorCombined); its messages have no time'),
    ('uint64_t timestamp;float[2] gyro_rad;float[3] accelerometer_m_s2;', LACKS),
    (None, THIN)])
def test_a_topic_that_is_thin_or_lacks_a_field_is_reported(tmp_path, form, said):
    path = write(tmp_path / 'a.ulg', {
        'sensor_combined': (form, [bytes(60)] * COUNT) if form else combined(step=250)})
    assert refusal(path) == (
        f'no topic of type sensor_msgs/msg/Imu; it holds sensor_combined {said}')


def test_what_is_damaged_is_left_out_and_reported(tmp_path):
    form, messages = combined()
    path = write(tmp_path / 'a.ulg', {'sensor_combined': (form, messages)})
    data = path.read_bytes()
    mark = framed(b'S', bytes.fromhex('2f731320250cbb12'))
    one = len(framed(b'D', b'--' + messages[0]))
    at = len(data) - 100 * one
    path.write_bytes(data[:at] + bytes(70) + mark + data[at:-1])
    found, remarks = read(path)
    assert len(found) == COUNT - 1
    assert remarks == [said(path, 'damaged_recording', fault='bytes', bytes=70),
                       said(path, 'truncated_recording', fault='log', bytes=one - 1)]


def test_the_number_of_a_topic_may_go_over_to_another_and_back(tmp_path):
    form, messages = combined()
    whole = write(tmp_path / 'a.ulg', {'sensor_combined': (form, messages)})
    data = write(tmp_path / 'b.ulg', {'sensor_combined': (form, messages[:200])}).read_bytes()
    data += framed(b'F', b'other:uint64_t timestamp;')
    for name, more in ('other', [bytes(60)] * 9), ('sensor_combined', messages[200:]):
        data += framed(b'A', bytes(3) + name.encode()) + b''.join(
            framed(b'D', bytes(2) + message) for message in more)
    (tmp_path / 'b.ulg').write_bytes(data)
    assert_same(read(tmp_path / 'b.ulg')[0], read(whole)[0])


def test_a_damaged_subscription_ends_no_topic(tmp_path):
    form, messages = combined()
    path = write(tmp_path / 'a.ulg', {'sensor_combined': (form, messages)})
    data, place = path.read_bytes(), path.read_bytes().index(framed(b'D', bytes(2) + messages[0]))
    path.write_bytes(data[:place] + framed(b'A', b'\0') + framed(b'A', b'\0\0\0senso')
                     + data[place:])
    found, remarks = read(path)
    assert len(found) == COUNT
    assert remarks == [said(path, 'damaged_recording', fault='bytes', bytes=4 + 11)]
