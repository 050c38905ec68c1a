# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

import imu_allan
from imu_allan.cli.main import main
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


def read(path):
    with open_recording(path) as recording:
        return np.concatenate([block.samples for block in read_blocks(recording, '/imu/data_raw')])


def test_the_same_seed_gives_the_same_samples_and_another_others(tmp_path):
    for name, seed in (('a', '7'), ('b', '7'), ('c', '8')):
        assert main(['simulate', str(CONFIG / 'tactical_mems.yaml'), '--duration', '20s',
                     '--seed', seed, '--output', str(tmp_path / name)]) == 0
    np.testing.assert_array_equal(read(tmp_path / 'a'), read(tmp_path / 'b'))
    assert np.all(read(tmp_path / 'a') != read(tmp_path / 'c'))


def test_without_output_the_recording_is_named_after_the_model_and_replaces_nothing(
        tmp_path, monkeypatch, fails_with):
    monkeypatch.chdir(tmp_path)
    for model in (str(CONFIG / 'tactical_mems.yaml'), 'consumer_mems'):
        assert main(['simulate', model, '--duration', '1s']) == 0
        assert (tmp_path / Path(model).stem / 'metadata.yaml').is_file()
    (tmp_path / 'mine').mkdir()
    fails_with('mine: exists already; name another folder with --output',
               'simulate', 'tactical_mems', '--duration', '1s', '--output', 'mine')
    assert list((tmp_path / 'mine').iterdir()) == []


UNITS = "write a number with its unit, such as '1 deg/sqrt(h)' or '1 rad/s/sqrt(Hz)'"


@pytest.mark.parametrize(('text', 'reason'), [
    ('gyro: {noise_density: 5}', f"gyro.noise_density: '5' has no unit; {UNITS}"),
    ('gyro: {noise: 5 deg/s}',
     "gyro: unknown key 'noise'; known are quantization_noise, noise_density, bias_instability, "
     'rate_random_walk, rate_ramp, gauss_markov, mean, zero_bias, band_limit, lines, '
     'temperature_drift, turn_on_bias, x, y, z'),
    ('gyro: {', 'line 1 is not YAML (<words>)'),
])
def test_a_wrong_model_is_one_line_that_names_what_is_wrong(text, reason, tmp_path, fails_with):
    model = tmp_path / 'model.yaml'
    model.write_text(text)
    fails_with(f'{model}: {reason}', 'simulate', model, '--output', tmp_path / 'out')
    assert not (tmp_path / 'out').exists()


def test_more_samples_than_any_disk_holds_are_not_begun(tmp_path, fails_with):
    fails_with('--duration 3.1536e+09 at --rate 1e+06: more than 100,000,000,000 samples; '
               'simulate for less or at a lower rate', 'simulate', 'consumer_mems', '--rate',
               '1000kHz', '--duration', '36500d', '--output', tmp_path / 'out')
    assert not (tmp_path / 'out').exists()
