# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Acceleration in g where m/s^2 is due.

Some drivers publish sensor_msgs/Imu in g (Livox; Hesai in its first versions). Anything that is
subject to gravity and does not fall shows about 9.81 m/s^2: a steady magnitude near 1 is g.
Messages wait until that is decided, so that how they come in blocks decides nothing.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from imu_allan.block import ImuBlock
from imu_allan.finding import Finding, finding
from imu_allan.sensor.units import STANDARD_GRAVITY
import numpy as np
from numpy.typing import NDArray

_SPAN = 32
"""Messages that are judged at once: what is steady for so long stands still, or nearly."""
_LONGEST_WAIT = 2048
"""Messages that wait at most: ten seconds at 200 Hz in which somebody sets the sensor down."""
_NEAR_ONE = (0.9, 1.1)
"""Median magnitude: ten per cent are bias and scale of the poorest sensors."""
_NO_G = (0.5, 2.0)
"""What nearly all of a span in g lies between, however it is held; gravity in m/s^2 lies above,
what somebody has taken gravity out of below."""


def _magnitudes(block: ImuBlock) -> NDArray[np.float64]:
    """Return the magnitude of each message, 0 where it says nothing."""
    # Damaged messages may hold numbers of any size.
    with np.errstate(over='ignore', invalid='ignore'):
        magnitudes = np.sqrt((block.samples[:, 3:]**2).sum(axis=1))
    return np.where(np.isfinite(magnitudes) & ~block.absent[:, 1], magnitudes, 0.0)


def _verdict(magnitudes: NDArray[np.float64]) -> bool | None:
    """Whether a span is in g; None where it may be, but does not stand still."""
    low, middle, high = np.percentile(magnitudes, [5, 50, 95])
    # What moves freely without gravity varies more.
    if _NEAR_ONE[0] <= middle <= _NEAR_ONE[1] and high - low <= 0.2:
        return True
    return False if high < _NO_G[0] or low > _NO_G[1] else None


class AccelerationUnit:
    """
    Turns acceleration that is found to be in g into m/s^2; decides once and keeps to it.

    Parameters
    ----------
    decided : bool, optional
        What was decided before, of a stream that goes on: whether it is in g.

    """

    def __init__(self, decided: bool | None = None) -> None:
        self._decision = decided
        self._waiting: list[ImuBlock] = []
        self._waited = self._unjudged = self._agreeing = 0
        self._latest = np.empty(0)

    @property
    def decision(self) -> bool | None:
        """Whether the stream is in g; None as long as that is open."""
        return self._decision

    @property
    def in_g(self) -> bool:
        """Whether the stream is in g, by the latest messages where that is still open."""
        if self._decision is not None:
            return self._decision
        return len(self._latest) > 0 and _verdict(self._latest) is True

    @property
    def remarks(self) -> list[Finding]:
        """Return what the user should know of it; code `unit_g`."""
        return [finding('unit_g')] if self.in_g else []

    @property
    def waiting(self) -> list[ImuBlock]:
        """Return the messages that wait, in m/s^2 by what they look like so far."""
        return self._converted(self._waiting)

    def __call__(self, block: ImuBlock) -> list[ImuBlock]:
        """Take messages; return those whose unit is decided, in m/s^2."""
        if self._decision is not None:
            return self._converted([block])
        if self._waiting:
            return self._after(block)
        # What has no acceleration, or zeros, is the same in any unit.
        informative = np.flatnonzero(
            (np.nan_to_num(block.samples[:, 3:]) != 0).any(axis=1) & ~block.absent[:, 1])
        if not len(informative):
            return [block]
        first = int(informative[0])
        return [*([block.part(slice(first))] if first else []),
                *self._after(block.part(slice(first, None)))]

    def each(self, blocks: Iterable[ImuBlock]) -> Iterator[ImuBlock]:
        """Return the blocks with their acceleration in m/s^2."""
        for block in blocks:
            yield from self(block)
        yield from self.waiting

    def _after(self, block: ImuBlock) -> list[ImuBlock]:
        """Let messages wait behind those before; return all once it is decided."""
        self._waiting.append(block)
        magnitudes = _magnitudes(block)[:_LONGEST_WAIT - self._waited]
        self._waited += len(magnitudes)
        usable = np.append(self._latest, magnitudes[magnitudes > 0])
        first = len(self._latest) - self._unjudged
        while self._decision is None and len(usable) - first >= _SPAN:
            verdict = _verdict(usable[first:first + _SPAN])
            first += _SPAN
            self._agreeing += verdict is True
            # A driver's first messages, or a steady push on what has gravity taken out, may lie
            # near 1 for a while: eight spans must look like g, and none unlike it.
            if verdict is False or self._agreeing == 8:
                self._decision = verdict
        self._unjudged, self._latest = len(usable) - first, usable[-_SPAN:]
        if self._decision is None:
            if self._waited < _LONGEST_WAIT:
                return []
            self._decision = False
        ready, self._waiting = self.waiting, []
        return ready

    def _converted(self, blocks: Sequence[ImuBlock]) -> list[ImuBlock]:
        to_si = np.array([1, 1, 1, *3 * [STANDARD_GRAVITY]])
        return ([replace(block, samples=block.samples * to_si) for block in blocks]
                if self.in_g else list(blocks))
