# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Publishers distinguished by the numbers of their messages."""

from imu_allan.node.publishers import MIXED, Publishers
import numpy as np
import pytest

SECOND = 10**9
Messages = list[tuple[int, float]]


def stream(first: int, count: int, start_s: float) -> Messages:
    """Give numbers of messages of one publisher, and when they are received, at 200 Hz."""
    return [(first + i, start_s + i * 0.005) for i in range(count)]


def in_turn(*streams: Messages) -> Messages:
    return sorted((message for one in streams for message in one), key=lambda message: message[1])


@pytest.mark.parametrize('steps', [
    # Of each step: what comes, whose it is, how many are lost, and who delivers a moment later.
    pytest.param([([*stream(1, 100, 0.0), *stream(111, 100, 0.55)], [1], 10, 1)], id='losses'),
    pytest.param([(stream(1, 1000, 0.0), [1], 0, 1), (stream(2001, 1000, 10.0), [1], 1000, 1)],
                 id='a pause of the node'),
    pytest.param([(stream(1, 4000, 0.0), [1], 0, 1),
                  (in_turn(stream(4001, 1000, 20.0), stream(1, 1000, 20.001)), [1, 2], 0, 2),
                  (stream(5001, 2000, 25.0), [1], 0, 1)], id='two in turn'),
    # The first messages may come before it is discovered.
    pytest.param([(stream(1, 4000, 0.0), [1], 0, 1), (stream(1, 4000, 20.5), [2], 0, 1),
                  (stream(300, 4000, 41.0), [3], 0, 1)], id='a driver that starts anew'),
    # In parts, one of which ends where the first driver has ended.
    pytest.param([(stream(1, 100, 0.0), [1], 0, 1), *(
        (stream(1 + 50 * part, 50, 3.0 + 0.25 * part), [2], 0, 1) for part in range(8))],
        id='a driver that passes the last number of the one before')])
def test_numbers_tell_whose_messages_are_and_how_many_are_lost(
        steps: list[tuple[Messages, list[int], int, int]]) -> None:
    publishers = Publishers()
    for messages, senders, lost, delivering in steps:
        numbers, seconds = zip(*messages, strict=True)
        keys, missed = publishers.of(np.array(numbers),
                                     np.rint(np.array(seconds) * SECOND).astype(int))
        assert (list(dict.fromkeys(keys.tolist())), missed) == (senders, lost)
        assert len(set(np.bincount(keys)[senders])) == 1
        assert publishers.delivering(round((seconds[-1] + 4) * SECOND)) == delivering


def test_two_that_started_together_are_mixed_until_one_is_left() -> None:
    publishers, bundle = Publishers(), 20
    both = np.repeat(np.arange(1, 1001).reshape(-1, 1, bundle), 2, axis=1).ravel()
    keys, lost = publishers.of(both, (5_000_000 * both).astype(int))
    assert (set(keys[2 * bundle:].tolist()), lost) == ({MIXED}, 0)
    assert publishers.delivering(5 * SECOND) == 2
    left = np.arange(1001, 3001)
    keys, lost = publishers.of(left, 5_000_000 * left)
    assert (keys[0], keys[-1] > 0, lost) == (MIXED, True, 0)


def test_without_numbers_another_set_of_offers_is_another_publisher() -> None:
    offers: set[bytes] = set()
    publishers = Publishers(lambda: set(offers))

    def sender(seconds: float, *there: bytes) -> int:
        offers.clear()
        offers.update(there)
        keys, lost = publishers.of(None, np.full(3, round(seconds * SECOND)))
        assert (len(set(keys)), lost) == (1, 0)
        return int(keys[0])

    assert [sender(0, *there) for there in ([], [b'a'], [b'a', b'b'], [b'b'], [b'c'], [])] == [
        1, 1, 1, 2, 3, 3]
    # The identity of a driver that was killed stays for a while: after a silence it is the
    # newcomer who sends. What that one loses is no other publisher.
    killed, both, three = [b'c'], [b'c', b'd'], [b'c', b'd', b'e']
    assert [sender(seconds, *there) for seconds, there in (
        (0.5, killed), (1.5, both), (6.0, three), (10.0, three))] == [3, 3, 4, 4]
