# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""State files whose arrays were changed and whose checksum is right: gone on with or refused."""

import json

from imu_allan.characterization import Characterization
from imu_allan.sensor.noise_model import parse_model
from imu_allan.sensor.simulated_imu import simulated_blocks
from imu_allan.timeline import TimelineOptions
from mutations import each, EXTREMES, mutated_bytes, mutated_text, NUMBERS, rounds
import numpy as np
import pytest

checkpoint = pytest.importorskip('imu_allan.node.checkpoint')
resuming = pytest.importorskip('imu_allan.node.run')

MODEL = parse_model('gyro: {noise_density: 0.3 deg/sqrt(h)}\n'
                    'accel: {noise_density: 150 ug/sqrt(Hz)}')
SETUP = resuming.Setup('/imu', TimelineOptions())


def blocks(count, start_ns):
    return list(simulated_blocks(MODEL, 100.0, count, start_ns=start_ns))


def saved_state():
    run = resuming.Run(resuming.Lane(Characterization(
        kind='topic', path=None, topic='/imu', options=SETUP.options)))
    for start in (10**18 - 100 * 10**9, 10**18):
        run.lanes[0].power_on()
        for block in blocks(4000, start):
            run.lanes[0].update([block])
    return resuming.pack(run, SETUP)


STATE = saved_state()
CONTENT = checkpoint.encode_state(STATE)
MORE = blocks(300, 10**18 + 60 * 10**9)


def damaged(choice):
    """Return the state with one to three arrays changed."""
    state = dict(STATE)
    for _ in range(choice.choice([1, 1, 2, 3])):
        key = choice.choice(sorted(state))
        array = state[key]
        kind = choice.randrange(7)
        if array.dtype.kind == 'U':
            state[key] = np.array(mutated_text(str(array).replace(', ', ',\n'), choice,
                                               ['null', '[]', '{}', 'true', 'NaN']))
        elif kind <= 2 and array.size:
            state[key] = array.copy()
            with np.errstate(all='ignore'):
                number = np.float64(choice.choice([*EXTREMES, *NUMBERS, np.nan, np.inf, -1]))
                state[key].flat[choice.randrange(array.size)] = number.astype(array.dtype)
        elif kind == 3:
            state[key] = array[..., :-1] if array.ndim else array.reshape(1)
        elif kind == 4:
            with np.errstate(all='ignore'):
                state[key] = array.astype(
                    choice.choice(['f4', 'i8', 'u1', 'U5', 'c16', 'bool']))
        elif kind == 5:
            state[key] = np.concatenate([np.atleast_1d(array)] * 2)
        else:
            del state[key]
    return state


def resumed(content):
    """Go on with a state as the node does; False if it is refused."""
    try:
        run = resuming.unpack(checkpoint.decode_state(content), SETUP)
        run.lanes[0].known.mismatch(MORE, by_level=True)
    except checkpoint.UnusableState as error:
        assert error.reason in ('damaged', 'foreign', 'newer', 'topic', 'settings')
        return False
    for block in MORE:
        run.lanes[0].update([block])
    run.snapshot().result().to_json()
    checkpoint.encode_state(resuming.pack(run, SETUP))
    return True


@rounds(35)
def test_damaged_states_are_gone_on_with_or_refused(count, seed):
    def judge(choice):
        resumed(checkpoint.encode_state(damaged(choice)) if choice.random() < .8
                else mutated_bytes(CONTENT, choice))

    assert resumed(CONTENT)
    each(count, seed, judge)


# Found by mutation: NaN as an integer is an absurd stamp, fewer differences than none were too
# many, a mean of numbers beyond any sample is infinite; what a forger writes ended the node.
@pytest.mark.parametrize(('key', 'value'), [
    ('timeline/pending/blocks/0/receive_ns', np.nan),
    ('memory/groups/0/estimator/pyramid/counts', np.int64(-2**63)),
    ('memory/groups/0/estimator/pyramid/sums', 1e308),
    ('timeline/content', {'changed': [1, 2, 3]}), ('timeline/counts', {'gravity': [0.0]}),
    ('timeline/options', {'clock': 'a[]uto'})])
def test_numbers_that_no_record_has_and_what_only_a_forger_writes_are_refused(key, value):
    array = STATE[f'lane0/{key}']
    if isinstance(value, dict):
        document = json.loads(str(array))
        assert value.keys() <= document.keys()
        changed = np.array(json.dumps(document | value))
    else:
        changed = np.full(array.shape, value)
    assert not resumed(checkpoint.encode_state(STATE | {f'lane0/{key}': changed}))
