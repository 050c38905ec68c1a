# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

from bags import joined
import imu_allan
from imu_allan.recordings import open_recording, read_blocks
import numpy as np
import pytest
from repeated import slow

CONFIG = Path(__file__).parents[2] / 'config'


@pytest.mark.parametrize('storage', ['mcap', slow('sqlite3')])
def test_analysis_of_a_simulated_recording_finds_the_model(storage, tmp_path, output_of):
    output = tmp_path / 'simulated'
    assert output_of('simulate', CONFIG / 'consumer_mems.yaml', '--storage', storage, '--rate',
                     '200', '--duration', '10min', '--output', output) == f'{output}\n'
    assert any(output.glob(f'*.{"mcap" if storage == "mcap" else "db3"}'))
    result = imu_allan.analyze(output)
    assert result.timeline.samples == 120_000
    assert result.timeline.sample_rate_hz == pytest.approx(200, rel=1e-9)
    for axis, density in (('gyro_x', np.deg2rad(0.008)), ('accel_y', 150e-6 * 9.80665)):
        low, high = result.axes[axis].coefficients['noise_density'].ci95
        assert low * 0.99 < density < high * 1.01


def test_the_same_seed_gives_the_same_samples_and_another_others(tmp_path, output_of):
    read = []
    for name, seed in (('a', '7'), ('b', '7'), ('c', '8')):
        output_of('simulate', 'tactical_mems', '--duration', '20s', '--seed', seed, '--output',
                  tmp_path / name)
        with open_recording(tmp_path / name) as recording:
            read.append(joined(read_blocks(recording, '/imu/data_raw')).samples)
    np.testing.assert_array_equal(read[0], read[1])
    assert np.all(read[0] != read[2])


def test_without_output_the_recording_is_named_after_the_model_and_replaces_nothing(
        tmp_path, monkeypatch, output_of, fails_with):
    monkeypatch.chdir(tmp_path)
    for model in (CONFIG / 'tactical_mems.yaml', 'consumer_mems'):
        output_of('simulate', model, '--duration', '1s')
        assert (tmp_path / Path(model).stem / 'metadata.yaml').is_file()
    (tmp_path / 'mine').mkdir()
    fails_with('mine: exists already; name another folder with --output',
               'simulate', 'tactical_mems', '--duration', '1s', '--output', 'mine')
    assert list((tmp_path / 'mine').iterdir()) == []


@pytest.mark.parametrize(('model', 'options', 'line'), [
    ('{path}', '', "{path}: gyro.noise_density: '5' has no unit; write a number with its unit, "
     "such as '1 deg/sqrt(h)' or '1 rad/s/sqrt(Hz)'"),
    ('consumer_mems', '--rate 1000kHz --duration 36500d', '--duration 3.1536e+09 at --rate 1e+06: '
     'more than 100,000,000,000 samples; simulate for less or at a lower rate')])
def test_what_cannot_be_simulated_is_one_line(model, options, line, tmp_path, fails_with):
    path = tmp_path / 'model.yaml'
    path.write_text('gyro: {noise_density: 5}')
    fails_with(line.format(path=path), 'simulate', model.format(path=path), *options.split(),
               '--output', tmp_path / 'out')
    assert not (tmp_path / 'out').exists()
