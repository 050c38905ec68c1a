# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""metadata.yaml of unknown origin: what rosbag2 writes is read, anything that grows is not."""

from bags import block, IMU, read, said, write_db3, write_metadata
from measured_command import run
import pytest

EXPANDING = {
    'merged keys': 'a0: &a0 {x: 1}\n' + ''.join(
        f'a{level}: &a{level} {{<<: [{", ".join([f"*a{level - 1}"] * 9)}]}}\n'
        for level in range(1, 12)),
    'aliases': 'a0: &a0 [x]\n' + ''.join(
        f'a{level}: &a{level} [{", ".join([f"*a{level - 1}"] * 9)}]\n' for level in range(1, 12)),
    'base of 60': 'x: 1' + ':59' * 300_000 + '\n',
    'digits': 'x: ' + '9' * 6000 + '\n',
    'keys': ''.join(f'k{number}: 1\n' for number in range(60_000)),
    'size': 'x: "' + 'y' * 2_000_000 + '"\n',
    'one key many times': 'x: 1\n' * 16_000,
    'objects': 'x: !!python/object/apply:os.system ["true"]\n',
}


@pytest.mark.parametrize('name', EXPANDING)
def test_metadata_that_grows_costs_the_process_little_time_and_memory(tmp_path, name):
    write_db3(tmp_path / 'a_0.db3', block(300))
    (tmp_path / 'metadata.yaml').write_text(EXPANDING[name])
    status, _, err, seconds, kilobytes = run('info', tmp_path, '--no-progress')
    assert (status, err) == (0, '')
    assert seconds < 10
    assert kilobytes < 300_000


def believed(count: int, times: int = 1) -> str:
    """Return metadata of a file, and of how many messages it has."""
    return '\n'.join([
        'rosbag2_bagfile_information:', '  relative_file_paths:', *['    - a_0.db3'] * times,
        '  topics_with_message_count:', '    - topic_metadata:', '        name: /imu',
        f'        type: {IMU}', '        serialization_format: cdr',
        f'      message_count: {count}'])


@pytest.mark.parametrize(('text', 'reason'), [
    ('k: [' + '1,' * 30_000 + ']', 'it has more than 30000 entries'),
    ('x: ' + 'y' * (1 << 20), 'it is larger than 1048576 bytes'),
    (believed(600_000, 2000), 'relative_file_paths names a file twice'),
    (believed(-1), 'message_count is -1')],
    ids=['entries', 'size', 'one file many times', 'negative count'])
def test_metadata_that_rosbag2_does_not_write_is_reported_and_the_file_read_once(
        tmp_path, text, reason):
    write_db3(tmp_path / 'a_0.db3', block(300))
    (tmp_path / 'metadata.yaml').write_text(text)
    after, [remark] = read(tmp_path)
    assert len(after) == 300
    assert remark == said(tmp_path, 'no_metadata', reason=reason)


@pytest.mark.parametrize('name', ['1:30', '2024-01-01', 'yes'])
def test_names_that_yaml_would_turn_into_something_else_stay_names(tmp_path, name):
    write_db3(tmp_path / name, block(300))
    write_metadata(tmp_path, [name], [('/imu', IMU, 300)])
    after, remarks = read(tmp_path)
    assert (len(after), remarks) == (300, [])


def test_of_thousands_of_damaged_files_ten_are_reported_and_the_others_counted(tmp_path):
    write_db3(tmp_path / 'a_0.db3', block(300))
    for number in range(1, 3000):
        (tmp_path / f'a_{number}.db3').write_bytes(b'no database')
    after, remarks = read(tmp_path)
    assert len(after) == 300
    left_out = [remark for remark in remarks if remark.code == 'damaged_recording']
    assert len(left_out) == 11
    assert left_out[-1].values == {'recording': str(tmp_path), 'more': 2989}
