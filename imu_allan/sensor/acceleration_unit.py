# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Acceleration published in g instead of m/s^2: detection and conversion.

Some drivers publish sensor_msgs/Imu in g (Livox; Hesai in its first versions). A sensor under
gravity that does not fall measures about 9.81 m/s^2, so a steady magnitude near 1 means g.
Messages are held back until that is decided, so that their division into blocks does not matter.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace

from imu_allan.arrays import Array, Bools
from imu_allan.block import ImuBlock
from imu_allan.finding import Finding, finding
from imu_allan.sensor.units import STANDARD_GRAVITY
import numpy as np

_SPAN = 32
"""A sensor that is steady for this many messages is at rest, or nearly."""


def _magnitudes(block: ImuBlock) -> Array:
    """Return the magnitude of each message, 0 if it is not known."""
    # Damaged messages may contain numbers of any size.
    with np.errstate(over='ignore', invalid='ignore'):
        magnitudes = np.sqrt((block.samples[:, 3:]**2).sum(axis=1))
    return np.where(np.isfinite(magnitudes) & ~block.absent[:, 1], magnitudes, 0.0)


def _looks(spans: Array) -> tuple[Bools, Bools]:
    """Return for each row of magnitudes whether it is in g, and whether it cannot be."""
    low, middle, high = np.percentile(spans, [5, 50, 95], axis=1)
    # Bias and scale error of the poorest sensors are 10 %. Free motion with gravity removed varies
    # more.
    in_g = (middle >= 0.9) & (middle <= 1.1) & (high - low <= 0.2)
    # However the sensor is held, nearly all magnitudes in g are between 0.5 and 2. Gravity in
    # m/s^2 lies above, acceleration with gravity removed below.
    return in_g, ~in_g & ((high < 0.5) | (low > 2.0))


class AccelerationUnit:
    """
    Converts acceleration found to be in g to m/s^2; the decision is made once.

    Parameters
    ----------
    decided : bool, optional
        Earlier decision for a stream that continues: whether it is in g.

    Attributes
    ----------
    decision : bool or None
        Whether the stream is in g; None while that is undecided.

    """

    def __init__(self, decided: bool | None = None) -> None:
        self.decision = decided
        self._waiting: list[ImuBlock] = []
        self._magnitudes = np.empty(0)    # of the messages held back

    @property
    def in_g(self) -> bool:
        """Whether the stream is in g, by the latest messages while that is undecided."""
        if self.decision is not None:
            return self.decision
        latest = self._usable[-_SPAN:]
        return len(latest) > 0 and bool(_looks(latest[None])[0][0])

    @property
    def _usable(self) -> Array:
        return self._magnitudes[self._magnitudes > 0]

    @property
    def remarks(self) -> list[Finding]:
        """Return the finding that the user should know; its code is `unit_g`."""
        return [finding('unit_g')] if self.in_g else []

    @property
    def waiting(self) -> list[ImuBlock]:
        """Return the messages held back, in m/s^2 by the latest messages."""
        return self._converted(self._waiting)

    def __call__(self, block: ImuBlock) -> list[ImuBlock]:
        """Take messages; return those whose unit is decided, in m/s^2."""
        if self.decision is not None:
            return self._converted([block])
        if self._waiting:
            return self._after(block)
        # Absent or zero acceleration is the same in any unit.
        informative = np.flatnonzero(
            (np.nan_to_num(block.samples[:, 3:]) != 0).any(axis=1) & ~block.absent[:, 1])
        if not len(informative):
            return [block]
        first = int(informative[0])
        return [*([block.part(slice(first))] if first else []),
                *self._after(block.part(slice(first, None)))]

    def each(self, blocks: Iterable[ImuBlock]) -> Iterator[ImuBlock]:
        """Yield the blocks with their acceleration in m/s^2."""
        for block in blocks:
            yield from self(block)
        yield from self.waiting

    def _after(self, block: ImuBlock) -> list[ImuBlock]:
        """Hold messages back, after earlier ones; return all when the unit is decided."""
        self._waiting.append(block)
        longest = 2048   # ten seconds at 200 Hz, in which somebody puts the sensor down
        self._magnitudes = np.append(self._magnitudes, _magnitudes(block))[:longest]
        usable = self._usable
        in_g, other = _looks(usable[:len(usable) // _SPAN * _SPAN].reshape(-1, _SPAN))
        # The first messages of a driver, or a steady push with gravity removed, may lie near 1 for
        # a while. Eight spans must look like g, and none unlike it.
        decisive = np.flatnonzero(other | (np.cumsum(in_g) == 8))
        if len(decisive):
            self.decision = bool(in_g[decisive[0]])
        elif len(self._magnitudes) < longest:
            return []
        else:
            self.decision = False
        ready, self._waiting = self.waiting, []
        return ready

    def _converted(self, blocks: list[ImuBlock]) -> list[ImuBlock]:
        if not self.in_g:
            return [*blocks]
        to_si = np.array([1, 1, 1, *3 * [STANDARD_GRAVITY]])
        return [replace(block, samples=block.samples * to_si) for block in blocks]
