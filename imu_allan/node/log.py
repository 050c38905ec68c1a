# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The node's voice on /rosout: one line for each thing, and none of it over and over."""

import math
import time
import traceback

from imu_allan.errors import printable
from rclpy.impl.rcutils_logger import RcutilsLogger

OFTEN_S = 10.0
"""From the first line of a kind to the second; from there on each time twice as long, up to"""
SELDOM_S = 600.0
"""ten minutes. A traceback, which is long, has this distance from the first on."""


class Log:
    """
    A logger that makes every text printable and says things of one kind once in a while.

    What comes again and again, whatever figures are in it, is said at growing distances: a log of
    days stays readable, whatever comes in. Of a kind is what a reader would answer in one way.
    """

    def __init__(self, logger: RcutilsLogger) -> None:
        self._logger = logger
        self._said: dict[str, tuple[float, float]] = {}

    def info(self, text: str, kind: str = '') -> None:
        """Say what goes well; always, unless it is of a kind that somebody may call for."""
        if not kind or self._is_due(kind, OFTEN_S):
            self._logger.info(printable(text))

    def warning(self, text: str, kind: str, every_s: float = OFTEN_S) -> bool:
        """Say what the user should look at; whether it was said, see the class."""
        due = self._is_due(kind, every_s)
        if due:
            self._logger.warning(printable(text))
        return due

    def error(self, text: str, kind: str, every_s: float = OFTEN_S) -> None:
        """Say what does not work."""
        if self._is_due(kind, every_s):
            self._logger.error(printable(text))

    def bug(self, error: BaseException, consequence: str) -> None:
        """Show the traceback of an error that nobody foresaw, and say what happens now."""
        if self._is_due(f'bug {type(error).__name__} {consequence}', SELDOM_S):
            trace = ''.join(traceback.format_exception(error))
            self._logger.error(f'{trace}internal error: {consequence}; please report it')

    def _is_due(self, kind: str, every_s: float) -> bool:
        now = time.monotonic()
        said, pause_s = self._said.get(kind, (-math.inf, every_s))
        if now - said < pause_s:
            return False
        # What has kept quiet for long enough is news again.
        again = now - said < 2 * max(pause_s, SELDOM_S)
        self._said[kind] = now, min(2 * pause_s, SELDOM_S) if again else every_s
        return True
