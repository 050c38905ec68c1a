# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Text that people edit: models, datasheets, CSV and metadata.yaml, through the command."""

from pathlib import Path
from random import Random

from imu_allan.errors import ImuAllanError
from imu_allan.noise.terms import AXES
from imu_allan.sensor.noise_model import load_model
from mutations import each, mutated_bytes, mutated_text, rounds, run_command
import numpy as np
import pytest

CONFIG = Path(__file__).parents[2] / 'config'
MODELS = [path.read_text() for path in sorted(CONFIG.glob('*.yaml'))
          if 'ros__parameters' not in path.read_text()]
MODEL_WORDS = ['gyro', 'accel', 'x', 'mean', 'gauss_markov', 'sigma', 'noise_density', 'deg/s',
               'ug/sqrt(Hz)', '1e300 rad', '(((((', 's^9', 's^99999999', '1 s**s', '**', '1/0']
CSV_WORDS = ['gyro_x', 'time_s', 'time_ns', 'accel_z', 'gyro_x_deg/s', ';', ',', '"', '#']


def damaged(text: str, choice: Random, words: list[str]) -> bytes:
    if choice.random() < .8:
        return mutated_text(text, choice, words).encode(errors='surrogatepass')
    return mutated_bytes(text.encode(), choice)


def judge_model(folder: Path, choice: Random) -> None:
    path = folder / 'model.yaml'
    path.write_bytes(damaged(choice.choice(MODELS), choice, MODEL_WORDS))
    try:
        model = load_model(path)
    except ImuAllanError as error:
        assert '\n' not in str(error)
        assert len(str(error)) < 800
        run_command(['simulate', str(path), '--duration', '1s', '--rate', '10', '--output',
                     str(folder / 'never')])
        assert not (folder / 'never').exists()
        return
    assert set(model.axes) <= set(AXES)
    if choice.random() < .1:
        output = folder / f'{choice.random()}'
        run_command(['simulate', str(path), '--duration', '1s', '--rate', '10', '--output',
                     str(output)])


def table(rows: int, choice: Random) -> str:
    header = 'time_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z'
    values = np.random.default_rng(choice.randrange(9)).normal(size=(rows, 6)) * 1e-3
    return '\n'.join([header, *(f'{k / 100:.2f},' + ','.join(f'{v:.6g}' for v in row)
                                for k, row in enumerate(values.tolist()))])


def judge_csv(folder: Path, choice: Random) -> None:
    path = folder / 'a.csv'
    path.write_bytes(damaged(table(200, choice), choice, CSV_WORDS))
    run_command(['info', str(path), '--no-progress'])
    if choice.random() < .1:
        run_command(['analyze', str(path), '--no-progress'])


@pytest.mark.parametrize('judge', [judge_model, judge_csv])
@rounds(60)
def test_damaged_text_is_used_or_refused(tmp_path, judge, count, seed):
    each(count, seed, lambda choice: judge(tmp_path, choice))
