# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Arguments and files at the ends of what numbers can be; packages that are not there."""

import json
import re
import subprocess
import sys

from imu_allan.block import ImuBlock
from imu_allan.cdr import encode_imu_rows
from imu_allan.cli.main import main
from imu_allan.recordings.time_window import between
import numpy as np
import pytest
from whole_lines import refused


@pytest.mark.parametrize(('start_s', 'duration_s', 'left'), [
    (1e300, None, 0), (0.0, 1e300, 3), (0.0, 1e10, 3), (5e9, 1e10, 0)])
def test_in_python_a_part_beyond_all_stamps_is_empty_or_all(start_s, duration_s, left):
    stamps = np.array([10**18, 10**18 + 1, 2**62])
    block = ImuBlock(stamps, stamps, np.zeros((3, 6)), np.zeros((3, 2), np.bool_), 'imu')
    assert sum(len(part) for part in between([block], start_s, duration_s)) == left


@pytest.mark.parametrize(('key', 'reason'), [
    ('samples', 'expected int, found float'), ('sample_rate_hz', 'inf is not a finite number')])
@pytest.mark.parametrize('digits', [400, 5000])
@pytest.mark.parametrize('verb', ['report', 'check', 'export'])
def test_a_number_of_many_digits_in_a_result_is_one_line(
        result_file, tmp_path, fails_with, key, reason, digits, verb):
    text, found = re.subn(
        rf'("{key}": )[\d.]+', rf'\g<1>{"9" * digits}', result_file.read_text(), count=1)
    assert found == 1
    damaged, spec = tmp_path / 'damaged.json', tmp_path / 'spec.yaml'
    damaged.write_text(text)
    spec.write_text('gyro: {noise_density: 1 deg/s/sqrt(Hz)}\n')
    more = {'report': ['--output', tmp_path / 'out'], 'check': ['--spec', spec],
            'export': ['--for', 'kalibr']}[verb]
    fails_with(f'{damaged}.timeline.{key}: {reason}', verb, damaged, *more)


def test_the_smallest_limit_there_is_gives_valid_json(result_file, tmp_path):
    spec = tmp_path / 'spec.yaml'
    spec.write_text('gyro: {noise_density: 5e-324 rad/s/sqrt(Hz)}\n')
    assert main(['check', str(result_file), '--spec', str(spec),
                 '--json', str(tmp_path / 'c.json')]) == 3

    def refuse(name):
        raise AssertionError(name)
    json.loads((tmp_path / 'c.json').read_text(), parse_constant=refuse)


@pytest.mark.parametrize('stamp', [2**31 * 10**9, -(2**31 + 1) * 10**9])
def test_a_stamp_that_no_message_can_hold_is_not_written(stamp):
    block = ImuBlock(np.array([stamp]), np.array([1]), np.zeros((1, 6)),
                     np.zeros((1, 2), np.bool_), 'imu')
    with refused('header stamps before 1901 or after 2038 cannot be written: '
                 'builtin_interfaces/Time has 32 bits for the seconds'):
        encode_imu_rows(block)


def test_more_samples_than_any_disk_holds_are_not_begun(tmp_path, fails_with):
    fails_with('--duration 3.1536e+09 at --rate 1e+06: more than 100,000,000,000 samples; '
               'simulate for less or at a lower rate', 'simulate', 'consumer_mems', '--rate',
               '1000kHz', '--duration', '36500d', '--output', tmp_path / 'out')
    assert not (tmp_path / 'out').exists()


@pytest.mark.parametrize(('package', 'verb'), [
    ('lz4', 'analyze'), ('mcap', 'analyze'), ('zstandard', 'info')])
def test_a_package_that_rosdep_does_not_install_is_one_line(recording, package, verb):
    done = subprocess.run(
        [sys.executable, '-c', f'import sys; sys.modules[{package!r}] = None\n'
         f'from imu_allan.cli.main import main\nsys.exit(main([{verb!r}, {str(recording)!r}]))'],
        capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (
        1, f'imu_allan: needs the Python package {package}, which is not installed; rosdep does '
        f'not know it: pip install {package}\n')
