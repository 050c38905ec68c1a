# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""metadata.yaml of unknown origin: what rosbag2 writes is read, anything that grows is not."""

from pathlib import Path

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
    'base of 60 by a tag': 'x: !!int 1' + ':59' * 300_000 + '\n',
    'hexadecimal': 'x: 0x' + 'f' * 6000 + '\n',
    'digits': 'x: ' + '9' * 6000 + '\n',
    'keys': ''.join(f'k{number}: 1\n' for number in range(60_000)),
    'nesting': '[' * 100_000,
    'keys in keys': '? ' * 50_000,
    'size': 'x: "' + 'y' * 2_000_000 + '"\n',
    'one key many times': 'x: 1\n' * 16_000,
    'a list as key': '? [1, 2]\n: 3\n',
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


@pytest.mark.parametrize(('text', 'reason'), [
    ('k: [' + '1,' * 30_000 + ']', 'it has more than 30000 entries'),
    ('x: ' + 'y' * (1 << 20), 'it is larger than 1048576 bytes')])
def test_metadata_of_another_size_than_rosbag2_writes_is_reported(tmp_path, text, reason):
    write_db3(tmp_path / 'a_0.db3', block(300))
    (tmp_path / 'metadata.yaml').write_text(text)
    after, [remark] = read(tmp_path)
    assert len(after) == 300
    assert remark == said(tmp_path, 'no_metadata', reason=reason)


@pytest.mark.parametrize('name', ['1:30', '0x10', '2024-01-01', 'yes', '010'])
def test_names_that_yaml_would_turn_into_something_else_stay_names(tmp_path, name):
    write_db3(tmp_path / name, block(300))
    write_metadata(tmp_path, [name], [('/imu', IMU, 300)])
    after, remarks = read(tmp_path)
    assert (len(after), remarks) == (300, [])


def bag(folder: Path, *, count: int, times: int = 1) -> Path:
    write_db3(folder / 'a_0.db3', block(300))
    write_metadata(folder, ['a_0.db3'] * times, [('/imu', IMU, count)])
    return folder


def test_a_file_that_is_listed_many_times_is_read_once(tmp_path):
    after, [remark] = read(bag(tmp_path, count=600_000, times=2000))
    assert len(after) == 300
    assert remark == said(tmp_path, 'no_metadata',
                          reason='relative_file_paths names a file twice')


@pytest.mark.parametrize('count', [-1, 1 << 63])
def test_an_impossible_count_is_not_believed(tmp_path, count):
    after, [remark] = read(bag(tmp_path, count=count))
    assert len(after) == 300
    assert remark == said(tmp_path, 'no_metadata', reason=f'message_count is {count}')


def test_of_thousands_of_damaged_files_ten_are_reported_and_the_others_counted(tmp_path):
    write_db3(tmp_path / 'a_0.db3', block(300))
    for number in range(1, 3000):
        (tmp_path / f'a_{number}.db3').write_bytes(b'no database')
    after, remarks = read(tmp_path)
    assert len(after) == 300
    left_out = [remark for remark in remarks if remark.code == 'damaged_recording']
    assert len(left_out) == 11
    assert left_out[-1].values == {'recording': str(tmp_path), 'more': 2989}
