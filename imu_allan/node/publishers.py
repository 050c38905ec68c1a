# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Who publishes a topic, by the identifiers (GIDs) of the publishers present.

rclpy does not report who published a message. The publisher changes if the one in use is gone, or
if another one is present after a silence: a driver that was killed stays present for a while.
"""

from collections.abc import Callable

_TAKEOVER_NS = 1_000_000_000
"""A driver takes longer to restart."""


class Publishers:
    """The publisher in use, and those present; `offers` returns the GIDs present."""

    def __init__(self, offers: Callable[[], set[str]]) -> None:
        self._offers = offers
        self._key = 0
        self._last_ns = 0
        # GIDs present when the publisher in use began, at its last message, and before it.
        self._own: set[str] = set()
        self._heard: set[str] = set()
        self._former: set[str] = set()

    def count(self) -> int:
        """Count the publishers present, without those that another one has replaced."""
        return len(self._offers() - self._former)

    def sender(self, first_ns: int, last_ns: int) -> int:
        """Return a number of the publisher in use, for messages received at these times."""
        there = self._offers()
        gone = bool(there and self._own and not there & self._own)
        silent = first_ns - self._last_ns > _TAKEOVER_NS
        if not self._key or gone or (silent and self._heard and not there <= self._heard):
            self._key += 1
            self._former = self._heard
            self._own = there - self._heard or there
        self._own, self._heard = self._own or there, there or self._heard
        self._last_ns = last_ns
        return self._key
