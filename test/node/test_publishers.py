# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Publishers told apart by the numbers of their messages."""

from collections.abc import Iterable

from imu_allan.node.publishers import MIXED, Publishers
import numpy as np

STEP_NS = 5_000_000


def told(publishers: Publishers, messages: Iterable[tuple[int, float]]) -> tuple[list[int], int]:
    """Give who sent messages of these numbers, received at these seconds, and what is lost."""
    numbers, seconds = zip(*messages, strict=True)
    keys, lost = publishers.of(np.array(numbers), np.rint(np.array(seconds) * 1e9).astype(int))
    return keys.tolist(), lost


def stream(first: int, count: int, start_s: float) -> list[tuple[int, float]]:
    return [(first + i, start_s + i * 0.005) for i in range(count)]


def test_losses_are_numbers_that_one_publisher_has_left_out() -> None:
    keys, lost = told(Publishers(), [*stream(1, 100, 0.0), *stream(111, 100, 0.55)])
    assert (set(keys), lost) == ({1}, 10)


def test_whoever_sends_in_bursts_loses_more_than_its_rate_and_stays_the_same_publisher() -> None:
    offers = {b'a'}
    publishers = Publishers(lambda: set(offers))
    assert told(publishers, stream(1, 1000, 0.0)) == ([1] * 1000, 0)
    assert told(publishers, stream(3001, 10, 5.01)) == ([1] * 10, 2000)
    # Where another one has come meanwhile, the numbers may be those of that one.
    offers |= {b'b'}
    assert told(publishers, stream(9001, 10, 6.0)) == ([2] * 10, 0)


def test_two_publishers_in_turn_are_two_that_have_lost_nothing() -> None:
    publishers = Publishers()
    assert told(publishers, stream(1, 4000, 0.0)) == ([1] * 4000, 0)
    both = sorted([*stream(4001, 1000, 20.0), *stream(1, 1000, 20.001)], key=lambda m: m[1])
    keys, lost = told(publishers, both)
    assert (keys, lost) == ([1, 2] * 1000, 0)
    assert publishers.delivering(round(25e9)) == 2
    assert told(publishers, stream(5001, 2000, 25.0)) == ([1] * 2000, 0)
    assert publishers.delivering(round(35e9)) == 1


def test_a_driver_that_starts_anew_is_another_publisher_and_not_two() -> None:
    publishers = Publishers()
    told(publishers, stream(1, 4000, 0.0))
    for start_s, first, key in ((20.5, 1, 2), (41.0, 300, 3)):
        # The first messages may come before it is discovered.
        assert told(publishers, stream(first, 4000, start_s)) == ([key] * 4000, 0)
        assert publishers.delivering(round((start_s + 20) * 1e9)) == 1


def test_a_pause_of_the_node_is_a_loss_and_no_other_publisher() -> None:
    publishers = Publishers()
    told(publishers, stream(1, 1000, 0.0))
    assert told(publishers, stream(2001, 1000, 10.0)) == ([1] * 1000, 1000)


def test_two_that_started_together_are_mixed_until_one_is_left() -> None:
    publishers = Publishers()
    both = sorted([*stream(1, 1000, 0.0), *stream(1, 1000, 0.001)], key=lambda m: m[1])
    keys, lost = told(publishers, both)
    assert (set(keys[4:]), lost) == ({MIXED}, 0)
    bundles = [message for first in range(1, 1000, 20)
               for _ in range(2) for message in stream(first, 20, first * 0.005)]
    keys, lost = told(Publishers(), bundles)
    assert (set(keys[40:]), lost) == ({MIXED}, 0)
    assert publishers.delivering(round(5e9)) == 2
    keys, lost = told(publishers, stream(1001, 2000, 5.0))
    assert keys[0] == MIXED
    assert keys[-1] > 0
    assert lost == 0


def test_without_numbers_another_set_of_offers_is_another_publisher() -> None:
    offers: set[bytes] = set()
    publishers, times = Publishers(lambda: set(offers)), np.arange(3)
    first, lost = publishers.of(None, times)
    for there, key in (({b'a'}, 1), ({b'a', b'b'}, 1), ({b'b'}, 2), ({b'c'}, 3), (set(), 3)):
        offers.clear()
        offers |= there
        keys, lost = publishers.of(None, times)
        assert (set(keys.tolist()), lost) == ({key}, 0)
    assert set(first.tolist()) == {1}


def test_without_numbers_who_comes_after_a_silence_is_the_newcomer() -> None:
    # The identity of a driver that was killed stays for a while.
    offers = {b'a'}
    publishers, second = Publishers(lambda: set(offers)), 10**9 * np.arange(2)
    assert publishers.of(None, second)[0].tolist() == [1, 1]
    offers |= {b'b'}
    assert publishers.of(None, second + 2 * 10**9)[0].tolist() == [1, 1]
    offers |= {b'c'}
    assert publishers.of(None, second + 6 * 10**9)[0].tolist() == [2, 2]
    # What it has lost is no other publisher.
    assert publishers.of(None, second + 10 * 10**9)[0].tolist() == [2, 2]


def test_a_driver_that_passes_the_last_number_of_the_one_before_stays_the_same() -> None:
    publishers = Publishers()
    told(publishers, stream(1, 100, 0.0))
    # In parts, one of which ends where the first driver has ended.
    for part in range(8):
        keys, lost = told(publishers, stream(1 + 50 * part, 50, 3.0 + 0.25 * part))
        assert (set(keys), lost) == ({2}, 0)
