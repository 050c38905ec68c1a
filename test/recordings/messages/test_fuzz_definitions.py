# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Mutated definitions, messages and field paths: blocks, or one line; never another exception."""

from random import Random

from imu_allan.cdr import MessageBatch
from imu_allan.errors import ImuAllanError
from imu_allan.recordings import RecordingOptions
from imu_allan.recordings.messages.definitions import Definition, parse
from imu_allan.recordings.messages.imu_fields import vector_of
from imu_allan.recordings.messages.imus_in import imu_messages
from mutations import mutated_bytes
import numpy as np
from other_types import full_definition, imu, stamped, store_with
import pytest
from repeated import slow

KIND = 'my_driver/msg/Fuzzed'
TEXT = 'std_msgs/Header header\nstring[] names\nsensor_msgs/Imu[2] imus\nfloat32[<=4] rest\n'
STORE = store_with({KIND: TEXT})
DEFINITION = full_definition(STORE, KIND)
MESSAGE = bytes(STORE.serialize_cdr(STORE.types[KIND](
    stamped(STORE, 1), ['a', 'bc'], [imu(STORE, 1), imu(STORE, 2)],
    np.ones(3, np.float32)), KIND))
TYPES = parse(KIND, Definition(DEFINITION))
CHOICE = RecordingOptions(gyro='imus[0].angular_velocity', accel='imus[1].linear_acceleration')
PATHS = ('imus[0].angular_velocity', 'rest[0:3]', 'header.stamp.sec,rest[0],rest[1]', 'names[0]')


def outcome(make) -> str:
    """Run; returns nothing, or the one line that it raised."""
    try:
        make()
    except ImuAllanError as error:
        assert '\n' not in str(error)
        assert str(error).isprintable()
        return str(error)
    return ''


def decode(definition: str, message: bytes) -> None:
    decoder = imu_messages(KIND, definition, options=CHOICE).decoder()
    for block in decoder([MessageBatch(np.frombuffer(message, np.uint8).reshape(1, -1),
                                       np.zeros(1, np.int64))], lambda *_: None):
        assert block.samples.shape == (1, 6)


@pytest.mark.parametrize(('seed', 'rounds', 'fewest'), [(1, 60, 10), slow(2, 3400, 100)])
def test_mutations_are_decoded_or_refused_in_one_line(seed, rounds, fewest):
    random = Random(seed)
    good = bad = 0
    for _ in range(rounds):
        definition = mutated_bytes(DEFINITION.encode(), random).decode('utf-8', 'replace')
        message = mutated_bytes(MESSAGE, random)
        path = mutated_bytes(random.choice(PATHS).encode(), random).decode('utf-8', 'replace')
        for make in (lambda text=definition: decode(text, MESSAGE),
                     lambda data=message: decode(DEFINITION, data) if data else None,
                     lambda text=path: vector_of(TYPES, KIND, text, '--gyro')):
            reason = outcome(make)
            good, bad = good + (not reason), bad + bool(reason)
    assert min(good, bad) > fewest
