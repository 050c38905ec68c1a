# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""ROS 1 bags, whole and damaged."""

import bz2
from pathlib import Path
import struct

from bags import (
    assert_same,
    block,
    figures,
    joined,
    read,
    ROS1_COMPRESSIONS,
    ros1_record,
    ROS1_STORE,
    told,
    write_bag,
)
from imu_allan.cdr import encode_imu_rows
from imu_allan.recordings import choose_topic, open_recording, read_blocks
import lz4.frame
from measured_command import run
import pytest
from repeated import combined
from rosbags.rosbag1 import Reader, Writer
from whole_lines import refused

MESSAGES = block(3000)


def chunk_places(path: Path) -> list[int]:
    with Reader(path) as reader:
        return [info.pos for info in reader.chunk_infos]


@pytest.mark.parametrize('compression', ROS1_COMPRESSIONS)
@pytest.mark.parametrize('others', [lambda _: 0, lambda n: n % 2, lambda n: 5 * (n % 70 == 0)],
                         ids=['alone', 'alternating', 'bursts'])
def test_every_bit_of_what_rosbags_wrote_is_read(tmp_path, compression, others):
    path = write_bag(tmp_path / 'a.bag', MESSAGES, compression, others)
    with open_recording(path) as recording:
        assert [(topic.name, topic.count) for topic in recording.topics] == [('/imu', 3000)]
        assert recording.other_topics == {'/chatter': 'std_msgs/String'}
    after, remarks = read(path)
    assert_same(MESSAGES, after)
    assert remarks == []


def test_a_truncated_bag_without_index_gives_every_whole_chunk(tmp_path):
    path = write_bag(tmp_path / 'a.bag', MESSAGES, 'lz4', lambda n: n % 2)
    whole = path.read_bytes()
    places = chunk_places(path)
    assert len(places) > 5
    path.write_bytes(whole[:places[4] + 100])
    with open_recording(path) as recording:
        [topic] = recording.topics
    after, [remark] = read(path)
    assert_same(block(len(after)), after)
    assert topic.count == len(after) > 300
    assert remark == told(path, 'truncated_recording', fault='ends', whole_chunks=4,
                          end=remark.values['end'])
    assert figures(remark.values['end']) == [100, places[4]]


@pytest.mark.parametrize('compression', ROS1_COMPRESSIONS)
def test_a_damaged_chunk_is_left_out_and_counted(tmp_path, compression):
    path = write_bag(tmp_path / 'a.bag', MESSAGES, compression)
    data = bytearray(path.read_bytes())
    places = chunk_places(path)
    size = (places[3] - places[2]) // 4
    data[places[2] + 200:places[2] + 200 + size] = b'\xa5' * size
    path.write_bytes(data)
    after, [remark] = read(path)
    lost = 3000 - len(after)
    assert 20 < lost < 200
    assert remark == told(path, 'damaged_recording', fault='chunks', broken=1, chunks=len(places),
                          first=remark.values['first'], lost=lost, of=3000, topic='/imu')
    assert figures(remark.values['first'])[0] == places[2]


def test_reading_goes_on_at_the_next_chunk_that_the_index_names(tmp_path):
    path = write_bag(tmp_path / 'a.bag', MESSAGES)
    data = bytearray(path.read_bytes())
    places = chunk_places(path)
    size = places[3] - places[2]
    data[places[2]:places[3]] = b'\xff' * size
    path.write_bytes(data)
    after, [remark] = read(path)
    lost = 3000 - len(after)
    assert 20 < lost < 200
    assert remark == told(path, 'damaged_recording', fault='holes', holes=1, lost=lost, of=3000,
                          topic='/imu', first=remark.values['first'])
    assert figures(remark.values['first']) == [size, places[2]]


@pytest.mark.parametrize(('content', 'reason'), [
    (b'#ROSBAG V1.2\nsomething else',
     'ROS bag version 1.2 is not supported; convert it to 2.0 with: rosbag fix'),
    (b'#ROSBAG V2.0', 'cut short within its first line; copy it again'),
    (b'#ROSBAG V2.0\n' + ros1_record(op=b'\3', encryptor=b'rosbag/AesCbcEncryptor'),
     'encrypted; decrypt it with: rosbag decrypt')])
def test_other_versions_and_encrypted_bags_are_refused(tmp_path, content, reason):
    path = tmp_path / 'a.bag'
    path.write_bytes(content)
    with refused(f'{path}: {reason}'):
        open_recording(path)


def test_an_empty_bag_is_named(tmp_path):
    path = tmp_path / 'a.bag'
    with Writer(path):
        pass
    line = f'{path}: it holds no topics at all: the recording is empty'
    with open_recording(path) as recording, refused(line):
        choose_topic(recording)


def test_frame_ids_that_change_are_kept(tmp_path):
    path = tmp_path / 'a.bag'
    parts = [block(40), block(3, 'another', 40), block(1, 'x', 43), block(60, first=44)]
    with Writer(path) as writer:
        imu = writer.add_connection('/imu', 'sensor_msgs/msg/Imu', typestore=ROS1_STORE)
        for part in parts:
            for row, stamp in zip(
                    encode_imu_rows(part, 'ros1'), part.receive_ns.tolist(), strict=True):
                writer.write(imu, stamp, row.tobytes())
    with open_recording(path) as recording:
        blocks = list(read_blocks(recording, '/imu'))
    assert [(item.frame_id, len(item)) for item in blocks] == [
        ('imu_link', 40), ('another', 3), ('x', 1), ('imu_link', 60)]
    assert_same(joined(parts), joined(blocks))


TINY = {
    'messages of 20 connections': b''.join(
        ros1_record(op=b'\2', conn=struct.pack('<I', number), time=bytes(8))
        for number in range(7, 27)),
    'connections': ros1_record(op=b'\7', conn=struct.pack('<I', 9), topic=b'/imu'),
    'others': ros1_record(op=b'\4')}


COMPRESS = {'lz4': lz4.frame.compress, 'bz2': bz2.compress}


@pytest.mark.parametrize(('compression', 'tiny'), combined(
    [*COMPRESS], [*TINY], everyday=zip(['lz4', 'bz2', 'lz4'], TINY, strict=True)))
def test_a_bomb_of_tiny_records_costs_the_process_little_time(tmp_path, compression, tiny):
    path = write_bag(tmp_path / 'a.bag', MESSAGES, compression)
    plain = TINY[tiny] * ((1 << 24) // len(TINY[tiny]))
    packed = COMPRESS[compression](plain)
    chunk = ros1_record(packed, op=b'\5', compression=compression.encode(),
                        size=struct.pack('<I', len(plain)))
    content, place = path.read_bytes(), chunk_places(path)[2]
    assert len(packed) < 500_000
    # Cut short behind it, so that the bag has no index and all of its chunks are gone through.
    path.write_bytes(content[:place] + chunk)
    status, shown, complaint, seconds, kilobytes = run('info', path, '--no-progress')
    assert (status, complaint) == (0, '')
    assert seconds < 10
    assert kilobytes < 400_000
    assert (f'warning: {path}: left out 1 damaged chunk of 3 (the first at byte {place}: more '
            'records than its bytes can hold)') in shown.splitlines()
