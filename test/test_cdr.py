# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The encoder of sensor_msgs/Imu and its decoder, held against rosbags and each other."""

from itertools import pairwise

from bags import assert_same, block, raise_malformed, serialized
from hypothesis import given, settings, strategies as st
from imu_allan import cdr
from imu_allan.cdr import batches_of, encode_imu_rows, IMU_TYPE
from imu_allan.recordings import RecordingOptions
from imu_allan.recordings.messages.imus_in import imus_in
from imu_messages import encode_imu
import numpy as np
import pytest
from rosbags.typesys import get_typestore, Stores
from whole_lines import refused

FRAMES = st.text(st.characters(exclude_characters='\0', exclude_categories=['Cs']), max_size=40)
STORE = get_typestore(Stores.ROS2_JAZZY)
MESSAGE = encode_imu(5, np.arange(6.), 'imu')


def blocks_of(messages, receive_ns, serialization='cdr'):
    [known] = imus_in('', IMU_TYPE, serialization, None, RecordingOptions()).values()
    return known.decoder()(batches_of(messages, receive_ns), raise_malformed)


def decoded(message):
    [after] = blocks_of([message], np.zeros(1, np.int64))
    return after


@given(FRAMES, st.sampled_from(['cdr', 'big-endian', 'ros1']), st.integers(1, 20),
       st.integers(-2**31, 2**31 - 1), st.integers(0, 10**9 - 1),
       st.lists(st.floats(width=64), min_size=6, max_size=6))
def test_decoding_gives_every_bit_back(frame_id, form, count, sec, nanosec, sample):
    before = block(count, frame_id)
    before.absent[::2, 0] = before.absent[::3, 1] = True
    before.header_ns[0] = (sec if form != 'ros1' else sec % 2**31) * 10**9 + nanosec
    before.samples[0] = sample
    serialization = 'ros1' if form == 'ros1' else 'cdr'
    messages = [message for _, message in serialized(before, serialization)]
    if form == 'big-endian':
        messages = [bytes(STORE.serialize_cdr(
            STORE.deserialize_cdr(message, IMU_TYPE), IMU_TYPE, little_endian=False))
            for message in messages]
    [after] = blocks_of(messages, before.receive_ns, serialization)
    assert_same(before, after)


@pytest.mark.parametrize('little_endian', [True, False])
@pytest.mark.parametrize('frame_id', ['', 'imu', 'ä°'])
def test_agrees_with_rosbags(frame_id, little_endian):
    types = STORE.types
    vector, covariance = types['geometry_msgs/msg/Vector3'], np.arange(9) / 7
    message = types['sensor_msgs/msg/Imu'](
        types['std_msgs/msg/Header'](types['builtin_interfaces/msg/Time'](-5, 6), frame_id),
        types['geometry_msgs/msg/Quaternion'](.1, .2, .3, .4), covariance,
        vector(1., 2., 3.), np.full(9, -1.), vector(4., 5., 6.), covariance)
    raw = bytes(STORE.serialize_cdr(message, 'sensor_msgs/msg/Imu', little_endian=little_endian))
    after = decoded(raw)
    assert (after.header_ns.tolist(), after.samples.tolist(), after.absent.tolist(),
            after.frame_id) == (
        [-5 * 10**9 + 6], [[1., 2., 3., 4., 5., 6.]], [[True, False]], frame_id)
    back = STORE.deserialize_cdr(
        encode_imu(-5 * 10**9 + 6, after.samples[0], frame_id, (True, False)),
        'sensor_msgs/msg/Imu')
    assert (back.header, back.angular_velocity, back.linear_acceleration) == (
        message.header, message.angular_velocity, message.linear_acceleration)
    assert back.angular_velocity_covariance[0] == back.orientation_covariance[0] == -1.


@given(st.lists(st.sampled_from(['imu', 'gyro', 'imu_a', 'a_much_longer_frame']), max_size=30))
def test_another_frame_id_starts_another_block_and_order_is_kept(frames):
    parts = [block(1, frame, first) for first, frame in enumerate(frames)]
    messages = [encode_imu_rows(part).tobytes() for part in parts]
    receive = np.arange(len(parts), dtype=np.int64)
    blocks = blocks_of(messages, receive)
    assert [frame for item in blocks for frame in [item.frame_id] * len(item)] == frames
    assert np.concatenate([item.receive_ns for item in blocks] or [receive]).tolist() == (
        receive.tolist())
    assert all(first.frame_id != second.frame_id for first, second in pairwise(blocks))
    for part, sample in zip(parts, (row for item in blocks for row in item.samples), strict=True):
        assert part.samples[0].tolist() == sample.tolist()


def test_padding_to_four_bytes_behind_a_message_is_tolerated():
    assert decoded(MESSAGE + bytes(3)).samples.tolist() == [[*range(6)]]


@pytest.mark.parametrize(('message', 'reason'), [
    (b'', '0 bytes are too few for a message'),
    (MESSAGE[:-1], '315 bytes are too few for its type, which takes 316 or more'),
    (MESSAGE + bytes(8), f'324 bytes are not a message of type {IMU_TYPE}, which takes 316'),
    (b'\0\7' + MESSAGE[2:], 'encapsulation 0x0007 is not plain CDR'),
    (MESSAGE[:12] + b'\xff' * 4 + MESSAGE[16:],
     '316 bytes are too few for its type, which takes 4294967311 or more'),
])
def test_what_is_no_imu_message_is_refused_with_its_reason(message, reason):
    with refused(reason, cdr.MalformedImu):
        decoded(message)


@given(st.integers(1, 50), st.integers(0, 40), st.data())
@settings(max_examples=200, deadline=None)
def test_rows_that_differ_anywhere_in_a_span_are_distinguished(size, start, data):
    rows = np.tile(np.arange(100, dtype=np.uint8), (9, 1))
    spans = [(start, min(start + size, 100)), (90, 92)]
    for row, at in data.draw(st.sets(st.tuples(st.integers(0, 8), st.integers(0, 99)))):
        rows[row, at] += 1
    expected = np.all([(rows[:, a:b] == rows[0, a:b]).all(axis=1) for a, b in spans], axis=0)
    like = cdr.rows_like_first(rows, spans)
    assert (like is None) == expected.all()
    assert like is None or like.tolist() == expected.tolist()


def test_megabytes_of_frame_id_are_shortened_where_they_come_in():
    after = decoded(encode_imu(1, np.ones(6), 'a' * 500_000 + 'b' * 500_000))
    assert after.frame_id == 'a' * 99 + '…' + 'b' * 99
    assert after.samples.tolist() == [[1] * 6]


def test_a_stamp_that_no_message_can_hold_is_not_written():
    late = block(1)
    late.header_ns[0] = 2**31 * 10**9
    with refused('header stamps before 1901 or after 2038 cannot be written: '
                 'builtin_interfaces/Time has 32 bits for the seconds'):
        encode_imu_rows(late)
