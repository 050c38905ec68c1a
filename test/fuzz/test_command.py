# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The command as a process of its own: hostile names, very many gaps."""

from dataclasses import replace
import json

from imu_allan.block import ImuBlock
from imu_allan.errors import printable
from imu_allan.recordings.write import write_recording
from imu_allan.sensor.noise_model import parse_model
from imu_allan.sensor.simulated_imu import simulated_blocks
from mutations import assert_harmless_on_a_terminal
import numpy as np
from processes import run
import pytest
from repeated import slow
import yaml

MODEL = parse_model('gyro: {noise_density: 0.3 deg/sqrt(h)}\n'
                    'accel: {noise_density: 150 ug/sqrt(Hz)}')
HOSTILE = '\x1b[31m\x1b]0;t\x07</script><script>alert(1)</script>\n- [bold]a: {b}"\'$x^2$ {{7*7}}'


def test_names_from_a_recording_steer_neither_terminal_nor_page_nor_file(tmp_path):
    blocks = [replace(item, frame_id=HOSTILE)
              for item in simulated_blocks(MODEL, 100.0, 3000, start_ns=10**18)]
    bag = write_recording(tmp_path / 'bag', blocks, topic='/' + HOSTILE)
    output = tmp_path / 'out'
    for arguments in (['info', bag], ['analyze', bag, '--output', output]):
        status, out, err = run(*arguments, '--no-progress', most_s=60.0)
        assert (status, err) == (0, '')
        assert_harmless_on_a_terminal(out)
        assert '\\x1b[31m' in out
    result = json.loads((output / 'result.json').read_text())
    assert result['source']['frame_id'] == HOSTILE
    assert '<script>alert(1)' not in (output / 'report.html').read_text()
    status, out, _ = run('export', output / 'result.json', '--for', 'kalibr')
    assert status == 0
    assert_harmless_on_a_terminal(out)
    assert yaml.safe_load(out)['rostopic'] == printable('/' + HOSTILE)


def with_gaps(count):
    """Give messages at rest on a grid of 100 Hz, with so many gaps of 0.2 s, eight between two."""
    for first in range(0, 8 * count, 8000):
        numbers = np.arange(first, first + 8000)
        stamps = 10**18 + (numbers + 20 * (numbers // 8)) * 10**7
        samples = np.random.default_rng(first).normal([0, 0, 0, 0, 0, 9.8], 0.01, (8000, 6))
        yield ImuBlock(stamps, stamps, samples, np.zeros((8000, 2), bool), 'imu')


@pytest.mark.parametrize('count', [1000, slow(100_000)])
def test_a_recording_of_many_parts_costs_the_process_time_in_proportion(tmp_path, count):
    path = write_recording(tmp_path / 'gaps', with_gaps(count))
    # A command that does nothing else takes 5 s on a slow computer.
    _, out, error = run('analyze', path, '--no-progress', most_s=5.0 + 0.002 * count)
    assert 'Traceback' not in error
    # Of thousands the first are listed, in the file and on the page.
    assert len(out + error) < 20_000
