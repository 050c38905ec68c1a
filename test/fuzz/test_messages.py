# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Serialized messages from anyone on the network: decoded or counted as malformed."""

from random import Random

from imu_allan.cdr import blocks_from_messages, encode_imu, MalformedImu
from imu_allan.errors import ImuAllanError
from imu_allan.timeline import TimelineStage
from imu_allan.writers.words import message_of
from mutations import each, mutated_bytes, rounds
import numpy as np


def messages(choice: Random) -> list[bytes]:
    """Return twenty messages, some of them damaged."""
    frame = choice.choice(['imu_link', '', 'a' * 300, 'ü\n\x1b[0m'])
    found = []
    for number in range(20):
        sample = np.array([.1, .2, .3, 0., 0., 9.8]) + number * 1e-3
        message = encode_imu(10**18 + number * 10**7, sample, frame)
        found.append(mutated_bytes(message, choice) if choice.random() < .3 else message)
    return found


def judge_messages(choice: Random) -> None:
    batch = messages(choice)
    single = []
    for message in batch:
        try:
            single += blocks_from_messages([message], np.zeros(1, np.int64))
        except MalformedImu as error:
            assert str(error).isprintable()
    receive_ns = np.arange(len(batch), dtype=np.int64) * 10**7 + 10**18
    refused = []
    found = blocks_from_messages(batch, receive_ns,
                                 on_malformed=lambda count, _: refused.append(count))
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
