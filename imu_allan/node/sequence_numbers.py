# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Assignment of messages to their publishers.

rclpy does not report who published a message, only its sequence number. The numbers of one
publisher increase one by one; those of another publisher lie elsewhere.
"""

from collections.abc import Callable
from dataclasses import dataclass

from imu_allan.arrays import Ints
import numpy as np

MIXED = -1
"""Key of messages of two publishers whose numbers are too close to be distinguished."""
_TAKEOVER_NS = 1_000_000_000
"""Two publishers alternate faster than this, in bundles; a driver takes longer to restart."""


@dataclass
class _Publisher:
    """One publisher or, if the numbers fell recently, several with interleaved numbers."""

    key: int
    number: int  # of its last message
    began_ns: int  # a receive time, as are the others below
    last_ns: int
    fell_ns: int | None = None


class Publishers:
    """The publishers of a topic that have sent messages; `offers` returns the GIDs present."""

    def __init__(self, offers: Callable[[], set[str]] = set) -> None:
        self._offers = offers
        self._known: list[_Publisher] = []
        # Number of publishers so far, which gives the key of the next one.
        self._begun = 0
        # GIDs present at the last check and, without numbers, when the publisher began.
        self._gids: set[str] = set()
        self._own: set[str] = set()

    def delivering(self, now_ns: int) -> int:
        """Count the publishers that send now; a driver that has restarted counts once."""
        # A publisher that has sent nothing for five seconds counts as gone.
        lately = [one for one in self._known if abs(now_ns - one.last_ns) < 5_000_000_000]
        newest = max((one.began_ns for one in lately), default=0)
        return sum(2 if one.fell_ns is not None else 1 for one in lately
                   if one.last_ns >= newest)

    def of(self, numbers: Ints | None, receive_ns: Ints) -> tuple[Ints, int]:
        """Return the publisher of each message, `MIXED` if unknown, and how many were lost."""
        self._follow_clock(int(receive_ns[0]))
        if numbers is None:
            only = self._unnumbered(int(receive_ns[0]))
            only.last_ns = int(receive_ns[-1])
            return np.full(len(receive_ns), only.key), 0
        # The usual case. Only the latest: an earlier one may have ended with the same number.
        one = max(self._known, key=lambda one: one.last_ns, default=None)
        if (one is not None and one.fell_ns is None and numbers[0] == one.number + 1
                and (numbers[1:] - numbers[:-1] == 1).all()):
            one.number, one.last_ns = int(numbers[-1]), int(receive_ns[-1])
            return np.full(len(numbers), one.key), 0
        keys, lost = [], 0
        for number, now_ns in zip(numbers.tolist(), receive_ns.tolist(), strict=True):
            one, missed = self._sender(number, now_ns)
            keys.append(MIXED if one.fell_ns is not None else one.key)
            lost += missed
        return np.array(keys, np.int64), lost

    def _follow_clock(self, now_ns: int) -> None:
        """If the clock of the computer was set back, move earlier times to before that."""
        ahead_ns = max((one.last_ns for one in self._known), default=now_ns) - now_ns
        if ahead_ns > _TAKEOVER_NS:
            for one in self._known:
                one.began_ns -= ahead_ns + _TAKEOVER_NS
                one.last_ns -= ahead_ns + _TAKEOVER_NS

    def _sender(self, number: int, now_ns: int) -> tuple[_Publisher, int]:
        """Find who sent a message, and how many of its earlier messages were lost."""
        # Numbers this close may belong to another publisher that started in the same second.
        near_by = 64
        for one in self._known:
            if one.fell_ns is not None and abs(number - one.number) <= near_by:
                if number <= one.number:
                    one.fell_ns = now_ns
                one.number, one.last_ns = max(number, one.number), now_ns
                if now_ns - one.fell_ns > 5_000_000_000:
                    # The numbers no longer fall: one publisher is left, which is treated as new.
                    self._known.remove(one)
                    one = self._begin(number, now_ns)
                return one, 0
        newest = max((one.began_ns for one in self._known), default=0)
        before = sorted((one for one in self._known if 0 <= one.number < number),
                        key=lambda one: number - one.number)
        near = [one for one in before if number - one.number <= near_by]
        # One that was silent since another began is considered only if no other fits.
        fitting = [one for one in near or before if one.last_ns >= newest
                   or now_ns - one.last_ns < _TAKEOVER_NS] or near or before
        # Any number of messages may be lost, unless a new publisher explains the difference.
        if not fitting or (not near and self._newcomers()):
            return self._begin(number, now_ns), 0
        found = fitting[0]
        if len(fitting) > 1 and number - fitting[1].number <= near_by:
            found.fell_ns = now_ns
            self._known.remove(fitting[1])
        missed = number - found.number - 1
        found.number, found.last_ns = number, now_ns
        return found, 0 if found.fell_ns is not None else missed

    def _unnumbered(self, now_ns: int) -> _Publisher:
        """Find who sent messages without numbers, from the publishers that are present."""
        there, known = self._offers(), [one for one in self._known if one.number < 0]
        gone = bool(there and self._own and not there & self._own)
        # The GID of a driver that was killed remains for a while.
        silent = bool(known) and now_ns - known[-1].last_ns > _TAKEOVER_NS
        if not known or gone or (silent and not there <= self._gids and self._gids):
            self._known = [one for one in self._known if one.number >= 0]
            self._own, known = there - self._gids or there, [self._begin(-1, now_ns)]
        self._own, self._gids = self._own or there, there or self._gids
        return known[-1]

    def _newcomers(self) -> bool:
        """Return whether a publisher is present that was not there at the last check."""
        gids, before = self._offers(), self._gids
        self._gids = gids or before
        return not gids <= before

    def _begin(self, number: int, now_ns: int) -> _Publisher:
        self._newcomers()
        self._begun += 1
        self._known.append(_Publisher(self._begun, number, now_ns, now_ns))
        # Every restart of a driver adds a publisher.
        if len(self._known) > 16:
            self._known.remove(min(self._known, key=lambda one: one.last_ns))
        return self._known[-1]
