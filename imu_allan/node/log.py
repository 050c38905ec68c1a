# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The log of a node on /rosout: one line for each event, repeated ever more rarely."""

from collections.abc import Callable
import math
import time
import traceback

from imu_allan.errors import printable
from imu_allan.node.rclpy_inside import Logger

FIRST_INTERVAL_S = 10.0
"""Time between the first two lines of a kind; it doubles up to `LONGEST_INTERVAL_S`."""
LONGEST_INTERVAL_S = 600.0
"""Longest time between lines of a kind; for tracebacks, which are long, also the shortest."""


class Log:
    """
    A logger that makes every text printable and limits how often lines of one kind appear.

    Lines of a kind repeat at growing intervals, whatever figures they contain, so that a log of
    days stays readable. Lines are of one kind if the reader would react to them in the same way.
    `logger` returns where a line goes at its time.
    """

    def __init__(self, logger: Callable[[], Logger]) -> None:
        self._logger = logger
        self._said: dict[str, tuple[float, float]] = {}

    def info(self, text: str, kind: str = '') -> None:
        """Log a normal event; it is rate-limited only with a `kind`, if users can trigger it."""
        if not kind or self._is_due(kind, FIRST_INTERVAL_S):
            self._logger().info(printable(text))

    def warning(self, text: str, kind: str, every_s: float = FIRST_INTERVAL_S) -> bool:
        """Log what the user should look at; return whether it was logged (see the class)."""
        if due := self._is_due(kind, every_s):
            self._logger().warning(printable(text))
        return due

    def error(self, text: str, kind: str, every_s: float = FIRST_INTERVAL_S) -> None:
        """Log what does not work."""
        if self._is_due(kind, every_s):
            self._logger().error(printable(text))

    def bug(self, error: BaseException, consequence: str) -> None:
        """Log the traceback of an unforeseen error, and what happens next."""
        if self._is_due(f'bug {type(error).__name__} {consequence}', LONGEST_INTERVAL_S):
            trace = ''.join(traceback.format_exception(error))
            self._logger().error(f'{trace}internal error: {consequence}; please report it')

    def _is_due(self, kind: str, every_s: float) -> bool:
        now = time.monotonic()
        said, pause_s = self._said.get(kind, (-math.inf, every_s))
        if now - said < pause_s:
            return False
        # After a long enough silence the intervals start over.
        again = now - said < 2 * max(pause_s, LONGEST_INTERVAL_S)
        self._said[kind] = now, min(2 * pause_s, LONGEST_INTERVAL_S) if again else every_s
        return True
