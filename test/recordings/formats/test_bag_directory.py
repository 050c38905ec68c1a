# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""rosbag2 directories: split, compressed, of all versions, incomplete, hostile."""

import bags
from bags import assert_same, block, IMU, read, refusal, write_db3, write_mcap, write_metadata
from imu_allan import analyze
from imu_allan.finding import Finding
from imu_allan.recordings import open_recording, read_blocks
from processes import run
import pytest
from whole_lines import Varying
import zstandard

NO_FILE = ': no file that metadata.yaml lists is there; copy them beside it'
NO_BAG = 'holds no recording: no metadata.yaml and no .mcap or .db3 file'


def compress(path):
    """Replace a file by its zstd-compressed form, as rosbag2 does."""
    packed = path.with_name(f'{path.name}.zstd')
    packed.write_bytes(zstandard.compress(path.read_bytes()))
    path.unlink()
    return packed


@pytest.fixture
def split_bag(tmp_path):
    """Three MCAP files of 500 messages each, of which the numbers matter for their order."""
    folder = tmp_path / 'bag'
    folder.mkdir()
    names = [f'bag_{number}.mcap' for number in (9, 10, 11)]
    for place, name in enumerate(names):
        write_mcap(folder / name, block(500, first=500 * place))
    write_metadata(folder, names, [('/imu', IMU, 1500), ('/other', 'a_msgs/msg/B', 0)])
    return folder


def test_a_split_bag_is_read_in_order(split_bag):
    with open_recording(split_bag) as recording:
        assert [(topic.name, topic.count) for topic in recording.topics] == [('/imu', 1500)]
        assert recording.other_topics == {'/other': 'a_msgs/msg/B'}
        assert recording.size_bytes == sum(
            path.stat().st_size for path in split_bag.glob('*.mcap'))
        positions = []
        after = bags.joined(read_blocks(recording, '/imu', positions.append))
        assert recording.remarks == []
    assert_same(block(1500), after)
    assert positions == sorted(positions)
    assert positions[-1] == recording.size_bytes


@pytest.mark.parametrize(('text', 'reason'), [
    (None, None),
    # In the words of the YAML library, and of Python.
    ('rosbag2_bagfile_information: {', Varying('<words>')), ('[' * 100_000, Varying('<words>')),
    ('rosbag2_bagfile_information: 5', 'no rosbag2_bagfile_information'),
    ('a: 2001-99-99', 'no rosbag2_bagfile_information'),
    ('x: ' + 'y' * (1 << 20), 'it is larger than 1048576 bytes'),
    *((f'rosbag2_bagfile_information: {{{information}}}', reason) for information, reason in (
        ('relative_file_paths: [[1]]', 'relative_file_paths holds something else than file names'),
        ('relative_file_paths: [a, a]', 'relative_file_paths names a file twice'),
        ('relative_file_paths: [a]', 'no topics_with_message_count'),
        ('relative_file_paths: [bag_9.mcap, bag_10.mcap, bag_11.mcap], topics_with_message_count: '
         '[{topic_metadata: {name: /imu, type: sensor_msgs/msg/Imu, serialization_format: cdr}, '
         'message_count: -1}]', 'message_count is -1')))], ids=lambda value: str(value)[:60])
def test_without_usable_metadata_files_are_read_by_their_numbers(split_bag, text, reason):
    (split_bag / 'metadata.yaml').unlink()
    if text is not None:
        (split_bag / 'metadata.yaml').write_text(text)
    after, [remark] = read(split_bag)
    assert_same(block(1500), after)
    assert (remark.code, remark.values) == (
        'no_metadata', {'recording': str(split_bag), 'reason': reason})


def test_a_missing_file_is_named_and_the_others_are_read(split_bag):
    others = bags.joined([block(500), block(500, first=1000)])
    file = split_bag / 'bag_10.mcap'
    file.write_bytes(b'version https://git-lfs.github.com/spec/v1\noid 1')
    after, [remark] = read(split_bag)
    assert_same(others, after)
    assert remark == bags.said(split_bag, 'damaged_recording', fault='file', reason=(
        f'{file}: a git-LFS pointer, not the recording itself; fetch it with: git lfs pull'))
    file.unlink()
    after, [remark] = read(split_bag)
    assert_same(others, after)
    assert remark == bags.said(split_bag, 'missing_file', missing=1, listed=3, files='bag_10.mcap')
    for path in split_bag.glob('*.mcap'):
        path.unlink()
    missing = 'missing bag_9.mcap, bag_10.mcap, bag_11.mcap' + NO_FILE
    assert refusal(split_bag) == missing
    write_mcap(split_bag / 'renamed.mcap', block(5))
    assert refusal(split_bag) == f'{missing}, or name renamed.mcap itself'


def test_files_compressed_as_a_whole_are_read(tmp_path):
    names = [compress(write_mcap(tmp_path / f'bag_{number}.mcap', block(500, first=500 * number))
                      ).name for number in range(3)]
    # rosbag2 of Foxy listed the names without their last suffix.
    for suffix in ('.zstd', ''):
        write_metadata(
            tmp_path, [name.removesuffix(suffix) for name in names], [('/imu', IMU, 1500)],
            compression_format='zstd', compression_mode='FILE')
        after, remarks = read(tmp_path)
        assert_same(block(1500), after)
        assert remarks == []


def packed_gigabyte(size):
    """Return a gigabyte of zeros, compressed, which declares its size or (-1) none."""
    compressor = zstandard.ZstdCompressor().compressobj(size=size)
    return b''.join(compressor.compress(bytes(1 << 22)) for _ in range(256)) + compressor.flush()


def test_of_a_compressed_file_the_same_is_read_as_of_the_file(tmp_path):
    path = tmp_path / 'imu.csv'
    path.write_text('time [ms],gx,ax\n' + ''.join(f'{n},1,\n{n}.5,,2\n' for n in range(40)))
    plain, packed = analyze(path), analyze(compress(path))
    assert plain.axes == packed.axes
    assert list(plain.axes) == ['gyro_x', 'accel_x']


def test_a_compressed_file_is_unpacked_where_there_is_room_and_none_is_left(tmp_path, monkeypatch):
    temporary = tmp_path / 'temporary'
    temporary.mkdir()
    monkeypatch.setattr('tempfile.tempdir', str(temporary))
    path = compress(write_db3(tmp_path / 'a.db3', block(100)))
    assert_same(block(100), read(path)[0])
    assert list(temporary.iterdir()) == []
    bomb = ('expands to more than 1000 times its size, as no recording of an IMU does; if it is '
            'one, unpack it with: zstd -d')
    for content, reason in (
            (zstandard.compress(b'not a recording'),
             'neither a rosbag2 directory nor a .mcap, .db3, ROS 1 .bag, PX4 .ulg, ArduPilot .bin '
             'or CSV file'), (packed_gigabyte(1 << 30), bomb), (packed_gigabyte(-1), bomb)):
        assert refusal(path, content) == reason
        assert list(temporary.iterdir()) == []
    monkeypatch.setattr('imu_allan.recordings.recording.RESERVED_DISK_BYTES', 2**60)
    assert refusal(path) == (
        f'no room to decompress it in {temporary}; name a larger folder with TMPDIR')


def test_messages_compressed_one_by_one_are_read(tmp_path):
    messages = block(300)
    stamped = [(stamp, zstandard.compress(row)) for stamp, row in bags.serialized(messages)]
    stamped[7] = stamped[7][0], stamped[7][1][:20]
    path = tmp_path / 'bag_0.mcap'
    with bags.mcap_written(path) as message:
        for stamp, data in stamped:
            message('/imu', stamp, data)
    write_metadata(tmp_path, [path.name], [('/imu', IMU, 300)],
                   compression_format='zstd', compression_mode='MESSAGE')
    after, [remark] = read(tmp_path)
    assert remark == bags.said(path, 'malformed_messages', what='message', count=1, topic='/imu',
                               type='sensor_msgs/Imu', first=remark.values['first'])
    assert bags.figures(remark.values['first']) == [0]
    assert_same(bags.joined([block(7), block(292, first=8)]), after)


@pytest.mark.parametrize('listed', ['../../outside.mcap', '/etc/outside.mcap'])
def test_no_file_outside_of_the_directory_is_read(tmp_path, listed):
    write_mcap(tmp_path / 'outside.mcap', block(5))
    folder = tmp_path / 'bag' / 'inner'
    folder.mkdir(parents=True)
    write_metadata(folder, [listed], [('/imu', IMU, 5)])
    assert refusal(folder) == 'missing outside.mcap' + NO_FILE


@pytest.mark.parametrize(('files', 'reason'), [
    ([], 'an empty folder; name a recording'), (['notes.txt'], NO_BAG)], ids=['nothing', 'notes'])
def test_a_folder_that_is_no_bag_is_refused(tmp_path, files, reason):
    for file in files:
        (tmp_path / file).touch()
    assert refusal(tmp_path) == reason


def test_messages_that_metadata_counts_and_no_file_holds_are_reported(tmp_path):
    write_db3(tmp_path / 'bag_0.db3', block(90))
    # Another remark does not hide the loss; no other explains why most are missing.
    for counted, other, severity in (
            (100, 'no_metadata', 'know'), (200, 'truncated_recording', 'act')):
        write_metadata(tmp_path, ['bag_0.db3'], [('/imu', IMU, counted)])
        with open_recording(tmp_path) as recording:
            recording.remarks += [Finding(other)]
            list(recording.decoded('/imu'))
            assert recording.remarks[1:] == [
                bags.said(tmp_path, 'lost_messages', found=90, counted=counted, topic='/imu',
                          severity=severity)]


EXPANDING = {
    'merged keys': 'a0: &a0 {x: 1}\n' + ''.join(
        f'a{level}: &a{level} {{<<: [{", ".join([f"*a{level - 1}"] * 9)}]}}\n'
        for level in range(1, 12)),
    'aliases': 'a0: &a0 [x]\n' + ''.join(
        f'a{level}: &a{level} [{", ".join([f"*a{level - 1}"] * 9)}]\n' for level in range(1, 12)),
    'one key many times': 'x: 1\n' * 16_000,
}


@pytest.mark.parametrize('name', EXPANDING)
def test_metadata_that_grows_costs_the_process_little_time_and_memory(tmp_path, name):
    write_db3(tmp_path / 'a_0.db3', block(300))
    (tmp_path / 'metadata.yaml').write_text(EXPANDING[name])
    status, _, err = run('info', tmp_path, '--no-progress')
    assert (status, err) == (0, '')


@pytest.mark.parametrize('name', ['1:30', '2024-01-01', 'yes'])
def test_names_that_yaml_would_turn_into_something_else_stay_names(tmp_path, name):
    write_db3(tmp_path / name, block(300))
    write_metadata(tmp_path, [name], [('/imu', IMU, 300)])
    after, remarks = read(tmp_path)
    assert (len(after), remarks) == (300, [])


def test_of_thousands_of_damaged_files_ten_are_reported(tmp_path):
    write_db3(tmp_path / 'a_0.db3', block(300))
    for number in range(1, 3000):
        (tmp_path / f'a_{number}.db3').write_bytes(b'no database')
    after, remarks = read(tmp_path)
    assert len(after) == 300
    left_out = [remark for remark in remarks if remark.code == 'damaged_recording']
    assert len(left_out) == 10
