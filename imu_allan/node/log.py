# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The node's voice on /rosout: one line for each thing, and none of it over and over."""

import time
import traceback

from imu_allan.errors import printable
from rclpy.impl.rcutils_logger import RcutilsLogger

OFTEN_S = 10.0
"""An error that comes with every batch is said at most so often: the log stays readable."""
SELDOM_S = 600.0
"""A traceback is long, and the same bug has the same one."""


class Log:
    """
    A logger that makes every text printable and says the same thing only once in a while.

    Parameters
    ----------
    logger : rclpy logger
        Where it ends up.

    """

    def __init__(self, logger: RcutilsLogger) -> None:
        self._logger = logger
        self._said: dict[str, float] = {}

    def info(self, text: str) -> None:
        """Say what goes well."""
        self._logger.info(printable(text))

    def warning(self, text: str, topic: str = '', every_s: float = OFTEN_S) -> None:
        """Say what the user should look at; once in `every_s` about the same topic."""
        if self._is_due(topic or text, every_s):
            self._logger.warning(printable(text))

    def error(self, text: str, topic: str = '', every_s: float = OFTEN_S) -> None:
        """Say what does not work; once in `every_s` about the same topic."""
        if self._is_due(topic or text, every_s):
            self._logger.error(printable(text))

    def bug(self, error: BaseException, consequence: str) -> None:
        """Show the traceback of an error that nobody foresaw, and say what happens now."""
        if self._is_due(repr(error), SELDOM_S):
            trace = ''.join(traceback.format_exception(error))
            self._logger.error(f'{trace}internal error: {consequence}; please report it')

    def _is_due(self, topic: str, every_s: float) -> bool:
        now = time.monotonic()
        if now - self._said.get(topic, -every_s) < every_s:
            return False
        if len(self._said) > 1000:
            # Texts with numbers in them could pile up over the days.
            self._said.clear()
        self._said[topic] = now
        return True
