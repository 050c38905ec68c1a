# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Text that people edit and messages from anyone on the network: used, refused or counted."""

from functools import partial
from pathlib import Path

from imu_allan.cdr import batches_of
from imu_allan.errors import ImuAllanError
from imu_allan.finding_messages import message_of
from imu_allan.noise.terms import AXES
from imu_allan.recordings.messages.imus_in import IMU_MESSAGES
from imu_allan.sensor.noise_model import load_model
from imu_allan.timeline import TimelineStage
from imu_messages import encode_imu
from mutations import each, mutated_bytes, mutated_text, rounds, run_command
import numpy as np
import pytest

CONFIG = Path(__file__).parents[2] / 'config'
MODELS = [path.read_text() for path in sorted(CONFIG.glob('*.yaml'))
          if 'ros__parameters' not in path.read_text()]
MODEL_WORDS = ['gyro', 'accel', 'x', 'mean', 'gauss_markov', 'sigma', 'noise_density', 'deg/s',
               'ug/sqrt(Hz)', '1e300 rad', '(((((', 's^9', 's^99999999', '1 s**s', '**', '1/0']
CSV_WORDS = ['gyro_x', 'time_s', 'time_ns', 'accel_z', 'gyro_x_deg/s', ';', ',', '"', '#']


def damaged(text, choice, words):
    if choice.random() < .8:
        return mutated_text(text, choice, words).encode(errors='surrogatepass')
    return mutated_bytes(text.encode(), choice)


def judge_model(folder, choice):
    path = folder / 'model.yaml'
    path.write_bytes(damaged(choice.choice(MODELS), choice, MODEL_WORDS))
    simulate = partial(run_command, 'simulate', path, '--duration', '1s', '--rate', 10, '--output')
    try:
        model = load_model(path)
    except ImuAllanError as error:
        assert '\n' not in str(error)
        assert len(str(error)) < 800
        simulate(folder / 'never')
        assert not (folder / 'never').exists()
        return
    assert set(model.axes) <= set(AXES)
    if choice.random() < .1:
        simulate(folder / f'{choice.random()}')


def table(rows, choice):
    header = 'time_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z'
    values = np.random.default_rng(choice.randrange(9)).normal(size=(rows, 6)) * 1e-3
    return '\n'.join([header, *(f'{k / 100:.2f},' + ','.join(f'{v:.6g}' for v in row)
                                for k, row in enumerate(values.tolist()))])


def judge_csv(folder, choice):
    path = folder / 'a.csv'
    path.write_bytes(damaged(table(200, choice), choice, CSV_WORDS))
    run_command('info', path, '--no-progress')
    if choice.random() < .1:
        run_command('analyze', path, '--no-progress')


@pytest.mark.parametrize('judge', [judge_model, judge_csv])
@rounds(60)
def test_damaged_text_is_used_or_refused(tmp_path, judge, count, seed):
    each(count, seed, lambda choice: judge(tmp_path, choice))


def messages(choice):
    frame = choice.choice(['imu_link', '', 'a' * 300, 'ü\n\x1b[0m'])
    found = []
    for number in range(20):
        sample = np.array([.1, .2, .3, 0., 0., 9.8]) + number * 1e-3
        message = encode_imu(10**18 + number * 10**7, sample, frame)
        found.append(mutated_bytes(message, choice) if choice.random() < .3 else message)
    return found


def judge_messages(choice):
    batch = messages(choice)
    single, reasons, decode = [], [], IMU_MESSAGES.decoder()
    for message in batch:
        single += decode(batches_of([message], np.zeros(1, np.int64)),
                         lambda _, error: reasons.append(str(error)))
    assert all(map(str.isprintable, reasons))
    receive_ns = np.arange(len(batch), dtype=np.int64) * 10**7 + 10**18
    refused = []
    found = decode(batches_of(batch, receive_ns), lambda count, _: refused.append(count))
    assert sum(refused) + len(single) == len(batch)
    stamps = [stamp for block in found for stamp in block.header_ns.tolist()]
    assert stamps == [stamp for block in single for stamp in block.header_ns.tolist()]
    # A stream that starts with damaged stamps may be refused, in one line.
    stage = TimelineStage()
    try:
        for block in found:
            stage.push(block)
        stage.flush()
    except ImuAllanError as error:
        assert str(error).isprintable()
    assert all(message_of(remark).isprintable() for remark in stage.summary().remarks)


@rounds(300)
def test_damaged_messages_are_counted_and_the_others_decoded(count, seed):
    each(count, seed, judge_messages)
