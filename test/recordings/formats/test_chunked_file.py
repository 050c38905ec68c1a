# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Files of chunks, MCAP and ROS 1 bags, whole and damaged; what bags alone do."""

import bz2
import struct

import bags
from bags import assert_same, block, chunk_starts, figures, read, said, write_bag, write_mcap
from imu_allan.recordings import open_recording
import lz4.frame
from mcap.writer import IndexType
import numpy as np
from processes import run
import pytest
import zstandard

MESSAGES = block(3000)
KINDS = [*((write_mcap, {'compression': name}) for name in bags.COMPRESSIONS),
         *((write_bag, {'compression': name}) for name in bags.ROS1_COMPRESSIONS)]


def name_of(argument):
    """Name a writer, or its options, the same in every process."""
    return getattr(argument, '__name__', None) or str(argument)


@pytest.mark.parametrize(('write', 'options'), [
    *KINDS, (write_mcap, {'index_types': IndexType.NONE}), (write_mcap, {'use_chunking': False})],
    ids=name_of)
@pytest.mark.parametrize('others', [lambda _: 0, lambda n: n % 2, lambda n: 5 * (n % 70 == 0)],
                         ids=['alone', 'alternating', 'bursts'])
def test_every_bit_of_what_another_library_wrote_is_read(tmp_path, write, options, others):
    path = write(tmp_path / 'a', MESSAGES, others=others, **options)
    with open_recording(path) as recording:
        assert [(topic.name, topic.count) for topic in recording.topics] == [('/imu', 3000)]
        assert recording.other_topics == (
            {'/other': 'a_msgs/msg/B'} if write is write_mcap else {'/chatter': 'std_msgs/String'})
    after, remarks = read(path)
    assert_same(MESSAGES, after)
    assert remarks == []


@pytest.mark.parametrize('library', [zstandard, lz4.frame], ids=name_of)
def test_chunks_of_several_frames_are_read(tmp_path, monkeypatch, library):
    one = library.compress
    monkeypatch.setattr(library, 'compress', lambda data: b''.join(
        one(data[at:at + 9999]) for at in range(0, len(data), 9999)))
    path = write_mcap(tmp_path / 'a.mcap', MESSAGES,
                      compression='zstd' if library is zstandard else 'lz4')
    assert_same(MESSAGES, read(path)[0])


@pytest.mark.parametrize(('write', 'options'), KINDS, ids=name_of)
def test_a_damaged_chunk_is_left_out_and_reading_goes_on_at_the_next(tmp_path, write, options):
    path = write(tmp_path / 'a', MESSAGES, **options)
    whole, starts = path.read_bytes(), chunk_starts(path)
    start, size = starts[2], starts[3] - starts[2]
    for at, damage, named in (
            (start + 200, b'\xa5' * (size // 4), [start + (9 if write is write_mcap else 0)]),
            # Its head, too: the index names the next.
            (start, b'\xff' * size, [start, size])):
        path.write_bytes(whole[:at] + damage + whole[at + len(damage):])
        after, [remark] = read(path)
        assert np.isin(after.receive_ns, MESSAGES.receive_ns).all()
        assert 20 < 3000 - len(after) < 200
        first = remark.values['first']
        assert figures(first)[:len(named)] == named
        assert remark == said(path, 'damaged_recording', fault='places', places=1, first=first,
                              lost=3000 - len(after), of=3000, topic='/imu')
    # Where most is lost, that matters more than what a longer recording would show.
    path.write_bytes(whole[:start] + bytes(len(whole) - start))
    assert {remark.severity for remark in read(path)[1]} == {'act'}


def test_a_truncated_bag_without_index_gives_every_whole_chunk(tmp_path):
    path = write_bag(tmp_path / 'a.bag', MESSAGES, 'lz4', lambda n: n % 2)
    whole = path.read_bytes()
    places = chunk_starts(path)
    assert len(places) > 5
    path.write_bytes(whole[:places[4] + 100])
    with open_recording(path) as recording:
        [topic] = recording.topics
    after, [remark] = read(path)
    assert_same(block(len(after)), after)
    assert topic.count == len(after) > 300
    assert remark == said(path, 'truncated_recording', fault='ends', whole_chunks=4,
                          end=remark.values['end'])
    assert figures(remark.values['end']) == [100, places[4]]


COMPRESS = {'lz4': lz4.frame.compress, 'bz2': bz2.compress}


@pytest.mark.parametrize('compression', COMPRESS)
def test_a_bomb_of_tiny_records_costs_the_process_little_time(tmp_path, compression):
    path = write_bag(tmp_path / 'a.bag', MESSAGES, compression)
    tiny = bags.ros1_record(op=b'\7', conn=struct.pack('<I', 9), topic=b'/imu')
    plain = tiny * ((1 << 24) // len(tiny))
    packed = COMPRESS[compression](plain)
    chunk = bags.ros1_record(packed, op=b'\5', compression=compression.encode(),
                             size=struct.pack('<I', len(plain)))
    content, place = path.read_bytes(), chunk_starts(path)[2]
    assert len(packed) < 500_000
    # Cut short behind it, so that the bag has no index and all of its chunks are gone through.
    path.write_bytes(content[:place] + chunk)
    status, shown, complaint = run('info', path, '--no-progress', most_kb=400_000)
    assert (status, complaint) == (0, '')
    assert (f'warning: {path}: left out 1 damaged place (the first at byte {place}: more '
            'connections than a bag has)') in shown.splitlines()
